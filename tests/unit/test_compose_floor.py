"""Where objects may stand, and the horizon that a photo shows."""

import numpy as np
import pytest

from deeplight.camera import PinholeCamera
from deeplight.compose.floor import free_spots
from deeplight.compose.gravity import CameraPlacement, camera_tilt, viewpoint_of
from deeplight.compose.ground import Viewpoint
from deeplight.compose.horizon import tilt_of_photo
from deeplight.errors import ConfigError
from deeplight.io.tilt import Tilt

CAMERA = PinholeCamera(300, 400, float(np.radians(66)))


def posts(pitch_deg: float, roll_deg: float) -> np.ndarray:
    """A photo of upright posts all around a camera."""
    view = Viewpoint(CAMERA, 1.4, *np.radians([pitch_deg, roll_deg]))
    rows, columns = np.mgrid[:400, :300] + 0.5
    half_width, half_height = CAMERA.tangents
    x, y = (columns / 150 - 1) * half_width, (1 - rows / 200) * half_height
    rays = np.stack([x, y, -np.ones_like(x)], -1) @ view.world_from_camera.T
    azimuth = np.degrees(np.arctan2(rays[..., 0], -rays[..., 2]))
    noise = np.random.default_rng(0).normal(0, 4, (400, 300))
    level = 130 + 60 * np.tanh(4 * np.sin(np.radians(azimuth) * 20)) + noise
    return np.repeat(level[..., None], 3, 2).clip(0, 255).astype(np.uint8)


@pytest.mark.parametrize(("pitch", "roll"), [(-35, 0), (-12, 4), (0, -3), (15, 2)])
def test_upright_edges_say_how_the_camera_was_tilted(pitch, roll):
    found = tilt_of_photo(posts(pitch, roll), CAMERA)
    assert found is not None
    off = np.degrees([found.pitch_rad, found.roll_rad]) - [pitch, roll]
    assert np.abs(off).max() < 3


def test_grass_says_nothing_of_the_tilt():
    grass = np.random.default_rng(1).integers(60, 180, (400, 300, 3), dtype=np.uint8)
    assert tilt_of_photo(grass, CAMERA) is None


@pytest.mark.parametrize("pitch", [-40, -15, 0, 20])
def test_the_horizon_is_where_rays_are_level(pitch):
    view = Viewpoint(CAMERA, pitch_rad=float(np.radians(pitch)))
    assert view.ray(150, view.horizon_row)[1] == pytest.approx(0, abs=1e-9)


def furnished() -> np.ndarray:
    """A speckled floor with a striped thing on its left half."""
    speckle = np.random.default_rng(2).integers(-25, 26, (400, 300, 1))
    photo = np.full((400, 300, 3), (120, 90, 60)) + speckle
    photo[200:, :150] = np.where(np.arange(150)[:, None] // 15 % 2, 30, 230)
    return photo.clip(0, 255).astype(np.uint8)


def test_objects_stand_where_the_floor_is_free():
    view = Viewpoint(CAMERA, pitch_rad=float(np.radians(-20)))
    (spot,) = free_spots(furnished(), view, 1, 300.0)
    assert spot.free
    assert spot.x > 150 or spot.y < 190
    flipped = np.ascontiguousarray(furnished()[:, ::-1])
    (other,) = free_spots(flipped, view, 1, 300.0)
    assert 300 - other.x == pytest.approx(spot.x, abs=1)
    assert abs(other.y - spot.y) < 20


def test_where_nothing_is_free_that_is_known():
    view = Viewpoint(CAMERA, pitch_rad=float(np.radians(-20)))
    full = np.repeat(np.where(np.arange(300) // 20 % 2, 20, 220)[None, :, None], 400, 0)
    photo = np.repeat(full, 3, 2).astype(np.uint8)
    assert not any(spot.free for spot in free_spots(photo, view, 2, 300.0))
    black = np.zeros((400, 300, 3), np.uint8)
    assert not free_spots(black, view, 1, 300.0)[0].free


def test_a_photo_of_the_sky_has_no_floor():
    view = Viewpoint(CAMERA, pitch_rad=float(np.radians(60)))
    with pytest.raises(ConfigError, match="horizon at row"):
        free_spots(furnished(), view, 1, 300.0)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ((None, None), (-0.3, 0.1, 0.2)),
        ((-30.0, None), (np.radians(-30), 0.1, 0.0)),
        ((None, 5.0), (-0.3, np.radians(5), 0.2)),
        ((-30.0, 5.0), (np.radians(-30), np.radians(5), 0.0)),
    ],
)
def test_what_is_given_of_the_tilt_counts_before_what_is_guessed(given, expected):
    guess = Tilt(-0.3, 0.1, "a guess", 0.2)
    tilt = camera_tilt(None, CAMERA, CameraPlacement(1.4, *given), guess=guess)
    assert tilt is not None
    assert (tilt.pitch_rad, tilt.roll_rad, tilt.scale_rad) == pytest.approx(expected)


def test_without_any_tilt_one_is_assumed_and_said():
    assert camera_tilt(None, CAMERA, CameraPlacement()) is None
    viewpoint, notes = viewpoint_of(CAMERA, CameraPlacement(roll_deg=3), None)
    assert viewpoint.roll_rad == pytest.approx(np.radians(3))
    assert "unknown, assumed" in notes[0]
