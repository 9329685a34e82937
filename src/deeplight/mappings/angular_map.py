"""The angular map: a disc whose radius grows with the angle from the view (Debevec's light probes).

Disc coordinates: u right, v up, both in (-1, 1); row 0 is the top. The centre is the direction the
camera looks (-Z), right of it is +X; r = 1 is straight back (+Z), all around the rim.
"""

import numpy as np
from jaxtyping import Bool, Float

from deeplight.frames import Directions
from deeplight.mappings import mirror_ball


def directions(size: int, supersample: int = 1) -> Float[np.ndarray, "n n 3"]:
    """Unit direction of every pixel centre; centres off the disc give the rim's (+Z)."""
    u, v = mirror_ball.grid(size, supersample)
    radius = np.hypot(u, v)
    angle = np.pi * np.minimum(radius, 1.0)
    across = np.sin(angle) / np.maximum(radius, 1e-12)
    return np.stack([u * across, v * across, -np.cos(angle)], axis=-1)


def on_disc(size: int, supersample: int = 1) -> Bool[np.ndarray, "n n"]:
    """Pixels whose centre lies on the disc."""
    return np.hypot(*mirror_ball.grid(size, supersample)) <= 1


def position(
    directions: Directions, size: int
) -> tuple[Float[np.ndarray, "*n"], Float[np.ndarray, "*n"]]:
    """(row, column) of directions, continuous: 0.0 is the centre of the first pixel."""
    x, y, z = directions[..., 0], directions[..., 1], directions[..., 2]
    across = np.hypot(x, y)
    scale = np.arctan2(across, -z) / np.pi / np.maximum(across, 1e-12)
    return (1 - y * scale) * (size / 2) - 0.5, (1 + x * scale) * (size / 2) - 0.5
