"""Laws of the outline of a sphere in a pinhole's picture."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deeplight.camera import PinholeCamera
from deeplight.capture.conic import Cone, across, ellipse, moved, rays_around
from deeplight.capture.located import cones_of, rig_of
from deeplight.frames import normalised
from deeplight.sphere import PAPER_RIG

pytestmark = pytest.mark.needs("cv2")


CAMERA = PinholeCamera(540, 960, np.radians(66))
PLACES = st.tuples(st.floats(-0.55, 0.55), st.floats(-0.6, 0.6), st.floats(0.02, 0.2))


def cone_at(x: float, y: float, radius: float) -> Cone:
    return Cone(normalised(np.array([x, y, -1.0])), radius)


@given(PLACES)
def test_the_ellipse_is_the_projected_cone(place: tuple[float, float, float]) -> None:
    cone = cone_at(*place)
    oval = ellipse(CAMERA, cone)
    rays = rays_around(cone, np.linspace(0, 2 * np.pi, 24), np.zeros(1))[:, 0]
    row, column = CAMERA.pixel_of_directions(rays)
    angle = np.radians(oval.angle_deg)
    along = (column - oval.x) * np.cos(angle) + (row - oval.y) * np.sin(angle)
    across = (row - oval.y) * np.cos(angle) - (column - oval.x) * np.sin(angle)
    np.testing.assert_allclose((along / oval.major) ** 2 + (across / oval.minor) ** 2, 1, rtol=1e-6)


def test_a_ball_of_points_projects_into_its_ellipse() -> None:
    """Brute force: points all over a sphere in space, no cone in it."""
    rng = np.random.default_rng(0)
    centre, radius = np.array([0.12, -0.25, -0.5]), 0.04
    points = centre + radius * normalised(rng.normal(size=(200_000, 3)))
    row, column = CAMERA.pixel_of_directions(points)
    cone = Cone(normalised(centre), float(np.arcsin(radius / np.linalg.norm(centre))))
    oval = ellipse(CAMERA, cone)
    angle = np.radians(oval.angle_deg)
    along = (column - oval.x) * np.cos(angle) + (row - oval.y) * np.sin(angle)
    across = (row - oval.y) * np.cos(angle) - (column - oval.x) * np.sin(angle)
    assert abs(along).max() == pytest.approx(oval.major, rel=1e-3)
    assert abs(across).max() == pytest.approx(oval.minor, rel=1e-3)
    assert oval.major / oval.minor > 1.05  # a circle would not do


@given(PLACES)
def test_every_ray_of_the_outline_is_one_angular_radius_from_the_axis(
    place: tuple[float, float, float],
) -> None:
    cone = cone_at(*place)
    rays = rays_around(cone, np.linspace(0, 6, 7), np.array([-0.01, 0.0, 0.01]))
    expected = cone.angular_radius_rad + np.array([-0.01, 0.0, 0.01])
    np.testing.assert_allclose(
        np.arccos(rays @ cone.direction), np.tile(expected, (7, 1)), atol=1e-7
    )


@given(PLACES)
def test_moving_a_cone_moves_its_outline(place: tuple[float, float, float]) -> None:
    cone = cone_at(*place)
    first, _ = across(cone.direction)
    grown = moved(cone, np.array([1e-3, 0.0]), 2e-3)
    outline = rays_around(grown, np.linspace(0, 2 * np.pi, 97), np.zeros(1))[:, 0]
    assert grown.direction @ first == pytest.approx(1e-3, rel=1e-3)
    angles = np.arccos(outline @ cone.direction)
    assert angles.max() == pytest.approx(place[2] + 3e-3, abs=1e-5)
    assert angles.min() == pytest.approx(place[2] + 1e-3, abs=1e-5)


def test_a_rig_is_its_cones_to_a_billionth() -> None:
    """And what differs by less becomes the same to the last bit."""
    cones = cones_of(PAPER_RIG)
    again = rig_of(cones, "paper")
    near = {n: Cone(c.direction + 1e-14, c.angular_radius_rad + 1e-14) for n, c in cones.items()}
    for name, view in PAPER_RIG.views.items():
        got = again.views[name]
        np.testing.assert_allclose(got.ball_from_camera, view.ball_from_camera, atol=3e-9)
        assert got.angular_radius_rad == pytest.approx(view.angular_radius_rad, abs=1e-9)
        same = rig_of(near, "paper").views[name]
        np.testing.assert_array_equal(same.ball_from_camera, got.ball_from_camera)
        assert same.angular_radius_rad == got.angular_radius_rad
