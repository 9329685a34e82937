"""Axes and rotations: the only place that decides which way an axis points.

The camera frame is right-handed: +X right, +Y up, +Z towards the camera, so the camera
looks along -Z. A rotation reads as a map: `p_world = world_from_camera @ p_camera`.
Arrays of directions hold the axes last, so a map over them is `directions @ matrix.T`.
"""

from typing import Literal

import numpy as np
from jaxtyping import Float

from deeplight.errors import ShapeError

RIGHT = np.array([1.0, 0.0, 0.0])
UP = np.array([0.0, 1.0, 0.0])
VIEW = np.array([0.0, 0.0, -1.0])  # where the camera looks

MIRROR_X = np.diag([-1.0, 1.0, 1.0])  # a scene and its horizontally flipped photo

Rotation = Float[np.ndarray, "3 3"]
Directions = Float[np.ndarray, "*batch 3"]


def normalised(vectors: Directions) -> Directions:
    """The vectors at unit length; a zero vector gives nan, which nothing downstream accepts."""
    return vectors / np.sqrt(dot(vectors, vectors))[..., None]


def dot(one: Directions, other: Directions) -> Float[np.ndarray, "*batch"]:
    """The dot product of each pair; numpy's sum over so short an axis takes six times as long."""
    products = one * other
    return np.asarray(products[..., 0] + products[..., 1] + products[..., 2])


def rotation(axis: Literal["x", "y", "z"], angle_rad: float) -> Rotation:
    """Right-handed rotation about a coordinate axis."""
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix = np.eye(3)
    matrix[i, i], matrix[i, j], matrix[j, i], matrix[j, j] = cos, -sin, sin, cos
    return matrix


def world_from_camera(yaw_rad: float, pitch_rad: float = 0.0, roll_rad: float = 0.0) -> Rotation:
    """How a hand holds the camera in a world whose +Y is up.

    Positive yaw turns the view to the left, positive pitch raises it, positive roll turns
    the camera counter-clockwise as its holder sees it.
    """
    return rotation("y", yaw_rad) @ rotation("x", pitch_rad) @ rotation("z", roll_rad)


def from_quaternion(quaternion: Float[np.ndarray, "4"]) -> Rotation:
    """The rotation of a quaternion (x, y, z, w) of any length but 0."""
    length = float(np.linalg.norm(quaternion))
    if not 1e-6 < length < 1e6:  # false for nan as well
        raise ValueError("a quaternion without length")
    x, y, z, w = quaternion / length
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def exponential(vector: Float[np.ndarray, "3"]) -> Rotation:
    """The rotation about `vector` by its length in radians (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    cross = crosses(vector / angle if angle > 1e-12 else vector)
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * (cross @ cross)


def crosses(vectors: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3 3"]:
    """[v]x of each: the matrix with [v]x w = v x w."""
    x, y, z = np.moveaxis(np.asarray(vectors, float), -1, 0)
    result = np.zeros((*x.shape, 3, 3))
    result[..., 0, 1], result[..., 0, 2], result[..., 1, 2] = -z, y, -x
    result[..., 1, 0], result[..., 2, 0], result[..., 2, 1] = z, -y, x
    return result


def shortest_turn(old: Float[np.ndarray, "3"], new: Float[np.ndarray, "3"]) -> Rotation:
    """The rotation about one axis that takes one unit direction to another (Rodrigues)."""
    axis, cosine = np.cross(old, new), float(old @ new)
    if cosine < -1 + 1e-9:  # straight opposite: half a turn about anything across
        across = normalised(np.cross(old, np.eye(3)[np.abs(old).argmin()]))
        return 2 * np.outer(across, across) - np.eye(3)
    cross = crosses(axis)
    return np.eye(3) + cross + cross @ cross / (1 + cosine)


def looking_at(direction: Float[np.ndarray, "3"]) -> Rotation:
    """`target_from_camera`: the frame whose -Z is `direction`, with +X kept level.

    Section 3.1 of the paper re-samples each sphere with a camera oriented at its centre;
    this is that camera. `direction` must not be straight up or down.
    """
    z = -normalised(direction)
    x = np.cross(UP, z)
    if np.linalg.norm(x) < 1e-6:
        raise ShapeError("a direction away from the vertical", f"{direction}", "tilt it slightly")
    x = normalised(x)
    return np.stack([x, np.cross(z, x), z])


def require_rotation(matrix: np.ndarray, name: str) -> None:
    """Raise ShapeError unless `matrix` is a proper 3x3 rotation."""
    proper = matrix.shape == (3, 3) and np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-5)
    if not proper or np.linalg.det(matrix) < 0:
        raise ShapeError(f"{name} as a 3x3 rotation", f"{matrix.tolist()}", "build it with frames")


def turned(directions: Directions, new_from_old: Rotation) -> Directions:
    """The same directions, written in the new frame."""
    return directions @ new_from_old.T.astype(directions.dtype)
