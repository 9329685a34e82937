"""Training on takes filmed while it goes on: new ones in each epoch, the same after a stop."""

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
from deeplight.jobs import Engine
from deeplight.simulate.epochs import FilmedEpochs
from deeplight.simulate.run import Recipe
from deeplight.training import checkpoint
from deeplight.training.data import DataConfig
from deeplight.training.fresh import Fresh, FreshBatches
from deeplight.training.loop import train
from deeplight.training.presets import preset
from patience import patient
from toy_data import write_toy_data

pytestmark = pytest.mark.needs("safetensors")

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
    again = photos(epochs_in(hdri, tmp_path / "b").epoch(1))  # without the one before it
    np.testing.assert_array_equal(second, again)
    assert epochs.fingerprint == epochs_in(hdri, tmp_path / "c").fingerprint
    other = FilmedEpochs(hdri, tmp_path / "c", replace(RECIPE, seed=1), HERE)
    assert other.fingerprint != epochs.fingerprint


def test_what_is_on_the_disk_does_not_grow(hdri, tmp_path):
    epochs = epochs_in(hdri, tmp_path)
    for number in range(5):
        epochs.epoch(number)
    assert sorted(p.name for p in tmp_path.iterdir()) == [f"epoch-{n:06d}" for n in (2, 3, 4)]


def test_batches_are_a_function_of_the_step(hdri, tmp_path):
    epochs = epochs_in(hdri, tmp_path)
    config = DataConfig(workers=0, place_balanced=True)
    source = FreshBatches(Fresh(epochs, ["paper"], "portrait"), config, 3, torch.device("cpu"))
    whole = list(source.batches(3, 0, 4))  # an epoch of four has one batch of three
    later = list(source.batches(3, 2, 4))
    for batch, same in zip(whole[2:], later, strict=True):
        assert torch.equal(batch.photo, same.photo)
        assert torch.equal(batch.spheres, same.spheres)
    assert not torch.equal(whole[0].photo, whole[1].photo)
    with pytest.raises(ConfigError, match="epochs of at least a batch of 9"):
        source.steps(9)


def test_a_panorama_that_cannot_be_read_leaves_the_batches_whole(hdri, tmp_path):
    shutil.copytree(hdri, tmp_path / "hdri")
    (tmp_path / "hdri" / "three.exr").write_bytes(b"no picture")
    epochs = epochs_in(tmp_path / "hdri", tmp_path / "epochs")
    fresh = Fresh(epochs, ["paper"], "portrait")
    source = FreshBatches(fresh, DataConfig(workers=0), 3, torch.device("cpu"))
    whole = list(source.batches(2, 0, 4))  # an epoch of six, of which there are four
    assert epochs.length == 6
    assert [len(batch.photo) for batch in whole] == [2, 2, 2, 2]
    assert torch.equal(whole[2].photo, whole[0].photo)
    assert not torch.equal(whole[1].photo, whole[0].photo)
    (later,) = source.batches(2, 2, 3)
    assert torch.equal(whole[2].photo, later.photo)


class SlowEpochs(FilmedEpochs):
    """Its second epoch takes longer than anybody waits."""

    def epoch(self, number):
        if number:
            (self.folder / "begun").touch()
            time.sleep(600)
        return super().epoch(number)


def test_who_stops_does_not_wait_for_the_next_epoch(hdri, tmp_path):
    slow = SlowEpochs(hdri, tmp_path, RECIPE, HERE)
    config = DataConfig(workers=0)
    source = FreshBatches(Fresh(slow, ["paper"], "portrait"), config, 0, torch.device("cpu"))
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


def test_a_run_that_was_stopped_goes_on_to_the_last_bit(hdri, tmp_path):
    data = write_toy_data(tmp_path / "data", {"train": 3, "val_indoor": 3})
    config, whole, part = preset("small", SETTINGS), tmp_path / "whole", tmp_path / "part"
    train(data, whole, config, fresh=epochs_in(hdri, whole / "fresh"))
    shutil.copytree(whole, part)
    shutil.rmtree(part / "fresh")
    checkpoint.checkpoint_path(part, 4).unlink()
    train(data, part, config, fresh=epochs_in(hdri, part / "fresh"))
    ends = [checkpoint.load(checkpoint.checkpoint_path(run, 4))[1] for run in (whole, part)]
    for group, tensors in ends[0].items():
        for name, tensor in tensors.items():
            assert torch.equal(tensor, ends[1][group][name]), name
    other = FilmedEpochs(hdri, part / "fresh", replace(RECIPE, seed=1), HERE)
    with pytest.raises(ConfigError):  # another recipe is another run
        train(data, part, config, fresh=other)


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
