"""The equirectangular mapping: left to right around the horizon, top = up.

The centre column is the direction the camera looks (-Z); right of centre is +X, left of
centre -X; the left and right edges meet behind the camera (+Z). Pixel centres lie at
(i + 0.5) / size.
"""

from functools import lru_cache

import numpy as np
from jaxtyping import Float

from deeplight.frames import Directions


@lru_cache(maxsize=8)
def directions(height: int, width: int) -> Float[np.ndarray, "height width 3"]:
    """Unit direction of every pixel centre (read-only, float32)."""
    theta = (np.arange(height) + 0.5) * (np.pi / height)  # from +Y down
    phi = (np.arange(width) + 0.5) * (2 * np.pi / width) - np.pi  # right of the view
    result = np.empty((height, width, 3), np.float32)
    result[..., 0] = np.outer(np.sin(theta), np.sin(phi))
    result[..., 1] = np.cos(theta)[:, None]
    result[..., 2] = -np.outer(np.sin(theta), np.cos(phi))
    result.setflags(write=False)
    return result


def position(
    directions: Directions, height: int, width: int
) -> tuple[Float[np.ndarray, "*n"], Float[np.ndarray, "*n"]]:
    """(row, column) of directions, continuous: 0.0 is the centre of the first pixel."""
    x, y, z = directions[..., 0], directions[..., 1], directions[..., 2]
    row = np.arctan2(np.hypot(x, z), y) * (height / np.pi) - 0.5
    column = (np.arctan2(x, -z) + np.pi) * (width / (2 * np.pi)) - 0.5
    return row, column


def nearest(
    values: Float[np.ndarray, "height width *channels"], directions: Float[np.ndarray, "*batch 3"]
) -> Float[np.ndarray, "..."]:
    """The values of the pixels that directions fall into."""
    height, width = values.shape[:2]
    row, column = position(directions, height, width)
    rows = np.round(row).astype(int).clip(0, height - 1)
    found: np.ndarray = values[rows, np.round(column).astype(int) % width]
    return found


@lru_cache(maxsize=16)
def solid_angles(height: int, width: int) -> Float[np.ndarray, "height width"]:
    """Solid angle of every pixel in sr, exact for its band; they sum to 4 pi (read-only)."""
    edges = np.cos(np.arange(height + 1) * (np.pi / height))
    band = (edges[:-1] - edges[1:]) * (2 * np.pi / width)
    return np.broadcast_to(band[:, None], (height, width))
