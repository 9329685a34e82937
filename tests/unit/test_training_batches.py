"""Laws of the order of examples: a pure function of seed and position."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from deeplight.errors import ConfigError
from deeplight.frames import world_from_camera
from deeplight.training.data import (
    POSE,
    Batch,
    BatchSource,
    Order,
    PairOrder,
    StepIndices,
    take,
)
from deeplight.training.fresh import refuse_for_pairs
from deeplight.training.share import ALONE, Share


@pytest.mark.parametrize("count", [7, 32, 100])
def test_every_epoch_shows_every_example_once(count):
    order = Order(count, seed=3)
    stream = np.concatenate([order.batch(step, 8) for step in range(3 * count)])
    for epoch in range(8 * 3 * count // count):
        shown = stream[epoch * count : (epoch + 1) * count]
        assert sorted(shown) == list(range(count))


def test_a_step_does_not_depend_on_the_steps_before_it():
    from_start = [Order(50, seed=1).batch(step, 8).tolist() for step in range(40)]
    resumed = list(StepIndices(Order(50, seed=1), 8, 13, 40))
    assert resumed == from_start[13:]
    assert list(StepIndices(Order(50, seed=2), 8, 13, 40)) != resumed


def test_epochs_differ():
    order = Order(50, seed=1)
    assert order.epoch(0).tolist() != order.epoch(1).tolist()


def test_places_are_drawn_equally_often():
    places = np.array(["a"] * 80 + ["b"] * 15 + ["c"] * 5)
    order = Order(100, seed=0, places=places)
    for epoch in range(3):
        drawn = order.epoch(epoch)
        counts = [np.sum(places[drawn] == place) for place in "abc"]
        assert len(drawn) == 100
        assert max(counts) - min(counts) <= 1
        # Within a place all examples come before one comes again.
        of_c = np.bincount(drawn[drawn >= 95] - 95, minlength=5)
        assert of_c.max() - of_c.min() <= 1


def test_one_example_is_enough_for_a_batch():
    assert Order(1, seed=0).batch(5, 4).tolist() == [0, 0, 0, 0]


TAKES = np.array(["a"] * 3 + ["b"] + ["c"] * 2)


def test_a_batch_of_pairs_has_frames_that_follow_each_other():
    order = PairOrder(TAKES, seed=0)
    seen = set()
    for step in range(9):
        first, second = np.split(order.batch(step, 4), 2)
        seen |= set(zip(first.tolist(), second.tolist(), strict=True))
    assert seen == {(0, 1), (1, 2), (4, 5)}
    alike = PairOrder(np.array(["a"] * 6), seed=0)  # the twin: one take of all
    assert any((alike.batch(step, 4)[:2] == 3).any() for step in range(9))


@pytest.mark.parametrize("said", [True, False])
def test_turns_bring_the_first_frames_directions_to_the_second_ones(said):
    poses = [world_from_camera(0.3 * n, 0.1 * n) for n in range(3)]
    source = BatchSource.__new__(BatchSource)  # its pictures are not needed
    details = lambda n: {POSE: poses[n].tolist()} if said else {}  # noqa: E731
    source.examples = SimpleNamespace(index=SimpleNamespace(details=details))
    source.order, source.device = PairOrder(np.array(["a"] * 3), seed=0), torch.device("cpu")
    if not said:
        with pytest.raises(ConfigError, match="how the camera was held"):
            source.turns(4, 0)
        return
    (first, _), (second, _) = np.split(source.order.batch(0, 4), 2)
    towards = np.array([0.0, 0.6, 0.8])
    in_second = source.turns(4, 0)[0].numpy() @ (poses[first].T @ towards)
    np.testing.assert_allclose(in_second, poses[second].T @ towards, atol=1e-6)
    assert not np.allclose(in_second, poses[first].T @ towards, atol=0.05)


def test_takes_of_single_frames_have_no_pairs():
    with pytest.raises(ConfigError, match="follow each other"):
        PairOrder(np.array(["a", "b", "c"]), seed=0)


def test_pairs_are_refused_where_a_batch_cannot_hold_them():
    for size, share, expected in ((3, ALONE, "even"), (4, Share(0, 2), "one device")):
        with pytest.raises(ConfigError, match=expected):
            refuse_for_pairs(size, share)
    refuse_for_pairs(4, ALONE)


def test_take_gives_the_rows_asked_for():
    table = Batch(torch.arange(4), torch.arange(4) * 10, torch.arange(4) * 100)
    photo, spheres, rig = take(table, np.array([2, 0]))
    assert (photo.tolist(), spheres.tolist(), rig.tolist()) == ([2, 0], [20, 0], [200, 0])
