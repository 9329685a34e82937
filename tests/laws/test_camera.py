"""The pinhole camera: its field of view, its pixels, and what perspective does to a ball."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from deeplight import frames
from deeplight.camera import (
    BACKGROUND_FRACTION,
    BACKGROUND_HEIGHT,
    BACKGROUND_WIDTH,
    FRAME_HEIGHT,
    FRAME_WIDTH,
    TRAINED_CAMERA,
    PinholeCamera,
)


def test_the_trained_camera_is_the_papers() -> None:
    """Portrait 1080 x 1920 that observes 6 % of the sphere (section 1, figure 1)."""
    assert (TRAINED_CAMERA.width, TRAINED_CAMERA.height) == (1080, 1920)
    assert TRAINED_CAMERA.share_of_sphere == pytest.approx(0.06, abs=0.005)
    assert np.degrees(TRAINED_CAMERA.horizontal_fov_rad) == pytest.approx(40, abs=0.3)


def test_the_networks_input_is_an_eighth_of_the_cut_frame() -> None:
    """1080 x 1536 to 135 x 192, an exact 8 x box (section 3.2)."""
    assert FRAME_HEIGHT * BACKGROUND_FRACTION == 1536
    assert (FRAME_WIDTH, 1536) == (8 * BACKGROUND_WIDTH, 8 * BACKGROUND_HEIGHT)


def test_share_of_sphere_is_the_solid_angle_of_the_pixels() -> None:
    camera = PinholeCamera(90, 160, TRAINED_CAMERA.vertical_fov_rad)
    half_width, half_height = camera.tangents
    pixel_area = (2 * half_width / 90) * (2 * half_height / 160)
    solid_angle = (pixel_area * (-camera.rays()[..., 2]) ** 3).sum()
    assert solid_angle / (4 * np.pi) == pytest.approx(camera.share_of_sphere, rel=1e-4)


@given(st.integers(1, 60), st.integers(1, 60), st.floats(0.05, 3.0))
def test_pixel_to_ray_and_back(width: int, height: int, fov: float) -> None:
    camera = PinholeCamera(width, height, fov)
    rays = camera.rays()
    np.testing.assert_allclose(np.linalg.norm(rays, axis=-1), 1)
    row, column = camera.pixel_of_directions(rays)
    rows, columns = np.meshgrid(np.arange(height), np.arange(width), indexing="ij")
    np.testing.assert_allclose(row, rows, atol=1e-6)
    np.testing.assert_allclose(column, columns, atol=1e-6)


def test_the_picture_is_upright_and_not_mirrored() -> None:
    rays = TRAINED_CAMERA.rays()
    assert rays[0, 540, 1] > 0 > rays[-1, 540, 1]
    assert rays[960, 0, 0] < 0 < rays[960, -1, 0]
    assert (rays[..., 2] < 0).all()


def test_the_first_rows_alone_are_the_same_rays() -> None:
    np.testing.assert_array_equal(TRAINED_CAMERA.rays(1536), TRAINED_CAMERA.rays()[:1536])


@pytest.mark.parametrize("fov_deg", [30, 66, 90])
def test_the_edges_are_the_field_of_view(fov_deg: float) -> None:
    camera = PinholeCamera(20, 40, np.radians(fov_deg))
    half = np.radians(fov_deg / 2)
    row, _ = camera.pixel_of_directions(np.array([[0, np.sin(half), -np.cos(half)]]))
    assert row[0] == pytest.approx(-0.5)  # the top edge of the first pixel


@pytest.mark.parametrize(("off_axis_deg", "ratio"), [(0, 1.0), (20, 1.06), (30, 1.15)])
def test_an_off_axis_ball_is_an_ellipse_in_the_frame(off_axis_deg: float, ratio: float) -> None:
    """Why section 3.1 re-samples each sphere: the silhouette of a small ball, projected."""
    radius_rad, around = np.radians(1.0), np.linspace(0, 2 * np.pi, 361)
    cone = np.stack(
        [
            np.sin(radius_rad) * np.cos(around),
            np.sin(radius_rad) * np.sin(around),
            np.full_like(around, -np.cos(radius_rad)),
        ],
        axis=-1,
    )
    silhouette = cone @ frames.rotation("x", np.radians(-off_axis_deg)).T
    row, column = PinholeCamera(1000, 1000, np.radians(90)).pixel_of_directions(silhouette)
    assert np.ptp(row) / np.ptp(column) == pytest.approx(ratio, abs=0.006)
    assert np.ptp(row) / np.ptp(column) == pytest.approx(
        1 / np.cos(np.radians(off_axis_deg)), rel=1e-3
    )
