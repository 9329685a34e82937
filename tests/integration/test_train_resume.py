"""A run that is killed and resumed is the run that was never killed."""

import csv
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("safetensors")

from deeplight.dataset import Example, ExampleMeta, ShardPlan, open_dataset, plan_split  # noqa: E402
from deeplight.errors import ConfigError, DataSetError, ModelError  # noqa: E402
from deeplight.sphere import PAPER_RIG  # noqa: E402
from deeplight.training import checkpoint, loop  # noqa: E402
from deeplight.training.batches import BatchSource, ExampleBytes, Order  # noqa: E402
from deeplight.training.config import TrainConfig  # noqa: E402
from deeplight.training.loop import BEST, Run, train  # noqa: E402
from deeplight.training.presets import preset  # noqa: E402
from deeplight.training.release import contract_of, load_best  # noqa: E402

COUNTS = {"train": 12, "val_indoor": 3, "val_outdoor": 3}

# Everything that has a state or draws random numbers is on: batch norm, average, dropout, noise;
# and the discriminator, as in the preset `paper`.
SETTINGS = (
    "schedule.batch_size=2",
    "schedule.steps=6",
    "schedule.shape=cosine",
    "network.latent_dropout=0.2",
    "optimiser.ema_decay=0.9",
    "optimiser.weight_decay=0.01",
    "optimiser.max_gradient_norm=1.0",
    "augment.cutout=0.3",
    "augment.noise=0.01",
    "data.place_balanced=true",
    "data.workers=0",
    "run.validate_every=4",
    "run.checkpoint_every=2",
    "run.log_every=1",
    "run.constant_steps=5",
    "run.accelerator=cpu",
)


def settings(*more: str) -> TrainConfig:
    return preset("paper", [*SETTINGS, *more])


def toy_examples(job):
    """Each place has its colour, on the photo and on the spheres."""
    for number in range(job.first, job.first + job.count):
        random = np.random.default_rng([len(job.split), number])
        colour = random.uniform(40, 220, 3)
        photo = random.normal(colour, 12, (192, 135, 3)).clip(0, 255).astype(np.uint8)
        spheres = {
            name: np.full((32, 32, 3), colour * share).astype(np.uint8)
            for name, share in (("mirror", 0.9), ("matte_silver", 0.8), ("diffuse", 0.6))
        }
        scene = "outdoor" if job.split.endswith("outdoor") else "indoor"
        where = (f"{job.split}-{number % 3}", "take", number, scene, job.split)
        meta = ExampleMeta(*where, "paper", "toy", "CC0", "made up")
        yield Example(f"{job.split}-{number}", photo, spheres, meta)


