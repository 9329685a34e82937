"""What orders errors, and what fits colours, in the experiments on confidence and white balance."""

import numpy as np
import pytest

pytest.importorskip("torch")

from lab.evidence.boosting import Boosted
from lab.evidence.surest_bound import from_mean, others
from lab.evidence.white_balance import angle, fitted, over_green, with_one


def made_up(count, seed):
    random = np.random.default_rng(seed)
    columns = random.normal(size=(count, 6))
    target = (columns[:, 1] > 0) + 2.0 * (columns[:, 4] > 0.5) + 0.1 * random.normal(size=count)
    return columns, target


def test_boosting_learns_what_columns_say_and_nothing_else():
    columns, target = made_up(400, 0)
    new, wanted = made_up(200, 1)
    target[::9] = np.nan  # unknown errors teach nothing
    assert np.corrcoef(Boosted.of(columns, target)(new), wanted)[0, 1] > 0.95
    mixed = np.random.default_rng(2).permutation(target)
    assert abs(np.corrcoef(Boosted.of(columns, mixed)(new), wanted)[0, 1]) < 0.4


def test_others_leave_the_frame_or_the_take_out():
    off = np.array([[1.0], [3.0], [10.0], [np.nan], [5.0]])
    takes, places = np.array(["a", "a", "b", "b", "c"]), np.array(["x", "x", "x", "x", "y"])
    np.testing.assert_allclose(others(off, takes, takes)[:, 0], [3, 1, np.nan, 10, np.nan])
    np.testing.assert_allclose(others(off, places, takes)[:, 0], [10, 10, 2, 2, np.nan])


def test_members_that_agree_have_no_angle_between_them():
    one = np.random.default_rng(0).normal(size=(7, 3))
    np.testing.assert_allclose(from_mean(np.stack([one, 2 * one, 5 * one])), 0, atol=1e-6)
    apart = np.stack([np.eye(3), np.roll(np.eye(3), 1, axis=1)])
    np.testing.assert_allclose(from_mean(apart), np.pi / 4)


def test_colours_are_fitted_alike_from_each_data_set():
    random = np.random.default_rng(0)
    gains, more = random.normal(0, 0.2, (50, 2)), random.normal(0, 0.2, (500, 2))
    slopes = np.array([[-0.2, 0.1], [0.05, -0.3], [0.01, 0.02]])
    light, other = with_one(gains) @ slopes, with_one(more) @ slopes
    np.testing.assert_allclose(fitted([(gains, light), (more, other)]), slopes, atol=1e-9)
    opposite = fitted([(gains, gains), (more, -more)])  # ten times as many views do not win
    np.testing.assert_allclose(opposite[:2], 0, atol=0.3)


def test_angles_of_colours():
    grey, colours = np.zeros((3, 2)), over_green(np.log([[2.0, 1, 1], [1, 1, 1], [1, 1, 3]]))
    assert angle(colours, colours) == pytest.approx(0, abs=1e-5)
    cosines = np.array([4 / np.sqrt(18), 1, 5 / np.sqrt(33)])
    assert angle(colours, grey) == pytest.approx(np.degrees(np.arccos(cosines)).mean(), abs=1e-4)
