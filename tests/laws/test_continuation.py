"""The photo going on all around: level, without a seam, and with the power that was there."""

import numpy as np
import pytest

from deeplight.camera import PinholeCamera
from deeplight.estimators.continuation import continued
from deeplight.estimators.environment import assemble
from deeplight.estimators.projection import ImagePlane, ProjectedPhoto, project_photo
from deeplight.estimators.surroundings import power_of
from deeplight.estimators.upright import guessed_tilt
from deeplight.frames import turned, world_from_camera
from deeplight.io.tilt import Tilt
from deeplight.lighting import Lighting
from deeplight.mappings import latlong

HEIGHT = 64
CAMERA = PinholeCamera(120, 200, float(np.radians(66)))
DIRECTIONS = latlong.directions(HEIGHT, 2 * HEIGHT)
UPRIGHT = {f"upright_{turn}": float(turn == 0) for turn in (0, 90, 180, 270)}


def pose(pitch_deg: float, roll_deg: float = 0.0) -> np.ndarray:
    return world_from_camera(0.0, np.radians(pitch_deg), np.radians(roll_deg))


def held(pitch_deg: float, roll_deg: float = 0.0, scale_deg: float = 0.0) -> Tilt:
    return Tilt(*np.radians([pitch_deg, roll_deg]), "a test", float(np.radians(scale_deg)))


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


@pytest.mark.parametrize("angles", [(0, 0), (-18, 0), (12, 0), (-15, 12)])
def test_the_horizon_goes_on_behind_the_camera(angles):
    up, photo = pose(*angles)[1], landscape(pose(*angles))
    assert contrast_at_the_horizon(continued(even(), photo, held(*angles)), up) > 2
    wrong = held(angles[0] + 20)
    assert contrast_at_the_horizon(continued(even(), photo, wrong), up) < 1.5


def test_the_less_the_pitch_is_known_the_less_goes_on():
    up, photo = pose(-12)[1], landscape(pose(-12))
    found = [
        contrast_at_the_horizon(continued(even(), photo, held(-12, scale_deg=scale)), up)
        for scale in (0, 8, 16, 40)
    ]
    assert found == sorted(found, reverse=True)
    assert found[0] > 2
    assert found[-1] < 1.05


def test_behind_the_camera_rows_are_blurred():
    """A thin bright row in the photo is no stripe all around."""
    pixels = np.full((200, 120, 3), 90, np.uint8)
    pixels[96:100] = 230
    row = np.log(continued(even(), projected(pixels), held(0))[..., 1])
    front, back = (np.abs(np.diff(row[:, column])).max() for column in (HEIGHT, 0))
    assert back < 0.6 * front


