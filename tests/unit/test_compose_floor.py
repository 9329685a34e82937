"""Where objects may stand, and the horizon that a photo shows."""

import numpy as np
import pytest

from deeplight.camera import PinholeCamera
from deeplight.compose.compose import Item, placed
from deeplight.compose.floor import free_spots
from deeplight.compose.gravity import CameraPlacement, viewpoint_of
from deeplight.compose.ground import Viewpoint
from deeplight.errors import ConfigError
from deeplight.io.tilt import Tilt

CAMERA = PinholeCamera(300, 400, float(np.radians(66)))


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


def test_without_any_tilt_one_is_assumed_and_said():
    viewpoint, notes = viewpoint_of(CAMERA, CameraPlacement(roll_deg=3), None)
    assert viewpoint.roll_rad == pytest.approx(np.radians(3))
    assert "unknown, assumed" in notes[0]


def doubtful(pitch_deg: float, doubt_deg: float) -> Viewpoint:
    pitch, doubt = np.radians([pitch_deg, doubt_deg]).tolist()
    return Viewpoint(CAMERA, pitch_rad=pitch, doubt_rad=doubt)


def test_floor_is_only_what_lies_below_the_horizon_for_all_that_is_known():
    (known,) = free_spots(furnished(), doubtful(-20, 0), 1, 300.0)
    (likely,) = free_spots(furnished(), doubtful(-20, 20), 1, 300.0)
    (unsure,) = free_spots(furnished(), doubtful(-20, 50), 1, 300.0)
    assert known.free
    assert likely.free
    assert not unsure.free
    assert not doubtful(-20, 20).may_be_above(likely.x, likely.y)


@pytest.mark.parametrize("at", [None, (150.0, 300.0)])
@pytest.mark.parametrize(("doubt_deg", "warned"), [(0, False), (8, False), (50, True)])
def test_an_unsure_pitch_is_warned_of(at, doubt_deg, warned):
    _, notes = placed(doubtful(-20, doubt_deg), [Item(at=at)], photo=furnished())
    assert any("pitch is unsure" in note for note in notes) is warned


def test_of_a_pitch_that_is_only_assumed_no_floor_is_sure():
    view, _ = viewpoint_of(CAMERA, CameraPlacement(), None)
    assert not free_spots(furnished(), view, 1, 300.0)[0].free
    guessed = Tilt(-0.3, 0.2, "a guess", 0.2)
    view, (note,) = viewpoint_of(CAMERA, CameraPlacement(), guessed)
    assert view.doubt_rad == guessed.scale_rad
    assert note == "camera pitch from a guess: -17 degrees, rolled by 11"


@pytest.mark.parametrize(("size_m", "warned"), [(0.5, False), (30.0, True)])
def test_an_object_around_the_camera_is_warned_of(size_m, warned):
    _, notes = placed(doubtful(-20, 0), [Item("sphere", at=(150.0, 300.0), size_m=size_m)])
    assert any("camera may be inside" in note for note in notes) is warned
