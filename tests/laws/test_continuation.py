"""The photo going on all around: level, without a seam, and with the power that was there."""

import numpy as np
import pytest

from deeplight.camera import PinholeCamera
from deeplight.estimators.continuation import continued, up_of
from deeplight.estimators.projection import ImagePlane, ProjectedPhoto, project_photo
from deeplight.estimators.surroundings import power_of
from deeplight.frames import MIRROR_X, turned, world_from_camera
from deeplight.io.tilt import Tilt
from deeplight.mappings import latlong

HEIGHT = 64
CAMERA = PinholeCamera(120, 200, float(np.radians(66)))
DIRECTIONS = latlong.directions(HEIGHT, 2 * HEIGHT)
UPRIGHT = {"pitch_rad": -0.3} | {f"upright_{turn}": float(turn == 0) for turn in (0, 90, 180, 270)}


def pose(pitch_deg: float, roll_deg: float = 0.0) -> np.ndarray:
    return world_from_camera(0.0, np.radians(pitch_deg), np.radians(roll_deg))


def projected(pixels: np.ndarray) -> ProjectedPhoto:
    return project_photo(pixels, ImagePlane.centred(200, 120, CAMERA.vertical_fov_rad), HEIGHT)


def landscape(world_from_camera: np.ndarray) -> ProjectedPhoto:
    """Bright above the horizon, dark below it, with stripes that stand upright."""
    rays = turned(CAMERA.rays(), world_from_camera)
    stripes = 25 * np.sin(20 * np.arctan2(rays[..., 0], -rays[..., 2]))
    level = np.where(rays[..., 1] > 0, 180, 60) + stripes
    return projected(np.repeat(level[..., None], 3, -1).astype(np.uint8))


def even(value: float = 0.2) -> np.ndarray:
    return np.full((HEIGHT, 2 * HEIGHT, 3), value, np.float32)


def contrast_at_the_horizon(found: np.ndarray, up: np.ndarray) -> float:
    """How much brighter it is just above the horizon than just below it, behind the camera."""
    elevation = np.degrees(np.arcsin((DIRECTIONS @ up).clip(-1, 1)))
    behind = DIRECTIONS[..., 2] > 0.5
    above, below = (found[behind & (np.abs(elevation - e) < 3)].mean() for e in (5, -5))
    return float(above / below)


@pytest.mark.parametrize("held", [(0, 0), (-18, 0), (12, 0), (-15, 12)])
def test_the_horizon_goes_on_behind_the_camera(held):
    up = pose(*held)[1]
    photo = landscape(pose(*held))
    assert contrast_at_the_horizon(continued(even(), photo, up), up) > 2
    wrong = pose(held[0] + 20)[1]
    assert contrast_at_the_horizon(continued(even(), photo, wrong), up) < 1.5


def test_power_stays_and_so_does_what_the_photo_shows():
    rng = np.random.default_rng(3)
    surroundings = rng.uniform(0.05, 2, (HEIGHT, 2 * HEIGHT, 3)).astype(np.float32)
    photo = landscape(pose(-15))
    found = continued(surroundings, photo, pose(-15)[1])
    shown = photo.seen == 1
    np.testing.assert_allclose(found[shown], surroundings[shown], rtol=1e-5)
    np.testing.assert_allclose(power_of(found), power_of(surroundings), rtol=1e-4)
    assert np.abs(np.log(found[~shown] / surroundings[~shown])).mean() > 0.1


def test_the_flipped_photo_goes_on_flipped():
    up, photo = pose(-10, 8)[1], landscape(pose(-10, 8))
    found = continued(even(), photo, up)
    flipped = ProjectedPhoto(
        *(part[:, ::-1] for part in (photo.radiance, photo.seen, photo.clipped, photo.pixels))
    )
    again = continued(even(), flipped, MIRROR_X @ up)[:, ::-1]
    # A texel's width decides which column a row begins with.
    assert np.abs(np.log(again / found)).mean() < 0.01
    assert np.abs(np.log(continued(even(), photo, MIRROR_X @ up) / found)).mean() > 0.03


def test_an_even_photo_in_its_own_light_changes_nothing():
    photo = projected(np.full((200, 120, 3), 128, np.uint8))
    light = even(float(photo.radiance.max()))
    np.testing.assert_allclose(continued(light, photo, pose(-12)[1]), light, rtol=1e-4)


def test_next_to_the_photo_stands_its_mirror_image():
    photo = landscape(pose(0))
    found = np.log(continued(even(), photo, pose(0)[1])[..., 1])
    shown = np.log(np.maximum(photo.radiance[..., 1], 1e-3))
    row = HEIGHT // 2 - 4
    right = np.flatnonzero(photo.seen[row] > 0.98)[-1]
    beyond, within = found[row, right + 3 : right + 9], shown[row, right - 2 : right - 8 : -1]
    assert np.corrcoef(beyond, within)[0, 1] > 0.97
    assert np.corrcoef(beyond, within[::-1])[0, 1] < 0.5  # the twin: not mirrored


@pytest.mark.parametrize(("steep", "less_steep"), [(-88, -76), (85, 76)])
def test_where_nothing_is_ahead_nothing_goes_on(steep, less_steep):
    changes = [
        np.abs(continued(even(), landscape(pose(pitch)), pose(pitch)[1]) - even()).max()
        for pitch in (steep, less_steep)
    ]
    assert changes[0] == 0
    assert changes[1] > 0.02


def test_a_sliver_of_a_photo_says_nothing_of_the_rest():
    narrow = project_photo(
        np.full((200, 40, 3), 200, np.uint8), ImagePlane(-0.05, 0.05, -0.3, 0.3), HEIGHT
    )
    np.testing.assert_array_equal(continued(even(), narrow, pose(0)[1]), even())


def test_up_is_by_the_known_tilt_else_by_the_networks_guess():
    assert up_of(None, {}) is None
    np.testing.assert_allclose(up_of(None, UPRIGHT), world_from_camera(0, -0.3)[1])
    tilt = Tilt(0.1, 0.2, "EXIF")
    np.testing.assert_allclose(up_of(tilt, UPRIGHT), world_from_camera(0, 0.1, 0.2)[1])
    lying = UPRIGHT | {"upright_0": 0.1, "upright_90": 0.9}
    assert up_of(None, lying) is None
