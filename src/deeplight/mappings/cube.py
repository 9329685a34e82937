"""Cube maps: six square faces in the order +X, -X, +Y, -Y, +Z, -Z of the camera frame.

Each face is seen from the centre of the cube with the column axis to its right and the
row axis down. Side faces have +Y up; the top face (+Y) meets the -Z face at its lower edge
and the bottom face (-Y) at its upper edge, both with +X on the right.
"""

import numpy as np
from jaxtyping import Float, Int

from deeplight.frames import Directions, dot, normalised

FACES = ("+x", "-x", "+y", "-y", "+z", "-z")

# For each face: its forward axis, its right axis and its up axis.
_AXES = np.array(
    [
        [[1, 0, 0], [0, 0, 1], [0, 1, 0]],
        [[-1, 0, 0], [0, 0, -1], [0, 1, 0]],
        [[0, 1, 0], [1, 0, 0], [0, 0, 1]],
        [[0, -1, 0], [1, 0, 0], [0, 0, -1]],
        [[0, 0, 1], [-1, 0, 0], [0, 1, 0]],
        [[0, 0, -1], [1, 0, 0], [0, 1, 0]],
    ],
    dtype=np.float64,
)


def directions(size: int) -> Float[np.ndarray, "6 size size 3"]:
    """Unit direction of every pixel centre."""
    along = (np.arange(size) + 0.5) * (2 / size) - 1
    right, down = np.meshgrid(along, along)
    forward, right_axis, up_axis = (_AXES[:, k, None, None, :] for k in range(3))
    vectors = forward + right[..., None] * right_axis - down[..., None] * up_axis
    return normalised(vectors)


def solid_angles(size: int) -> Float[np.ndarray, "size size"]:
    """Solid angle of the pixels of one face in sr, exact; six faces sum to 4 pi."""
    edge = np.arange(size + 1) * (2 / size) - 1
    x, y = np.meshgrid(edge, edge)
    corner = np.arctan2(x * y, np.sqrt(x * x + y * y + 1))
    return corner[1:, 1:] - corner[:-1, 1:] - corner[1:, :-1] + corner[:-1, :-1]


def position(
    directions: Directions, size: int
) -> tuple[Int[np.ndarray, "*n"], Float[np.ndarray, "*n"], Float[np.ndarray, "*n"]]:
    """(face, row, column) of directions; 0.0 is the first pixel's centre, continuous."""
    forward = np.stack([directions @ axes[0].astype(directions.dtype) for axes in _AXES], axis=-1)
    face = forward.argmax(axis=-1)
    depth = np.take_along_axis(forward, face[..., None], axis=-1)[..., 0]
    right, up = (dot(directions, _AXES[face, k].astype(directions.dtype)) / depth for k in (1, 2))
    return face, (1 - up) * (size / 2) - 0.5, (1 + right) * (size / 2) - 0.5
