"""A lamp keeps its power wherever it is drawn, and turns with the frame."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from deeplight import frames
from deeplight.errors import ShapeError
from deeplight.frames import normalised
from deeplight.lamp import SUN_ANGULAR_RADIUS_RAD, Lamp, draw_lamps
from deeplight.mappings import latlong

DIRECTIONS = [[0, 0, -1], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0.3, 0.8, 0.5], [-0.7, 0.1, 0.01]]
FLUX = np.array([3.0, 2.0, 0.5])


def flux_of(radiance: np.ndarray) -> np.ndarray:
    return np.einsum("ij,ijc->c", latlong.solid_angles(*radiance.shape[:2]), radiance)


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("radius", [SUN_ANGULAR_RADIUS_RAD, 0.03, 0.2, 1.2])
@pytest.mark.parametrize("height", [16, 128])
def test_drawn_power_is_the_lamps(direction: list[float], radius: float, height: int) -> None:
    lamp = Lamp(normalised(np.array(direction, float)), FLUX, radius)
    drawn = draw_lamps([lamp], height)
    assert flux_of(drawn) == pytest.approx(FLUX, rel=1e-5)
    weights = latlong.solid_angles(*drawn.shape[:2]) * drawn[..., 0]
    middle = np.einsum("ij,ijc->c", weights, latlong.directions(*drawn.shape[:2]))
    off = np.arccos(np.clip(normalised(middle) @ lamp.direction, -1, 1))
    assert off < 0.8 * np.pi / height


def test_a_discs_radiance_and_edge() -> None:
    lamp = Lamp(np.array([0.0, 0.0, -1.0]), FLUX, 0.2)
    drawn = draw_lamps([lamp], 256)
    away = np.arccos(np.clip(latlong.directions(256, 512) @ lamp.direction, -1, 1))
    assert drawn[away < 0.18] == pytest.approx(
        np.tile(lamp.radiance, ((away < 0.18).sum(), 1)), 0.01
    )
    assert not drawn[away > 0.22].any()


def test_irradiance_is_the_cosine_weighted_integral() -> None:
    lamp = Lamp(np.array([0.0, 1.0, 0.0]), FLUX, 0.4)
    up = np.maximum(latlong.directions(256, 512)[..., 1:2], 0)
    assert flux_of(draw_lamps([lamp], 256) * up) == pytest.approx(lamp.irradiance, rel=2e-3)


@settings(max_examples=20, deadline=None)
@given(st.floats(-3, 3), st.floats(-1.5, 1.5))
def test_turning_goes_with_the_frame(yaw: float, pitch: float) -> None:
    lamp = Lamp(normalised(np.array([0.3, 0.8, 0.5])), FLUX, 0.1)
    turn = frames.world_from_camera(yaw, pitch)
    assert lamp.turned(turn).direction == pytest.approx(turn @ lamp.direction)
    assert lamp.turned(turn).turned(turn.T).direction == pytest.approx(lamp.direction)


@pytest.mark.parametrize(
    ("direction", "flux", "radius"),
    [([0, 0, -2], FLUX, 0.1), ([0, 0, -1], -FLUX, 0.1), ([0, 0, -1], FLUX, 0.0)],
)
def test_impossible_lamps_are_refused(
    direction: list[int], flux: np.ndarray, radius: float
) -> None:
    with pytest.raises(ShapeError):
        Lamp(np.array(direction, float), flux, radius)
