"""Training on takes filmed while it goes on: new ones in each epoch, the same after a stop.

What an epoch is and how a run learns from epochs meet in one protocol, so that each is tested
alone: epochs that are filmed, and batches of epochs that are quickly made.
"""

import multiprocessing
import shutil
import time
from dataclasses import replace

import numpy as np
import pytest
import torch

from deeplight.dataset import open_dataset
from deeplight.errors import ConfigError, DataSetError
from deeplight.io.radiance import write_exr
from deeplight.jobs import Engine, processes
from deeplight.simulate.epochs import FilmedEpochs
from deeplight.simulate.run import Recipe
from deeplight.training import checkpoint
from deeplight.training.data import DataConfig
from deeplight.training.epochs import make_epoch
from deeplight.training.fresh import Fresh, FreshBatches
from deeplight.training.loop import train
from deeplight.training.presets import preset
from patience import patient
from toy_data import ToyEpochs, write_toy_data

pytestmark = [pytest.mark.needs("safetensors"), pytest.mark.usefixtures("without_curves")]

RECIPE = Recipe(train_takes=2, frames=1, shard_takes=2)
HERE = Engine(workers=1)
PLACES = ("one", "two")
SETTINGS = (
    "network.width=0.35",
    "network.latent_size=16",
    "network.decoder_widths=[8, 8]",
    "network.output_size=16",
    "schedule.batch_size=3",
    "schedule.steps=4",
    "data.workers=0",
    "data.place_balanced=true",
    "run.validate_every=4",
    "run.checkpoint_every=2",
    "run.constant_steps=0",
    "run.accelerator=cpu",
)


