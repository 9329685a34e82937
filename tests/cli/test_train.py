"""`deeplight train` with what cannot be trained on: one line, exit 2, no folder. What it prints."""

from pathlib import Path

import numpy as np
import pytest

from deeplight.cli.main import main
from deeplight.cli.train import TrainProgress, finish
from deeplight.errors import ConfigError, ModelError
from deeplight.training import checkpoint
from deeplight.training.config import RunConfig
from deeplight.training.devices import fabric
from deeplight.training.loop import Progress
from deeplight.training.network.imagenet import read_folded
from deeplight.training.presets import preset


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "no such folder"),
        (("--preset", "largest"), "largest"),
        (("--minutes", "-1"), "time_limit_minutes of at least 0"),
        (("--set", "schedule.batch_size=0"), "batch_size of at least 1"),
        (("--set", "optimiser.learning_rate=nan"), "learning_rate of at least 0"),
        (("--set", "schedule.speed=9"), "schedule.speed"),
    ],
)
def test_bad_words_are_one_line_and_no_folder(tmp_path, capfd, words, message):
    out = tmp_path / "run"
    assert main(["train", "--data", str(tmp_path / "no"), "--out", str(out), *words]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith("deeplight train: expected ")
    assert message in line
    assert not out.exists()


def imagenet_file(kind: str, folder: Path) -> Path:
    path = folder / "weights.npz"
    if kind == "folder":
        path.mkdir()
    elif kind == "text":
        path.write_text("no weights")
    elif kind == "zero bytes":
        path.write_bytes(b"")
    elif kind == "one array":
        with path.open("wb") as file:
            np.save(file, np.ones(3))
    else:
        np.savez(path, a=np.arange(1000.0))
        whole = bytearray(path.read_bytes())
        whole[500:600] = bytes(100)
        path.write_bytes(whole[:2000] if kind == "truncated" else whole)
    return path


@pytest.mark.parametrize(
    "kind", ["folder", "text", "zero bytes", "one array", "truncated", "damaged"]
)
def test_a_wrong_imagenet_file_is_reported(tmp_path, kind):
    with pytest.raises(ModelError, match=r"weights\.npz"):
        read_folded(imagenet_file(kind, tmp_path))


def test_a_missing_imagenet_file_is_the_systems_error(tmp_path):
    with pytest.raises(FileNotFoundError):
        read_folded(tmp_path / "no.npz")


def test_an_accelerator_that_is_not_there_is_reported():
    with pytest.raises(ConfigError, match="accelerator"):
        fabric(RunConfig(accelerator="quantum"))
    assert preset("small", ["run.accelerator=cpu"]).run.accelerator == "cpu"


def test_a_run_prints_at_the_end_which_step_was_best(tmp_path, capsys):
    finish(tmp_path, "data", None)
    assert capsys.readouterr().out == ""  # stopped before the first validation
    header = checkpoint.Header(7, 0.5, {}, "abc")
    checkpoint.save(tmp_path / checkpoint.BEST, header, generator={})
    finish(tmp_path, "data", None)
    assert capsys.readouterr().out.startswith(f"{tmp_path}: best at step 7; look at ")


def test_a_log_says_what_goes_on_before_the_first_loss(capsys, monkeypatch):
    begun = iter([0.0])  # all that follows is long after it
    monkeypatch.setattr("deeplight.cli.screen.time.monotonic", lambda: next(begun, 1000.0))
    with TrainProgress() as progress:
        progress.show(Progress(0, 0, float("nan"), 0.0))
        progress.show(Progress(40, 900, float("nan"), 0.0))
    assert capsys.readouterr().err.splitlines() == [
        "reading the data, fitting the best constant lighting",
        "training from step 40 of 900",
    ]
