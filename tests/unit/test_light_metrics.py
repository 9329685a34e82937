"""Errors against the true light: what they see, and what they do not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from deeplight.evaluate.light_metrics import brightest, light_errors, linear_errors, mean_radiance
from deeplight.frames import rotation
from deeplight.lighting import Lighting
from deeplight.mappings import mirror_ball
from deeplight.relight import relight_rig
from deeplight.sphere import PAPER_RIG, SPHERES


def lamp(towards: np.ndarray, strength: float = 20.0) -> np.ndarray:
    """An even dim room with one lamp."""
    directions = mirror_ball.pixel_directions(32)
    glow = np.exp(30 * (directions @ (towards / np.linalg.norm(towards)) - 1))[..., None]
    inside = (mirror_ball.coverage(32) > 0)[..., None]
    return ((0.2 + strength * glow * np.array([1.0, 0.9, 0.8])) * inside).astype(np.float32)


TRUE = np.stack([lamp(np.array([0.3, 0.8, 0.5])), lamp(np.array([-0.6, 0.5, 0.6]), 50.0)])


def test_the_true_light_has_no_error() -> None:
    errors = light_errors(TRUE, TRUE)
    assert errors["energy_stops"] == pytest.approx(np.zeros(2), abs=1e-9)
    assert errors["direction_deg"] == pytest.approx(np.zeros(2), abs=0.05)
    assert errors["intensity_stops"] == pytest.approx(np.zeros(2), abs=1e-9)


@settings(deadline=None, max_examples=10)
@given(st.floats(-4, 4))
def test_brightness_is_in_stops_and_moves_nothing(stops: float) -> None:
    errors = light_errors(TRUE * np.float32(2**stops), TRUE)
    assert errors["energy_stops"] == pytest.approx([stops] * 2, abs=1e-4)
    assert errors["intensity_stops"] == pytest.approx([stops] * 2, abs=1e-4)
    assert errors["direction_deg"] == pytest.approx([0, 0], abs=0.05)


@pytest.mark.parametrize("angle_deg", [10.0, 40.0, 90.0])
def test_direction_is_the_angle_the_light_was_turned_by(angle_deg: float) -> None:
    turn = rotation("z", np.radians(angle_deg))
    moved = np.stack([lamp(turn @ np.array([1.0, 0.0, 0.3]))])
    found = light_errors(moved, np.stack([lamp(np.array([1.0, 0.0, 0.3]))]))
    in_plane = np.degrees(np.arccos((np.cos(np.radians(angle_deg)) + 0.09) / 1.09))
    assert found["direction_deg"][0] == pytest.approx(in_plane, abs=1.5)


def test_even_or_broken_light_has_no_direction_and_is_not_perfect() -> None:
    even = np.full((1, 32, 32, 3), 0.5, np.float32)
    assert np.isnan(brightest(even).directions).all()
    errors = light_errors(np.concatenate([even, np.full_like(even, np.nan)]), TRUE)
    assert np.isnan(errors["direction_deg"]).all()
    assert np.isnan(errors["intensity_stops"]).all()
    assert np.isnan(errors["energy_stops"]).tolist() == [False, True]
    dark = light_errors(np.zeros_like(TRUE), TRUE)
    assert np.isnan(dark["energy_stops"]).all()


def test_mean_radiance_of_white_light_is_its_radiance() -> None:
    assert mean_radiance(np.full((2, 32, 32, 3), 0.7, np.float32)) == pytest.approx(
        [0.7] * 2, rel=1e-5
    )


def test_linear_errors_are_relative_and_see_what_the_camera_clips() -> None:
    views = PAPER_RIG.views
    masks = {name: views[name].mask() for name in SPHERES}

    def spheres(factor: float) -> dict[str, np.ndarray]:
        rendered = relight_rig(PAPER_RIG, Lighting(TRUE[0] * np.float32(factor)))
        return {name: radiance[None] for name, radiance in rendered.items()}

    same = linear_errors(spheres(1), spheres(1), masks)
    assert all(same[name] == 0 for name in SPHERES)
    double = linear_errors(spheres(2), spheres(1), masks)
    assert all(double[name] == pytest.approx([1], abs=1e-5) for name in SPHERES)
    black = linear_errors(
        spheres(1), {n: np.zeros((1, 32, 32, 3), np.float32) for n in SPHERES}, masks
    )
    assert all(np.isnan(black[name]).all() for name in SPHERES)