@pytest.fixture(scope="module")
def hdri(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hdri")
    random = np.random.default_rng(0)
    for name in PLACES:
        write_exr(folder / f"{name}.exr", random.uniform(0.1, 2, (64, 128, 3)).astype(np.float32))
    return folder


def epochs_in(hdri, folder):
    return FilmedEpochs(hdri, folder, RECIPE, HERE)


def photos(data):
    index = data.index("train")
    return np.stack([index.pixels(number)[0] for number in range(len(index))])


def test_every_epoch_has_new_takes_and_always_the_same(hdri, tmp_path):
    epochs = epochs_in(hdri, tmp_path / "a")
    first, second = (photos(epochs.epoch(number)) for number in (0, 1))
    assert len(first) == epochs.length == 4
    assert np.abs(first.astype(int) - second).max() > 30
    alone = epochs_in(hdri, tmp_path / "b")  # without the one before it, in another process
    with processes(1) as pool:
        pool.submit(make_epoch, alone, 1).result()
    made = {path: path.stat().st_mtime_ns for path in (tmp_path / "b").rglob("*.tar")}
    np.testing.assert_array_equal(second, photos(alone.epoch(1)))
    assert made == {path: path.stat().st_mtime_ns for path in made}  # it was found, not made again
    assert epochs.fingerprint == epochs_in(hdri, tmp_path / "c").fingerprint
    other = FilmedEpochs(hdri, tmp_path / "c", replace(RECIPE, seed=1), HERE)
    assert other.fingerprint != epochs.fingerprint


def test_what_is_on_the_disk_does_not_grow(hdri, tmp_path):
    (tmp_path / "hdri").mkdir()
    shutil.copy(hdri / "one.exr", tmp_path / "hdri")
    recipe = replace(RECIPE, train_takes=1)
    epochs = FilmedEpochs(tmp_path / "hdri", tmp_path / "epochs", recipe, HERE)
    for number in range(5):
        epochs.epoch(number)
    kept = sorted(p.name for p in (tmp_path / "epochs").iterdir())
    assert kept == [f"epoch-{n:06d}" for n in (2, 3, 4)]


def batches_of(epochs, place_balanced=False):
    config = DataConfig(workers=0, place_balanced=place_balanced)
    return FreshBatches(Fresh(epochs, ["paper"], "portrait"), config, 3, torch.device("cpu"))


def test_batches_are_a_function_of_the_step(tmp_path):
    source = batches_of(ToyEpochs(tmp_path), place_balanced=True)
    whole = list(source.batches(3, 0, 4))  # an epoch of four has one batch of three
    later = list(source.batches(3, 2, 4))
    for batch, same in zip(whole[2:], later, strict=True):
        assert torch.equal(batch.photo, same.photo)
        assert torch.equal(batch.spheres, same.spheres)
    assert not torch.equal(whole[0].photo, whole[1].photo)
    with pytest.raises(ConfigError, match="epochs of at least a batch of 9"):
        source.steps(9)


def test_a_panorama_that_cannot_be_read_is_missing_from_every_epoch(hdri, tmp_path):
    shutil.copytree(hdri, tmp_path / "hdri")
    (tmp_path / "hdri" / "three.exr").write_bytes(b"no picture")
    epochs = epochs_in(tmp_path / "hdri", tmp_path / "epochs")
    assert epochs.length == 6
    assert len(photos(epochs.epoch(0))) == 4


def test_examples_that_are_missing_leave_the_batches_whole(tmp_path):
    source = batches_of(ToyEpochs(tmp_path, length=6, missing=2))
    whole = list(source.batches(2, 0, 4))  # an epoch of six, of which there are four
    assert [len(batch.photo) for batch in whole] == [2, 2, 2, 2]
    assert torch.equal(whole[2].photo, whole[0].photo)
    assert not torch.equal(whole[1].photo, whole[0].photo)
    (later,) = source.batches(2, 2, 3)
    assert torch.equal(whole[2].photo, later.photo)


def test_who_stops_does_not_wait_for_the_next_epoch(tmp_path):
    source = batches_of(ToyEpochs(tmp_path, slow=True))
    going = source.batches(2, 0, 2 * source.steps(2))
    next(going)
    before = time.monotonic()
    while not (tmp_path / "begun").exists():
        assert time.monotonic() - before < patient(60)
        time.sleep(0.05)
    before = time.monotonic()
    going.close()
    assert time.monotonic() - before < patient(20)
    for child in multiprocessing.active_children():  # it has been asked to end
        child.join(patient(20))
        assert not child.is_alive()


def test_a_run_that_was_stopped_goes_on_to_the_last_bit(tmp_path):
    data = write_toy_data(tmp_path / "data", {"train": 3, "val_indoor": 3})
    config, whole, part = preset("small", SETTINGS), tmp_path / "whole", tmp_path / "part"
    train(data, whole, config, fresh=ToyEpochs(whole / "fresh"))
    shutil.copytree(whole, part)
    shutil.rmtree(part / "fresh")
    checkpoint.checkpoint_path(part, 4).unlink()
    train(data, part, config, fresh=ToyEpochs(part / "fresh"))
    ends = [checkpoint.load(checkpoint.checkpoint_path(run, 4))[1] for run in (whole, part)]
    for group, tensors in ends[0].items():
        for name, tensor in tensors.items():
            assert torch.equal(tensor, ends[1][group][name]), name
    with pytest.raises(ConfigError):  # other examples are another run
        train(data, part, config, fresh=ToyEpochs(part / "fresh", length=5))


def test_nothing_is_filmed_in_places_kept_for_validation(hdri, tmp_path):
    """`data` validates in a place of the panoramas."""
    kept = tmp_path / "data"
    shutil.copytree(hdri, tmp_path / "hdri")
    (tmp_path / "hdri" / "manifest.csv").write_text(
        "file,split,place,scene,licence,synthetic_ground\n"
        "one.exr,val,one,indoor,CC0,no\ntwo.exr,train,two,indoor,CC0,no\n"
    )
    from deeplight.simulate.run import plan, simulate

    simulate(*plan(tmp_path / "hdri", kept, replace(RECIPE, eval_takes=1, seen_takes=0)), HERE)
    assert open_dataset(kept).manifest.places("val_indoor")
    fresh = epochs_in(hdri, tmp_path / "run" / "fresh")
    with pytest.raises(DataSetError, match="one"):
        train(kept, tmp_path / "run", preset("small", SETTINGS), fresh=fresh)
