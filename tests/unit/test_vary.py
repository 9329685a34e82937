"""Varied copies of a place: what each change keeps and what it moves."""

import numpy as np
import pytest

from deeplight.mappings import latlong
from deeplight.simulate.vary import one_sided, relit, stepped, varied

HEIGHT = 64
DIRECTIONS = latlong.directions(HEIGHT, 2 * HEIGHT)
TOWARDS = np.array([0.6, 0.0, -0.8])


def lamp(width: float = 40.0) -> np.ndarray:
    """Grey walls with one soft lamp at `TOWARDS`, 100 times as bright."""
    glow = 100 * np.exp(width * (DIRECTIONS @ TOWARDS - 1))
    return (1 + glow)[..., None] * np.array([1.0, 0.9, 0.8], np.float32)


def power(panorama: np.ndarray) -> float:
    return float((panorama[..., 1] * latlong.solid_angles(HEIGHT, 2 * HEIGHT)).sum())


def test_no_step_no_gain_and_no_side_change_nothing() -> None:
    room = lamp().astype(np.float32)
    np.testing.assert_allclose(stepped(room, np.zeros(3)), room, rtol=2e-3)
    np.testing.assert_allclose(relit(room, np.ones(3)), room, rtol=1e-6)
    np.testing.assert_allclose(one_sided(room, np.zeros(3)), room, rtol=1e-6)


@pytest.mark.parametrize("sign", [1, -1])
def test_what_is_stepped_towards_grows(sign: int) -> None:
    room = lamp()
    there = stepped(room, sign * 0.4 * TOWARDS)
    assert sign * (power(there) - power(room)) > 0.1 * power(room)
    brightest = DIRECTIONS.reshape(-1, 3)[there[..., 0].argmax()]
    assert brightest @ TOWARDS > 0.99  # what is stepped along stays where it is


def test_a_step_aside_moves_a_lamp_the_other_way() -> None:
    aside = np.cross(TOWARDS, [0, 1, 0])
    there = stepped(lamp(), 0.3 * aside)
    assert DIRECTIONS.reshape(-1, 3)[there[..., 0].argmax()] @ aside < -0.2


def test_only_lights_are_relit() -> None:
    room = lamp()
    brighter = relit(room, np.array([2.0, 3.0, 4.0])) / room
    light = room[..., 1] > 30
    np.testing.assert_allclose(brighter[light], np.tile([2, 3, 4], (light.sum(), 1)), rtol=1e-5)
    np.testing.assert_allclose(brighter[room[..., 1] < 2], 1, rtol=1e-5)


def test_one_side_is_brighter() -> None:
    factor = one_sided(np.ones((HEIGHT, 2 * HEIGHT, 3)), 0.7 * TOWARDS)[..., 0]
    assert factor.max() == pytest.approx(np.exp(0.7), rel=0.01)
    np.testing.assert_allclose(np.log(factor), 0.7 * DIRECTIONS @ TOWARDS, atol=1e-6)


def test_a_seed_decides_the_copy() -> None:
    first, again, other = (varied(lamp(), np.random.default_rng(n)) for n in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert abs(np.log(first / other)).mean() > 0.05
