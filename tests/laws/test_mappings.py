"""Mirror ball, latlong and cube: 4 pi, round trips, and what makes each mapping what it is."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from deeplight.mappings import cube, latlong, mirror_ball

SIZES = (2, 3, 7, 16, 31, 32, 33, 64, 100)
on_disc = st.tuples(st.floats(0, 0.999), st.floats(-np.pi, np.pi))


@pytest.mark.parametrize("size", SIZES)
def test_ball_pixels_sum_to_4_pi(size: int) -> None:
    assert mirror_ball.solid_angles(size).sum() == pytest.approx(4 * np.pi, rel=3e-4)
    if size >= 16:
        assert mirror_ball.solid_angles(size).sum() == pytest.approx(4 * np.pi, rel=1e-5)


@pytest.mark.parametrize("height", SIZES)
def test_latlong_pixels_sum_to_4_pi(height: int) -> None:
    assert latlong.solid_angles(height, 2 * height).sum() == pytest.approx(4 * np.pi, rel=1e-12)


@pytest.mark.parametrize("size", SIZES)
def test_cube_pixels_sum_to_4_pi(size: int) -> None:
    assert 6 * cube.solid_angles(size).sum() == pytest.approx(4 * np.pi, rel=1e-12)


def test_counting_ball_pixel_centres_would_overstate_4_pi() -> None:
    """Why coverage exists: 812 centres lie on the disc, 0.96 % too many."""
    inside = np.hypot(*mirror_ball.grid(32)) <= 1
    assert inside.sum() == 812
    assert inside.sum() * 16 / 32**2 == pytest.approx(4 * np.pi * 1.0096, rel=1e-4)


@pytest.mark.parametrize("size", [4, 7, 16])
def test_every_whole_ball_pixel_holds_the_same_solid_angle(size: int) -> None:
    """Equal area: count evenly spread directions per pixel, independently of the formula."""
    fine = latlong.directions(1024, 2048)
    pixel = mirror_ball.pixel_of_directions(fine, size)
    counted = np.bincount(pixel.ravel(), latlong.solid_angles(1024, 2048).ravel(), size**2)
    whole = mirror_ball.coverage(size).ravel() == 1
    np.testing.assert_allclose(counted[whole], 16 / size**2, rtol=0.01)


@given(on_disc)
def test_ball_position_to_direction_and_back(polar: tuple[float, float]) -> None:
    radius, angle = polar
    u, v = np.array([radius * np.cos(angle)]), np.array([radius * np.sin(angle)])
    direction = mirror_ball.directions_from_uv(u, v)
    assert np.linalg.norm(direction) == pytest.approx(1)
    back = mirror_ball.uv_from_directions(direction)
    np.testing.assert_allclose(np.concatenate(back), np.concatenate([u, v]), atol=1e-9)


def test_direction_to_ball_position_and_back(unit_vectors) -> None:
    directions = unit_vectors(5000)
    back = mirror_ball.directions_from_uv(*mirror_ball.uv_from_directions(directions))
    np.testing.assert_allclose(back, directions, atol=1e-6)


def test_ball_is_the_mirror_law(unit_vectors) -> None:
    """The direction seen is the view reflected at the surface: angle in = angle out."""
    u, v = mirror_ball.grid(33)
    inside = np.hypot(u, v) < 1
    normals = np.stack([u, v, np.sqrt(np.where(inside, 1 - u**2 - v**2, 0))], axis=-1)[inside]
    seen = mirror_ball.pixel_directions(33)[inside]
    np.testing.assert_allclose((seen * normals).sum(-1), normals[:, 2], atol=1e-12)
    halfway = seen + [0, 0, 1]
    np.testing.assert_allclose(np.cross(halfway, normals), 0, atol=1e-12)


def test_ball_radius_is_the_sine_of_half_the_angle(unit_vectors) -> None:
    directions = unit_vectors(1000)
    theta = np.arccos(np.clip(directions[:, 2], -1, 1))
    radius = np.hypot(*mirror_ball.uv_from_directions(directions))
    np.testing.assert_allclose(radius, np.sin(theta / 2), atol=1e-9)


@pytest.mark.parametrize("size", [1, 2, 5, 32, 33])
def test_ball_pixel_centres_fall_into_their_own_pixel(size: int) -> None:
    inside = (np.hypot(*mirror_ball.grid(size)) < 1).ravel()
    pixel = mirror_ball.pixel_of_directions(mirror_ball.pixel_directions(size), size).ravel()
    np.testing.assert_array_equal(pixel[inside], np.arange(size * size)[inside])


def test_no_direction_falls_into_a_pixel_without_light(unit_vectors) -> None:
    directions = np.concatenate([unit_vectors(20000), [[0, 0, -1], [1e-9, 0, -1], [0, 0, 1]]])
    for size in (31, 32, 64):
        pixel = mirror_ball.pixel_of_directions(directions, size)
        assert (mirror_ball.coverage(size).ravel()[pixel] > 0).all()


def test_subpixels_are_inside_their_pixel_and_cover_every_lit_one() -> None:
    directions, inside = mirror_ball.subpixels(32, 4)
    pixel = mirror_ball.pixel_of_directions(directions, 32)
    lit = mirror_ball.coverage(32).ravel() > 0
    assert inside.any(axis=1)[lit].all()
    whole = mirror_ball.coverage(32).ravel() == 1
    assert (pixel == np.arange(1024)[:, None])[whole].all()


@pytest.mark.parametrize("height", [1, 2, 5, 64, 75])
def test_latlong_pixel_to_direction_and_back(height: int) -> None:
    directions = latlong.directions(height, 2 * height)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=-1), 1, atol=1e-6)
    row, column = latlong.position(directions.astype(float), height, 2 * height)
    rows, columns = np.meshgrid(np.arange(height), np.arange(2 * height), indexing="ij")
    np.testing.assert_allclose(row, rows, atol=1e-3)
    np.testing.assert_allclose(column, columns, atol=1e-3)


def test_latlong_solid_angle_is_the_area_its_pixels_catch(unit_vectors) -> None:
    row, _ = latlong.position(unit_vectors(200_000), 8, 16)
    share = np.bincount(np.clip(np.round(row).astype(int), 0, 7), minlength=8) / 200_000
    want = latlong.solid_angles(8, 16).sum(axis=1) / (4 * np.pi)
    np.testing.assert_allclose(share, want, atol=0.004)


@pytest.mark.parametrize("size", [1, 2, 5, 32])
def test_cube_faces_look_along_their_axis_and_tile_the_sphere(size: int) -> None:
    directions = cube.directions(size)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=-1), 1)
    for face, name in enumerate(cube.FACES):
        axis = "xyz".index(name[1])
        sign = 1 if name[0] == "+" else -1
        largest = np.abs(directions[face]).argmax(axis=-1)
        assert (sign * directions[face, ..., axis] > 0).all()
        assert (largest == axis).all()


def test_cube_pixel_solid_angle_is_cosine_cubed() -> None:
    """An independent formula: dA cos^3 on the plane at distance 1."""
    size = 64
    cosine = -cube.directions(size)[5, ..., 2]  # the -Z face
    np.testing.assert_allclose(cube.solid_angles(size), (2 / size) ** 2 * cosine**3, rtol=1e-3)


@pytest.mark.parametrize("mapping", ["ball", "latlong", "cube"])
def test_the_mean_direction_is_zero_and_the_second_moment_isotropic(mapping: str) -> None:
    """Weights and directions belong together: the first two moments of the sphere."""
    directions, weights = {
        "ball": lambda: (mirror_ball.pixel_directions(64), mirror_ball.solid_angles(64)),
        "latlong": lambda: (latlong.directions(64, 128), latlong.solid_angles(64, 128)),
        "cube": lambda: (cube.directions(64), np.stack([cube.solid_angles(64)] * 6)),
    }[mapping]()
    directions, weights = directions.reshape(-1, 3).astype(float), weights.reshape(-1)
    np.testing.assert_allclose(weights @ directions / (4 * np.pi), 0, atol=2e-3)
    moment = (directions * weights[:, None]).T @ directions
    np.testing.assert_allclose(moment, 4 * np.pi / 3 * np.eye(3), atol=0.02)
