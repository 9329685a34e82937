"""A lamp drawn on the mirror ball keeps its flux and its place, however small it is."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from deeplight.frames import normalised
from deeplight.lamp import Lamp
from deeplight.lobe import angular_radius_of, concentration_of, lobe_on_ball
from deeplight.mappings import mirror_ball

FLUX = np.array([3.0, 2.0, 0.5])
DIRECTIONS = [[0, 0, -1], [0, 1, 0], [0, 0, 1], [0.3, 0.8, 0.5], [-0.7, 0.1, -0.7]]


def lamp(direction: list[float], radius: float) -> Lamp:
    return Lamp(normalised(np.array(direction, float)), FLUX, radius)


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("radius", [0.005, 0.16, 0.5])
@pytest.mark.parametrize("size", [16, 32])
def test_the_ball_holds_the_lamps_flux(direction: list[float], radius: float, size: int) -> None:
    drawn = lobe_on_ball(lamp(direction, radius), size)
    power = np.einsum("ij,ijc->c", mirror_ball.solid_angles(size), drawn)
    assert power == pytest.approx(FLUX, rel=1e-5)


@settings(max_examples=20, deadline=None)
@given(st.floats(-1, 1), st.floats(-1, 1), st.floats(-0.8, 1))
def test_it_shines_from_where_it_is(x: float, y: float, z: float) -> None:
    towards = [x, y, z if abs(x) + abs(y) + abs(z) > 0.1 else 1.0]
    one = lamp(towards, 0.16)
    drawn = lobe_on_ball(one, 64)[..., 0] * mirror_ball.solid_angles(64)
    mean = np.einsum("ij,ijc->c", drawn, mirror_ball.pixel_directions(64)) / FLUX[0]
    assert normalised(mean) @ one.direction > np.cos(0.05)
    # The mean of 1 - cos angle is what a disc and its lobe have in common.
    assert 1 - mean @ one.direction == pytest.approx(np.sin(0.16 / 2) ** 2, abs=4e-3)


def test_radius_and_concentration_are_inverses() -> None:
    for radius in (0.005, 0.16, 0.5, 1.2):
        assert angular_radius_of(concentration_of(radius)) == pytest.approx(radius)
    assert np.degrees(angular_radius_of(150)) == pytest.approx(9.4, abs=0.1)