def test_of_a_pitch_that_nobody_knows_a_hint_goes_on():
    """The bright upper half stays a little brighter, without a line where the horizon may be."""
    photo = landscape(pose(0))
    found = np.log(continued(even(), photo, held(0, scale_deg=30))[:, 0, 1])
    assert found[: HEIGHT // 2].mean() - found[HEIGHT // 2 :].mean() > 0.05
    assert np.abs(np.diff(found)).max() < 0.05


def test_the_power_of_what_the_photo_does_not_show_stays():
    rng = np.random.default_rng(3)
    surroundings = rng.uniform(0.05, 2, (HEIGHT, 2 * HEIGHT, 3)).astype(np.float32)
    photo = landscape(pose(-15))
    found = continued(surroundings, photo, held(-15))
    unseen = 1 - photo.seen_in_64_rows[..., None]
    np.testing.assert_allclose(power_of(found * unseen), power_of(surroundings * unseen), rtol=1e-4)
    assert np.abs(np.log(found / surroundings)).mean() > 0.1


def test_next_to_the_photo_the_light_is_that_of_its_edge():
    """Fitted twice, by the continuation and again at the edge, it would have a halo."""
    bright = Lighting(np.full((32, 32, 3), 2.0, np.float32))
    pixels = np.full((200, 120, 3), 100, np.uint8)
    plane = ImagePlane.centred(200, 120, CAMERA.vertical_fov_rad)
    scene = assemble(bright, pixels, plane, 128, tilt=held(0))
    row, grey = 64, scene.rest[64, 128, 1]
    beyond = np.flatnonzero(scene.seen[row] > 0)[-1] + 1
    near = np.log(scene.rest[row, beyond : beyond + 5, 1] / grey)
    assert near[0] < 0.1
    assert near.min() > -0.02  # no darker ring before the bright light
    assert scene.rest[row, 0, 1] > 2 * grey


def test_the_flipped_photo_goes_on_flipped():
    photo = landscape(pose(-10, 8))
    found = continued(even(), photo, held(-10, 8))
    flipped = ProjectedPhoto(
        *(part[:, ::-1] for part in (photo.radiance, photo.seen, photo.clipped, photo.pixels))
    )
    again = continued(even(), flipped, held(-10, -8))[:, ::-1]
    np.testing.assert_allclose(again, found, rtol=1e-3)
    unlike = continued(even(), photo, held(-10, -8))
    assert np.abs(np.log(unlike / found)).mean() > 0.03


def test_an_even_photo_in_its_own_light_changes_nothing():
    photo = projected(np.full((200, 120, 3), 128, np.uint8))
    light = even(float(photo.radiance.max()))
    np.testing.assert_allclose(continued(light, photo, held(-12)), light, rtol=1e-4)


def test_things_do_not_come_again():
    """Of upright stripes only their mean goes on: level rows of the result are smooth."""
    photo, row = landscape(pose(0)), HEIGHT // 2 - 4
    found = np.log(continued(even(), photo, held(0))[row, :, 1])
    beyond = photo.seen_in_64_rows[row, :HEIGHT] == 0
    shown = np.log(photo.radiance[row, photo.seen[row] > 0.98, 1])
    assert np.abs(np.diff(found[:HEIGHT][beyond])).max() < 0.03 < np.abs(np.diff(shown)).max()
    assert np.ptp(found[:HEIGHT][beyond]) > 0.1  # the mean does go on


def test_what_the_estimate_knows_of_left_and_right_stays():
    """Level rows are moved as a whole; a photo without structure leaves their differences."""
    light = even() * (1.5 + DIRECTIONS[..., :1])
    photo = projected(np.full((200, 120, 3), 128, np.uint8))
    found = continued(light, photo, held(0))
    behind = slice(0, 20), slice(-20, None)
    left, right = (found[HEIGHT // 2, side, 1].mean() for side in behind)
    was = (light[HEIGHT // 2, side, 1].mean() for side in behind)
    assert left / right == pytest.approx(next(was) / next(was), rel=0.02)


def test_a_clipped_sky_does_not_darken_a_brighter_estimate():
    pixels = np.full((200, 120, 3), 60, np.uint8)
    pixels[:90] = 255
    found = continued(even(3.0), projected(pixels), held(0))
    pixels[:90] = 200
    darker = continued(even(3.0), projected(pixels), held(0))
    above = (DIRECTIONS[..., 1] > 0.2) & (DIRECTIONS[..., 2] > 0)
    below = (DIRECTIONS[..., 1] < -0.2) & (DIRECTIONS[..., 2] > 0)
    contrasts = [float(light[above].mean() / light[below].mean()) for light in (found, darker)]
    assert contrasts[0] > 1.2 * contrasts[1]


@pytest.mark.parametrize("pitch_deg", [-88, 85])
def test_where_nothing_is_ahead_nothing_goes_on(pitch_deg):
    np.testing.assert_array_equal(continued(even(), landscape(pose(0)), held(pitch_deg)), even())


def test_a_sliver_of_a_photo_says_nothing_of_the_rest():
    narrow = project_photo(
        np.full((200, 40, 3), 200, np.uint8), ImagePlane(-0.05, 0.05, -0.3, 0.3), HEIGHT
    )
    np.testing.assert_array_equal(continued(even(), narrow, held(0)), even())


def test_the_network_guesses_the_pitch_of_what_it_takes_for_upright():
    heads = UPRIGHT | {"pitch_rad": -0.3, "pitch_scale": 0.1}
    guess = guessed_tilt(heads)
    assert guess is not None
    np.testing.assert_allclose(guess.up, world_from_camera(0, -0.3)[1])
    assert guess.scale_rad == 0.1
    assert guessed_tilt({}) is None
    assert guessed_tilt(heads | {"upright_0": 0.1, "upright_90": 0.9}) is None
