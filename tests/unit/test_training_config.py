"""Presets, settings and the schedule."""

import json
import shutil
import subprocess
import tomllib
from dataclasses import asdict
from importlib.metadata import version
from importlib.util import module_from_spec, spec_from_file_location

import pytest

from deeplight.errors import ConfigError
from deeplight.report import run_record
from deeplight.report.run_record import write_run_toml
from deeplight.sphere import SPHERES
from deeplight.training.config import differences, flatten
from deeplight.training.optimiser import ScheduleConfig
from deeplight.training.presets import PRESETS, preset


def test_the_paper_preset_has_the_papers_numbers():
    """Section 3.4, Implementation Details."""
    values = flatten(PRESETS["paper"])
    expected = {
        "optimiser.learning_rate": 1.5e-4,
        "optimiser.beta1": 0.9,
        "optimiser.beta2": 0.999,
        "optimiser.weight_decay": 0.0,
        "optimiser.ema_decay": 0.0,
        "schedule.batch_size": 32,
        "schedule.epochs": 16.0,
        "schedule.shape": "constant",
        "loss.mirror": 0.2,
        "loss.diffuse": 0.6,
        "loss.matte_silver": 0.2,
        "network.encoder_norm": "batch",
        "network.decoder_norm": "batch",
        "network.latent_size": 256,
        "augment.flip": True,
        "adversarial.enabled": True,
        "adversarial.lambda_rec": 0.999,
        "adversarial.learning_rate_factor": 0.01,
        "adversarial.form": "minimax",
        "augment.cutout": 0.0,
        "augment.white_balance": 0.0,
    }
    assert {key: values[key] for key in expected} == expected


@pytest.mark.parametrize(
    ("name", "sphere"), [("m", "mirror"), ("s", "matte_silver"), ("d", "diffuse")]
)
def test_an_ablation_is_taught_by_one_sphere(name, sphere):
    for base in ("paper", "small", "gpu"):
        weights = PRESETS[f"{base}-{name}"].loss.weights()
        assert dict(zip(SPHERES, weights, strict=True)) == {
            other: float(other == sphere) for other in SPHERES
        }


def test_settings_change_a_preset():
    config = preset(
        "small",
        [
            "loss.form=paper",
            "schedule.steps=7",
            "augment.flip=false",
            "optimiser.learning_rate=1",
            "network.decoder_widths=[8, 8]",
        ],
    )
    assert config.loss.form == "paper"
    assert config.schedule.steps == 7
    assert config.augment.flip is False
    assert config.optimiser.learning_rate == 1.0
    assert config.network.decoder_widths == (8, 8)


@pytest.mark.parametrize(
    "setting",
    [
        "loss.from=paper",
        "lr=3",
        "loss.form=other",
        "schedule.steps=few",
        "augment.flip=1",
        "adversarial.form=wasserstein",
        "adversarial.lambda_rec=1.5",
        "loss.form",
    ],
)
def test_a_wrong_setting_is_refused(setting):
    with pytest.raises(ConfigError):
        preset("paper", [setting])


def test_an_unknown_preset_is_refused():
    with pytest.raises(ConfigError, match="small"):
        preset("tiny")


def test_a_resumed_run_may_change_only_what_changes_no_result():
    old = json.loads(json.dumps(flatten(PRESETS["small"])))
    assert differences(old, preset("small", ["data.workers=0", "run.time_limit_minutes=3.0"])) == []
    assert differences(old, preset("small", ["loss.form=paper"])) == [
        "loss.form consistent -> paper"
    ]


def test_a_run_older_than_a_setting_is_resumed_with_it_off():
    old = json.loads(json.dumps(flatten(PRESETS["small"])))
    for key in [key for key in old if key.startswith("adversarial.")]:
        del old[key]
    assert differences(old, preset("small")) == []
    assert differences(old, preset("small-adv")) == ["adversarial.enabled False -> True"]


def test_steps_follow_from_epochs():
    assert ScheduleConfig().total_steps(4_060_000) == 2_030_000  # the paper's run
    assert ScheduleConfig(steps=5).total_steps(1000) == 5


def test_the_cosine_rises_and_falls():
    schedule = ScheduleConfig(shape="cosine", warmup_steps=10, final_factor=0.1)
    factors = [schedule.factor(step, 100) for step in range(101)]
    assert factors[9] == factors[10] == 1.0
    assert factors[:10] == sorted(factors[:10])
    assert factors[10:] == sorted(factors[10:], reverse=True)
    assert factors[100] == pytest.approx(0.1)


def test_run_toml_holds_the_settings(tmp_path):
    config = PRESETS["small"]
    write_run_toml(tmp_path, asdict(config), {"seed": 0, "data": 'a "quoted" folder'})
    read = tomllib.loads((tmp_path / "run.toml").read_text())
    assert read["run_facts"]["data"] == 'a "quoted" folder'
    assert read["versions"]["torch"]
    for key, value in flatten(config).items():
        section, _, name = key.partition(".")
        if value is not None:
            assert read[section][name] == (list(value) if isinstance(value, tuple) else value)


@pytest.mark.parametrize("around", ["nothing", "another repository"])
def test_an_installed_package_names_its_version_in_place_of_a_commit(tmp_path, around):
    copied = tmp_path / ".venv" / "run_record.py"
    copied.parent.mkdir()
    shutil.copy(run_record.__file__, copied)
    if around != "nothing":
        (tmp_path / "own.txt").write_text("theirs")
        name = ("-c", "user.name=a", "-c", "user.email=a@b.c")
        for words in (("init", "-q"), ("add", "own.txt"), (*name, "commit", "-qm", "a")):
            subprocess.run(("git", *words), cwd=tmp_path, check=True)
    spec = spec_from_file_location("installed_run_record", copied)
    installed = module_from_spec(spec)
    spec.loader.exec_module(installed)
    installed.write_run_toml(tmp_path, {}, {})
    facts = tomllib.loads((tmp_path / "run.toml").read_text())["run_facts"]
    assert facts["commit"] == f"deeplight {version('deeplight')}"
