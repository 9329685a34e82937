"""Which way every axis points, pinned once per mapping, end to end through `Lighting`."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from deeplight import frames
from deeplight.lighting import Lighting
from deeplight.mappings import cube, latlong, mirror_ball

AXES = {
    "+x": [1, 0, 0],
    "-x": [-1, 0, 0],
    "+y": [0, 1, 0],
    "-y": [0, -1, 0],
    "+z": [0, 0, 1],
    "-z": [0, 0, -1],
}
SIDE = np.sqrt(0.5)  # ball radius of the side horizon
ON_BALL = {"+x": (SIDE, 0), "-x": (-SIDE, 0), "+y": (0, SIDE), "-y": (0, -SIDE), "+z": (0, 0)}
ON_LATLONG = {  # (row, column) as shares of the picture, from the top left
    "-z": (1 / 2, 1 / 2),
    "-x": (1 / 2, 1 / 4),
    "+x": (1 / 2, 3 / 4),
    "+y": (0, None),
    "-y": (1, None),
    "+z": (1 / 2, None),  # the two edges
}
angle = st.floats(-np.pi, np.pi)


def spot(axis: str, height: int = 128) -> np.ndarray:
    """A panorama, dark but for a disc of 6 degrees around an axis."""
    near = latlong.directions(height, 2 * height) @ np.array(AXES[axis], np.float32) > np.cos(0.1)
    return np.repeat(near[..., None], 3, axis=-1).astype(np.float32) + np.float32(1e-3)


@pytest.mark.parametrize("axis", ON_BALL)
def test_axis_on_the_ball(axis: str) -> None:
    u, v = mirror_ball.uv_from_directions(np.array([AXES[axis]], float))
    np.testing.assert_allclose([u[0], v[0]], ON_BALL[axis], atol=1e-12)


@pytest.mark.parametrize("axis", ON_BALL)
def test_axis_on_the_ball_image(axis: str) -> None:
    ball = Lighting.from_latlong(spot(axis)).radiance[..., 0]
    row, column = np.unravel_index(ball.argmax(), ball.shape)
    u, v = ON_BALL[axis]  # u to the right, v up: row 0 is the top
    assert abs(column + 0.5 - 16 * (1 + u)) <= 1.01
    assert abs(row + 0.5 - 16 * (1 - v)) <= 1.01


def test_straight_ahead_is_the_whole_rim() -> None:
    ball = Lighting.from_latlong(spot("-z", height=1024)).radiance[..., 0]
    radius = np.hypot(*mirror_ball.grid(32))
    assert ball[radius < 0.9].max() < 0.01
    for column, row in ((15, 0), (16, 31), (0, 16), (31, 15)):
        assert ball[row, column] > 0.01


@pytest.mark.parametrize("axis", ON_LATLONG)
def test_axis_on_the_latlong(axis: str) -> None:
    panorama = Lighting.from_latlong(spot(axis)).latlong(64)[..., 0]
    row, column = np.unravel_index(panorama.argmax(), panorama.shape)
    want_row, want_column = ON_LATLONG[axis]
    assert abs((row + 0.5) / 64 - want_row) < 0.08
    if want_column is not None:
        assert abs((column + 0.5) / 128 - want_column) < 0.04
    elif axis == "+z":
        assert min(column, 127 - column) < 5


@pytest.mark.parametrize("axis", AXES)
def test_axis_on_the_cube(axis: str) -> None:
    faces = Lighting.from_latlong(spot(axis)).cube(16)[..., 0]
    face, row, column = np.unravel_index(faces.argmax(), faces.shape)
    assert cube.FACES[face] == axis
    assert abs(row - 7.5) < 4
    assert abs(column - 7.5) < 4


@pytest.mark.parametrize(
    ("face", "edge", "neighbour"),
    [
        ("-z", "right", "+x"),
        ("-z", "left", "-x"),
        ("-z", "top", "+y"),
        ("-z", "bottom", "-y"),
        ("+x", "right", "+z"),
        ("+z", "right", "-x"),
        ("-x", "right", "-z"),
        ("+y", "bottom", "-z"),
        ("-y", "top", "-z"),
        ("+y", "right", "+x"),
        ("-y", "right", "+x"),
    ],
)
def test_cube_faces_meet_at_the_stated_edges(face: str, edge: str, neighbour: str) -> None:
    directions = cube.directions(65)[cube.FACES.index(face)]
    at_edge = {
        "right": directions[32, -1],
        "left": directions[32, 0],
        "top": directions[0, 32],
        "bottom": directions[-1, 32],
    }[edge]
    second = np.argsort(-np.abs(at_edge))[1]
    assert ("+" if at_edge[second] > 0 else "-") + "xyz"[second] == neighbour


@given(angle, angle, angle)
def test_rotations_are_proper_and_undone_by_their_transpose(yaw, pitch, roll) -> None:
    matrix = frames.world_from_camera(yaw, pitch, roll)
    frames.require_rotation(matrix, "matrix")
    np.testing.assert_allclose(matrix.T @ matrix, np.eye(3), atol=1e-12)
    assert np.linalg.det(matrix) == pytest.approx(1)


@given(angle, angle, st.sampled_from("xyz"))
def test_angles_about_one_axis_add(first, second, axis) -> None:
    both = frames.rotation(axis, first) @ frames.rotation(axis, second)
    np.testing.assert_allclose(both, frames.rotation(axis, first + second), atol=1e-12)


@pytest.mark.parametrize(
    ("axis", "start", "end"), [("x", "+y", "+z"), ("y", "+z", "+x"), ("z", "+x", "+y")]
)
def test_rotations_are_right_handed(axis: str, start: str, end: str) -> None:
    turned = frames.rotation(axis, np.pi / 2) @ AXES[start]
    np.testing.assert_allclose(turned, AXES[end], atol=1e-12)


def test_a_hand_turns_the_camera_as_stated() -> None:
    left = frames.world_from_camera(0.3) @ frames.VIEW
    raised = frames.world_from_camera(0, 0.3) @ frames.VIEW
    rolled = frames.world_from_camera(0, 0, 0.3) @ frames.UP
    assert left @ -frames.RIGHT == pytest.approx(np.sin(0.3))
    assert raised @ frames.UP == pytest.approx(np.sin(0.3))
    assert rolled @ -frames.RIGHT == pytest.approx(np.sin(0.3))  # its top leans to the left


def test_looking_at_puts_the_target_on_the_view_axis_and_stays_level(unit_vectors) -> None:
    for direction in unit_vectors(100):
        target_from_camera = frames.looking_at(direction)
        frames.require_rotation(target_from_camera, "target_from_camera")
        np.testing.assert_allclose(target_from_camera @ direction, frames.VIEW, atol=1e-9)
        assert target_from_camera[0] @ frames.UP == pytest.approx(0, abs=1e-12)
        assert target_from_camera[1] @ frames.UP > 0


def test_turned_is_the_matrix_as_a_map(unit_vectors) -> None:
    directions, matrix = unit_vectors(10), frames.world_from_camera(0.3, 0.2, 0.1)
    np.testing.assert_allclose(
        frames.turned(directions, matrix), [matrix @ d for d in directions], atol=1e-12
    )
