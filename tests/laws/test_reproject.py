"""The ideal camera of section 3.1, cut out of a frame: places, areas and light are kept."""

import numpy as np
import pytest

from deeplight.camera import PinholeCamera
from deeplight.camera_response import encode
from deeplight.capture.reproject import Reprojection, background_of
from deeplight.frames import looking_at, turned
from deeplight.preprocess import background, frame_photo
from deeplight.sphere import PAPER_RIG, SphereView

CAMERA = PinholeCamera(360, 640, np.radians(66.0))
VIEW = PAPER_RIG.views["mirror"]


def crop(view: SphereView, frame: np.ndarray) -> np.ndarray:
    return Reprojection.of(view, CAMERA).crop(tuple(np.moveaxis(frame, -1, 0)))


def disc(view: SphereView) -> np.ndarray:
    """A frame that is white where the rays meet the sphere, with smooth edges, else black."""
    fine = PinholeCamera(3 * CAMERA.width, 3 * CAMERA.height, CAMERA.vertical_fov_rad)
    hit = fine.rays() @ -view.ball_from_camera[2] > np.cos(view.angular_radius_rad)
    share = hit.reshape(CAMERA.height, 3, CAMERA.width, 3).mean(axis=(1, 3))
    return np.repeat((encode(share) * 255).round().astype(np.uint8)[..., None], 3, axis=2)


def test_a_grey_frame_gives_a_grey_crop() -> None:
    for level in (0, 1, 100, 254, 255):
        frame = np.full((CAMERA.height, CAMERA.width, 3), level, np.uint8)
        assert np.all(crop(VIEW, frame) == level)


@pytest.mark.parametrize("yaw", [-18.0, 0.0, 15.0])
def test_the_frustum_is_tangent_and_pixels_are_area_averages(yaw: float) -> None:
    direction = np.array([np.sin(np.radians(yaw)), -0.45, -0.85])
    view = SphereView(looking_at(direction / np.linalg.norm(direction)), np.radians(3.8))
    got = crop(view, disc(view))[..., 0]
    off = np.abs(got / 255 - encode(view.alpha()))[view.alpha() > 0.02]
    assert off.mean() < 0.025  # the disc fills the crop, to all four edges
    assert np.all(got[view.mask()] > 245)
    moved = SphereView(looking_at(direction + [0.006, 0, 0]), view.angular_radius_rad)
    wrong = crop(moved, disc(view))[..., 0]
    assert np.abs(wrong / 255 - encode(view.alpha()))[view.alpha() > 0.02].mean() > 0.04


def test_the_mean_is_taken_in_linear_light() -> None:
    frame = np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8)
    frame[:, ::2] = 255  # half the light
    mean = crop(VIEW, frame)[VIEW.mask()].mean() / 255
    assert mean == pytest.approx(0.5 ** (1 / 2.2), abs=0.03)


@pytest.mark.parametrize("fov_deg", [66.0, 58.0, 75.0])
@pytest.mark.parametrize("turns", [0, 1, 2, 3])
def test_the_background_is_that_of_preprocess(fov_deg: float, turns: int) -> None:
    """Lying or standing in memory, whole pixels or not, lost whites and blacks and all."""
    noise = np.random.default_rng(3).normal(128, 150, (CAMERA.height, CAMERA.width, 3))
    frame = noise.clip(0, 255).astype(np.uint8)
    framing = frame_photo(CAMERA.height, CAMERA.width, np.radians(fov_deg))
    planes = [np.ascontiguousarray(np.rot90(frame[..., i], turns)) for i in range(3)]
    got = background_of([np.rot90(plane, -turns) for plane in planes], framing)
    wanted = background(frame, framing)
    off = np.abs(got.astype(int) - wanted)
    assert off.max() <= 1  # a mean in the middle of two levels
    assert off.mean() < 0.02
    shifted = background_of(list(np.moveaxis(np.roll(frame, 2, axis=1), -1, 0)), framing)
    assert np.abs(shifted.astype(int) - wanted).mean() > 5


def test_up_in_the_crop_is_up_in_the_frame() -> None:
    centre = turned(np.array([[0.0, 0.0, -1.0]]), VIEW.ball_from_camera.T)
    row, column = (float(a[0]) for a in CAMERA.pixel_of_directions(centre))
    frame = np.zeros((CAMERA.height, CAMERA.width, 3), np.uint8)
    frame[: round(row), :, 0] = 200
    frame[:, : round(column), 1] = 200
    got = crop(VIEW, frame)
    assert got[:8, :, 0].min() > 150 > 50 > got[-8:, :, 0].max()
    assert got[:, :8, 1].min() > 150 > 50 > got[:, -8:, 1].max()


def test_a_sphere_partly_outside_sees_the_frames_edge() -> None:
    view = SphereView(looking_at(np.array([0.37, -0.5, -1.0])), np.radians(4.0))
    frame = np.full((CAMERA.height, CAMERA.width, 3), 77, np.uint8)
    assert np.all(crop(view, frame) == 77)
