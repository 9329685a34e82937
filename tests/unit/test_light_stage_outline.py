"""Finding the sphere: sub-pixel, elliptic off the axis, robust; reported when there is none."""

import numpy as np
import pytest

from deeplight.camera import PinholeCamera
from deeplight.errors import ImageFileError
from deeplight.frames import looking_at
from deeplight.light_stage.outline import find_sphere, sphere_at
from deeplight.sphere import SphereView
from lab.light_stage.photograph import Scene, in_white_light, points_of


def lit(camera: PinholeCamera, towards: tuple[float, float, float], angular_deg: float):
    """A sphere in white light, and its view."""
    view = SphereView(looking_at(np.array(towards, float)), np.radians(angular_deg))
    scene = Scene(camera, view, 0.04, 1.2, 0.01, 5)
    return in_white_light(scene, points_of(scene), 0.5), view


@pytest.mark.parametrize(
    ("towards", "angular_deg"),
    [((0, 0, -1), 12), ((0.03, -0.05, -1), 8.3), ((0.35, 0.3, -1), 9), ((-0.5, 0.1, -1), 7.1)],
)
def test_a_sphere_is_found_within_a_tenth_of_a_pixel(towards, angular_deg) -> None:
    camera = PinholeCamera(160, 140, np.radians(70))
    picture, view = lit(camera, towards, angular_deg)
    noise = np.random.default_rng(0).normal(0, 0.005, picture.shape)
    found = find_sphere(picture + 0.02 + noise, camera)
    got, want = (
        np.array(camera.pixel_of_directions(-v.ball_from_camera[2:])) for v in (found.view, view)
    )
    np.testing.assert_allclose(got, want, atol=0.1)
    px_per_rad = 70 / np.tan(np.radians(35))
    off = abs(found.view.angular_radius_rad - view.angular_radius_rad) * px_per_rad
    assert off < 0.1
    assert found.rms_px < 0.2


def test_off_the_axis_the_outline_is_the_ellipse_of_the_perspective() -> None:
    """1 / cos of the angle off the axis: 1.15 at 30 degrees."""
    camera = PinholeCamera(200, 200, np.radians(90))
    picture, _ = lit(camera, (np.tan(np.radians(30)), 0, -1), 8)
    major, minor = find_sphere(picture, camera).axes_px
    assert major / minor == pytest.approx(1 / np.cos(np.radians(30)), rel=0.02)


def test_a_stand_and_a_dark_side_do_not_move_it() -> None:
    camera = PinholeCamera(120, 120, np.radians(40))
    picture, view = lit(camera, (0.02, 0.01, -1), 12)
    picture[90:, 55:62] = 0.4  # the stand below it
    picture[:, :42] *= 0.02  # no light reaches its left
    found = find_sphere(picture, camera)
    off = np.arccos(np.clip(found.view.ball_from_camera[2] @ view.ball_from_camera[2], -1, 1))
    assert np.degrees(off) < 0.2  # 0.6 px
    assert found.edge_share < 0.95


def test_a_given_circle_is_taken_as_it_is() -> None:
    camera = PinholeCamera(100, 100, np.radians(5))
    outline = sphere_at(48.0, 52.5, 30.0, camera)
    assert outline.centre_px == pytest.approx((48.0, 52.5), abs=0.01)
    assert outline.axes_px == pytest.approx((30.0, 30.0), abs=0.01)


@pytest.mark.parametrize("kind", ["black", "even", "noise", "square"])
def test_a_picture_without_a_sphere_is_reported(kind: str) -> None:
    picture = np.zeros((80, 80))
    if kind == "even":
        picture += 0.5
    elif kind == "noise":
        picture += np.random.default_rng(1).random((80, 80))
    elif kind == "square":
        picture[20:60, 20:60] = 1.0
    with pytest.raises(ImageFileError, match="--circle"):
        find_sphere(picture, PinholeCamera(80, 80, np.radians(10)))
