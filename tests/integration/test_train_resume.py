"""A run that is killed and resumed is the run that was never killed."""

import csv
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import torch

from deeplight.cli.main import main
from deeplight.dataset import open_dataset
from deeplight.errors import ConfigError, DataSetError, ModelError
from deeplight.training import checkpoint, fitted, loop
from deeplight.training.config import TrainConfig
from deeplight.training.data import BatchSource, ExampleBytes, Order
from deeplight.training.loop import BEST, Progress, Run, train
from deeplight.training.presets import preset
from deeplight.training.release import contract_of, load_best
from patience import patient

pytestmark = [pytest.mark.needs("safetensors"), pytest.mark.usefixtures("without_curves")]

# Everything that has a state or draws random numbers is on: batch norm, average, dropout, noise;
# and the discriminator, as in the preset `paper`. The network is the same one with fewer channels.
SETTINGS = (
    "network.width=0.35",
    "network.latent_size=32",
    "network.decoder_widths=[8, 8]",
    "network.output_size=16",
    "adversarial.widths=[4, 8, 8]",
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


@pytest.fixture(scope="module")
def data(toy) -> Path:
    return toy


@pytest.fixture(scope="module")
def whole(data, tmp_path_factory) -> Path:
    """The folder of an uninterrupted run; next to it, what a kill after step 3 would have left."""
    folder = tmp_path_factory.mktemp("runs") / "whole"

    def copied(progress: Progress) -> None:
        if progress.step == 3:  # its rows are written, the last checkpoint is of step 2
            shutil.copytree(folder, folder.with_name("killed"))

    train(data, folder, settings(), watch=copied)
    return folder


@pytest.fixture
def killed(whole, tmp_path) -> Path:
    """A run as it lies on the disk after a kill."""
    return Path(shutil.copytree(whole.with_name("killed"), tmp_path / "killed"))


def rows(folder: Path, table: str) -> list[dict[str, str]]:
    with (folder / table).open() as file:
        found = list(csv.DictReader(file))
    for row in found:
        row.pop("images_per_second", None)
    return found


def same_weights(folder: Path, other: Path) -> bool:
    """Equal to the last bit: weights, average, optimisers at the end, and the best weights."""
    pairs = [[checkpoint.latest(f) for f in (folder, other)], [folder / BEST, other / BEST]]
    return all(same_tensors(*(checkpoint.load(path)[1] for path in pair)) for pair in pairs)


def same_tensors(states, others) -> bool:
    return states.keys() == others.keys() and all(
        tensors.keys() == others[group].keys()
        and all(torch.equal(tensor, others[group][name]) for name, tensor in tensors.items())
        for group, tensors in states.items()
    )


def same_run(folder: Path, other: Path) -> bool:
    """Equal to the last bit: loss curve, validation and all weights."""
    tables = ("losses.csv", "validation.csv")
    return all(rows(folder, t) == rows(other, t) for t in tables) and same_weights(folder, other)


def command(data: Path, out: Path, *more: str) -> list[str]:
    """The words of `deeplight train`."""
    changes = [word for setting in (*SETTINGS, *more) for word in ("--set", setting)]
    return ["train", "--data", str(data), "--out", str(out), "--preset", "paper", *changes]


def started(words: list[str]) -> subprocess.Popen:
    quiet = subprocess.DEVNULL
    return subprocess.Popen([sys.executable, "-m", "deeplight", *words], stdout=quiet, stderr=quiet)


def wait_for(event, process: subprocess.Popen, seconds: float = 100) -> None:
    """Look a thousand times a second; a process that ended first is a failure."""
    deadline = time.monotonic() + patient(seconds)
    while not event():
        assert process.poll() is None, "it ended by itself"
        assert time.monotonic() < deadline
        time.sleep(0.001)


def kill(process: subprocess.Popen) -> None:
    assert process.poll() is None, "it ended by itself"
    process.send_signal(signal.SIGKILL)
    process.wait()


def test_a_run_killed_and_resumed_is_the_uninterrupted_run(data, whole, killed):
    """Real processes are killed below, which takes minutes."""
    assert checkpoint.load(checkpoint.latest(killed))[0].step == 2
    assert len(rows(killed, "losses.csv")) == 3
    train(data, killed, settings())
    assert len(rows(killed, "losses.csv")) == 6
    assert same_run(killed, whole)


@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_a_run_killed_ten_times_is_the_uninterrupted_run(data, tmp_path):
    """Real processes of one command, killed while they start, while they train, while they write.

    The moments are drawn from a fixed seed; every third kill waits for a checkpoint that is half
    written, and it goes on beyond ten until one was really torn.
    """
    more = ("schedule.steps=150", "run.checkpoint_every=1", "run.validate_every=10")
    train(data, tmp_path / "whole", settings(*more))
    folder, random, kills, torn = tmp_path / "killed", np.random.default_rng(0), 0, 0
    words = command(data, folder, *more)

    def half_written() -> set[Path]:
        return set(folder.glob("checkpoints/.step-*"))

    while kills < 10 or not torn:
        before, left = checkpoint.latest(folder), half_written()
        process = started(words)
        if kills % 3 == 0:
            time.sleep(random.uniform(0.0, 8.0))
        elif kills % 3 == 1:
            wait_for(lambda before=before: checkpoint.latest(folder) != before, process)
            time.sleep(random.uniform(0.0, 0.6))
        else:
            wait_for(lambda left=left: half_written() - left, process)
        kill(process)
        kills, torn = kills + 1, torn + bool(half_written() - left)
        assert kills < 30, "no checkpoint was hit while it was written"
    assert started(words).wait() == 0
    assert same_run(folder, tmp_path / "whole")
    assert len(list((folder / "checkpoints").iterdir())) == 2  # what was torn is cleared away
    other = tmp_path / "other"  # the twin: a curve that is not the same one
    train(data, other, settings(*more, "run.seed=1"))
    assert not same_weights(other, folder)


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
    honest, honest_inputs, seen = loop.reconstruction_terms, Run.inputs, []

    def broken(*arguments):
        terms = honest(*arguments)
        return type(terms)({"reconstruction": terms.total() * float("nan")}, terms.reported)

    def inputs(*arguments):
        seen.append(honest_inputs(*arguments))
        return seen[-1]

    monkeypatch.setattr(loop, "reconstruction_terms", broken)
    monkeypatch.setattr(Run, "inputs", inputs)
    with pytest.raises(ConfigError, match="at step 0"):
        train(data, tmp_path, settings())
    _, saved = checkpoint.load(tmp_path / "not-finite-step-00000000.safetensors")
    assert saved["batch"]["photo"].shape == (2, 3, 192, 135)
    for name, tensor in vars(seen[0]).items():  # as the network saw it, augmented
        assert torch.equal(saved["batch"][name], tensor)
    assert checkpoint.latest(tmp_path) is None
    assert not (tmp_path / BEST).exists()


@pytest.fixture(scope="module")
def seldom_logged(data, tmp_path_factory) -> Path:
    """A run that looks at its losses after step 2, and next after step 4; stopped after step 2."""
    folder = tmp_path_factory.mktemp("seldom")

    def stop(progress: Progress) -> None:
        if progress.step:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(data, folder, settings("run.log_every=4"), watch=stop)
    return folder


@pytest.mark.parametrize(
    "broken", ["loss", "discriminator", "gradient", "discriminator's gradient"]
)
def test_the_last_good_weights_survive_what_is_not_finite(
    data, seldom_logged, killed, tmp_path, monkeypatch, broken
):
    """Step 3 breaks, after the checkpoint of step 2; a gradient breaks weights, not its own loss.

    The state of an unbroken run is left, with which the same command goes on to its end (above).
    """
    run_dir, honest = shutil.copytree(seldom_logged, tmp_path / "broken"), Run.train_step

    def breaking(run, batch):
        networks = run.networks
        hurt = networks.generator
        if "discriminator" in broken:
            hurt = networks.adversary.discriminator
        terms = honest(run, batch) if "gradient" in broken else None
        if run.step == 3:
            for parameter in hurt.parameters():
                parameter.data.fill_(float("nan"))
        return terms or honest(run, batch)

    monkeypatch.setattr(Run, "train_step", breaking)
    with pytest.raises(ConfigError, match=r"at step 3.*step-00000002"):
        train(data, run_dir, settings("run.log_every=4"))
    (header, states), (good, unbroken) = (
        checkpoint.load(checkpoint.latest(run)) for run in (run_dir, killed)
    )
    assert header.step == good.step == 2
    assert same_tensors(states, unbroken)
    assert all(tensor.isfinite().all() for group in states.values() for tensor in group.values())
    assert (run_dir / "not-finite-step-00000003.safetensors").exists()
    assert not (run_dir / BEST).exists()  # step 4 would have been the first validation


def test_the_command_says_in_one_line_that_a_run_diverged(data, tmp_path, capfd):
    """A real overflow: no weight survives steps of that size."""
    assert main(command(data, tmp_path, "optimiser.learning_rate=1e38")) == 2
    *progress, line = capfd.readouterr().err.splitlines()
    assert [words.split()[0] for words in progress] == ["reading", "training"]
    assert "stay finite" in line
    assert "learning_rate" in line
    assert list(tmp_path.glob("not-finite-step-*.safetensors"))


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


def test_a_run_can_start_from_components_of_fitted_light(data, tmp_path, monkeypatch):
    """How well light is fitted is tested next to `fitted`; here a few steps are enough."""
    monkeypatch.setattr(fitted, "STEPS", 10)
    mixed = ("network.components=2", "optimiser.decoder_after=2", "schedule.steps=2")
    train(data, tmp_path, settings(*mixed, "run.validate_every=2"))
    table = np.load(tmp_path / "fitted" / "components.npy")
    assert table.shape == (3, 3, 16, 16)
    assert np.abs(table[1]).sum() > 0
    generator, _ = load_best(tmp_path)
    assert np.array_equal(generator.mixture.components.numpy(), table[1:])
    (tmp_path / "fitted" / "components.npy").unlink()  # from here on the checkpoint has them
    train(data, tmp_path, settings(*mixed, "run.validate_every=2"))
    assert not (tmp_path / "fitted" / "components.npy").exists()


def test_a_run_with_a_teacher_goes_on_as_it_began(data, root, tmp_path):
    """It starts as its teacher answers; resumed, it takes up its own weights again."""
    taught = (
        f"distil.teacher={root / 'tests' / 'golden' / 'tiny.onnx'}",
        "network.width=0.05",
        "network.latent_size=16",
        "schedule.steps=2",
        "run.checkpoint_every=1",
    )
    train(data, tmp_path / "whole", settings(*taught))
    half = checkpoint.checkpoint_path(tmp_path / "whole", 1)
    (tmp_path / "half" / "checkpoints").mkdir(parents=True)
    shutil.copy(half, tmp_path / "half" / "checkpoints")
    shutil.copy(tmp_path / "whole" / "losses.csv", tmp_path / "half")
    train(data, tmp_path / "half", settings(*taught))
    assert same_run(tmp_path / "half", tmp_path / "whole")


def test_a_run_can_start_from_the_weights_of_another(data, whole, tmp_path):
    """Without steps of any size, what it validates is the old run's best network."""
    still = settings("optimiser.learning_rate=0.0", "schedule.steps=1", "run.validate_every=1")
    train(data, tmp_path / "new", still, weights=whole / BEST)
    old, new = (load_best(folder)[0] for folder in (whole, tmp_path / "new"))
    for (name, before), after in zip(old.named_parameters(), new.parameters(), strict=True):
        if name == "decoder.up3.weight":  # no batch norm to drift
            torch.testing.assert_close(before, after)
    other = settings("network.latent_size=64", "schedule.steps=1")
    with pytest.raises(ModelError, match="same `network`"):
        train(data, tmp_path / "other", other, weights=whole / BEST)