@pytest.fixture(scope="module")
def data(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("data")
    jobs = [job for split, count in COUNTS.items() for job in plan_split(split, count)]
    plan = ShardPlan.begin(folder, jobs, {"paper": PAPER_RIG.to_dict()}, {})
    for job in plan.missing():
        plan.write(job, toy_examples(job))
    plan.finish()
    return folder


@pytest.fixture(scope="module")
def whole(data, tmp_path_factory) -> Path:
    """The folder of an uninterrupted run."""
    folder = tmp_path_factory.mktemp("whole")
    train(data, folder, settings())
    return folder


def rows(folder: Path, table: str) -> list[dict[str, str]]:
    with (folder / table).open() as file:
        found = list(csv.DictReader(file))
    for row in found:
        row.pop("images_per_second", None)
    return found


def same_run(folder: Path, other: Path) -> bool:
    """Equal to the last bit: loss curve, validation, weights, average, optimiser."""
    ends = [checkpoint.load(checkpoint.latest(f))[1] for f in (folder, other)]
    return (
        rows(folder, "losses.csv") == rows(other, "losses.csv")
        and rows(folder, "validation.csv") == rows(other, "validation.csv")
        and ends[0].keys() == ends[1].keys()
        and all(
            torch.equal(tensor, ends[1][group][name])
            for group, tensors in ends[0].items()
            for name, tensor in tensors.items()
        )
    )


KILLED = """
import sys
from pathlib import Path
from deeplight.training.presets import preset
from deeplight.training.loop import train
data, out, *settings = sys.argv[1:]
train(Path(data), Path(out), preset("paper", settings))
"""


def test_a_run_killed_and_resumed_is_the_uninterrupted_run(data, whole, tmp_path):
    arguments = [sys.executable, "-c", KILLED, str(data), str(tmp_path), *SETTINGS]
    process = subprocess.Popen(arguments)
    deadline = time.monotonic() + 100
    while checkpoint.latest(tmp_path) is None and process.poll() is None:
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert checkpoint.load(checkpoint.latest(tmp_path))[0].step < 6, "it was not killed in time"

    train(data, tmp_path, settings())
    assert len(rows(tmp_path, "losses.csv")) == 6
    assert same_run(tmp_path, whole)


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_a_run_killed_ten_times_is_the_uninterrupted_run(data, tmp_path):
    """At random moments, whatever is being written just then."""
    more = ("schedule.steps=40", "run.checkpoint_every=1")
    train(data, tmp_path / "whole", settings(*more))
    folder, random, kills = tmp_path / "killed", np.random.default_rng(0), 0
    while kills < 10:
        before = checkpoint.latest(folder)
        arguments = [sys.executable, "-c", KILLED, str(data), str(folder), *SETTINGS, *more]
        process = subprocess.Popen(arguments)
        while checkpoint.latest(folder) == before and process.poll() is None:
            time.sleep(0.01)
        time.sleep(random.uniform(0.0, 0.6))
        assert process.poll() is None, f"finished after {kills} kills"
        process.send_signal(signal.SIGKILL)
        process.wait()
        kills += 1
    train(data, folder, settings(*more))
    assert same_run(folder, tmp_path / "whole")


def test_another_seed_is_another_run(data, whole, tmp_path):
    train(data, tmp_path, settings("run.seed=1"))
    assert not same_run(tmp_path, whole)


def test_a_finished_run_is_left_as_it_is(data, whole):
    before = rows(whole, "losses.csv")
    train(data, whole, settings())
    assert rows(whole, "losses.csv") == before


def test_a_folder_holds_one_run(data, whole):
    with pytest.raises(ConfigError, match=r"learning_rate.*--out"):
        train(data, whole, settings("optimiser.learning_rate=1.0"))


def test_what_a_run_leaves(whole):
    names = {path.name for path in whole.iterdir()}
    expected = {"run.toml", "losses.csv", "validation.csv", "curves.png", "tensorboard"}
    assert expected | {"best.safetensors", "constant_log_radiance.npy", "checkpoints"} == names
    assert len(list((whole / "checkpoints").iterdir())) == 2
    splits = [row["split"] for row in rows(whole, "validation.csv")]
    assert splits == ["val_indoor", "val_outdoor"] * 2
    assert float(rows(whole, "validation.csv")[0]["constant_diffuse"]) > 0


def test_the_best_weights_come_back_without_batch_norm(whole):
    generator, header = load_best(whole)
    assert not any(isinstance(m, torch.nn.BatchNorm2d) for m in generator.modules())
    assert contract_of(header).trained_on.startswith(
        f"step {header.step}, {2 * header.step} photos"
    )


def test_a_loss_that_is_not_finite_stops_the_run_and_saves_its_batch(data, tmp_path, monkeypatch):
    honest = loop.reconstruction_terms

    def broken(*arguments):
        terms = honest(*arguments)
        return type(terms)({"reconstruction": terms.total() * float("nan")}, terms.reported)

    monkeypatch.setattr(loop, "reconstruction_terms", broken)
    with pytest.raises(ConfigError, match="at step 0"):
        train(data, tmp_path, settings())
    _, saved = checkpoint.load(tmp_path / "not-finite-step-00000000.safetensors")
    assert saved["batch"]["photo"].shape == (2, 3, 192, 135)
    assert checkpoint.latest(tmp_path) is None


@pytest.mark.parametrize("broken", ["loss", "discriminator"])
def test_the_last_good_weights_survive_a_loss_that_is_not_finite(
    data, tmp_path, monkeypatch, broken
):
    """Step 3 breaks, after the checkpoint of step 2."""
    honest = Run.train_step

    def breaking(run, batch):
        if run.step == 3:
            hurt = run.generator if broken == "loss" else run.adversary.discriminator
            for parameter in hurt.parameters():
                parameter.data.fill_(float("nan"))
        return honest(run, batch)

    monkeypatch.setattr(Run, "train_step", breaking)
    with pytest.raises(ConfigError, match=r"at step 3.*step-00000002"):
        train(data, tmp_path, settings("run.log_every=4"))
    header, states = checkpoint.load(checkpoint.latest(tmp_path))
    assert header.step == 2
    assert all(tensor.isfinite().all() for group in states.values() for tensor in group.values())
    assert (tmp_path / "not-finite-step-00000003.safetensors").exists()

    monkeypatch.undo()  # and the run goes on from there
    train(data, tmp_path, settings("run.log_every=4"))
    assert checkpoint.load(checkpoint.latest(tmp_path))[0].step == 6


@pytest.mark.parametrize("workers", [0, 1])
def test_reading_from_disk_and_from_memory_give_the_same_batches(data, workers):
    examples = ExampleBytes(open_dataset(data).index("train"), ["paper"])
    order = Order(len(examples), 0)
    sources = [
        BatchSource(
            examples, settings(f"data.workers={workers}", size).data, order, torch.device("cpu")
        )
        for size in ("data.preload_gib=0.0", "data.preload_gib=1.0")
    ]
    assert [source.table is None for source in sources] == [True, False]
    for disk, memory in zip(*(source.batches(5, 2, 5) for source in sources), strict=True):
        for left, right in zip(disk, memory, strict=True):
            assert torch.equal(left, right)


def test_what_cannot_be_trained_is_refused(data, tmp_path):
    with pytest.raises(ConfigError, match="multiple of devices"):
        train(data, tmp_path, settings("run.devices=3"))
    with pytest.raises(DataSetError, match="unseen_indoor"):
        train(data, tmp_path, settings('data.validation_splits=["unseen_indoor"]'))
    with pytest.raises(ModelError):
        load_best(tmp_path)


def test_a_run_can_start_from_components_of_fitted_light(data, tmp_path):
    mixed = ("network.components=2", "optimiser.decoder_after=2", "schedule.steps=2")
    train(data, tmp_path, settings(*mixed, "run.validate_every=2"))
    table = np.load(tmp_path / "fitted" / "components.npy")
    assert table.shape == (3, 3, 32, 32)
    assert np.abs(table[1]).sum() > 0
    generator, _ = load_best(tmp_path)
    assert np.array_equal(generator.mixture.components.numpy(), table[1:])
    (tmp_path / "fitted" / "components.npy").unlink()  # from here on the checkpoint has them
    train(data, tmp_path, settings(*mixed, "run.validate_every=2"))
    assert not (tmp_path / "fitted" / "components.npy").exists()


def test_a_run_can_start_from_the_weights_of_another(data, whole, tmp_path):
    """Without steps of any size, what it validates is the old run's best network."""
    still = settings("optimiser.learning_rate=0.0", "schedule.steps=1", "run.validate_every=1")
    train(data, tmp_path / "new", still, weights=whole / BEST)
    old, new = (load_best(folder)[0] for folder in (whole, tmp_path / "new"))
    for (name, before), after in zip(old.named_parameters(), new.parameters(), strict=True):
        if name == "decoder.up3.weight":  # no batch norm to drift
            torch.testing.assert_close(before, after)
    other = settings("network.latent_size=128", "schedule.steps=1")
    with pytest.raises(ModelError, match="same `network`"):
        train(data, tmp_path / "other", other, weights=whole / BEST)
