"""The mirror ball mapping: all directions seen in a chrome ball from far away.

Ball coordinates: u right, v up, both in (-1, 1); row 0 is the top. The centre shows the
light from behind the camera (+Z), the circle of radius 0.7071 the side horizon, the rim
what lies straight ahead (-Z). Equal areas of the disc are equal solid angles, so each
pixel of an N x N ball holds 16 / N^2 sr (section 3.2; Reinhard et al. 2010).
"""

from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float, Int

from deeplight.frames import Directions

Ball = Float[np.ndarray, "size size"]


def directions_from_uv(u: Float[np.ndarray, "*n"], v: Float[np.ndarray, "*n"]) -> Directions:
    """Unit direction reflected at ball position (u, v): d = 2 n_z n - Z.

    Positions outside the disc are taken at its rim.
    """
    radius = np.maximum(np.hypot(u, v), 1.0)
    u, v = u / radius, v / radius
    z = np.sqrt(np.maximum(1.0 - u * u - v * v, 0.0))
    return np.stack([2 * z * u, 2 * z * v, 2 * z * z - 1], axis=-1)


def uv_from_directions(
    directions: Directions,
) -> tuple[Float[np.ndarray, "*n"], Float[np.ndarray, "*n"]]:
    """Ball position of unit directions: (u, v) = (d_x, d_y) / sqrt(2 (1 + d_z)).

    Straight ahead (-Z) is the whole rim; its one answer here is the top, (0, 1).
    """
    x, y, z = directions[..., 0], directions[..., 1], directions[..., 2]
    across = np.hypot(x, y)
    radius = np.sqrt(np.clip((1 - z) / 2, 0.0, 1.0))  # sin(theta / 2), exact at the rim too
    at_pole = across < 1e-12
    safe = np.where(at_pole, 1.0, across)
    u = np.where(at_pole, 0.0, x / safe) * radius
    v = np.where(at_pole, 1.0, y / safe) * radius
    return u, v


def pixel_of_directions(directions: Directions, size: int) -> Int[np.ndarray, "*n"]:
    """Row-major index of the ball pixel each direction falls into."""
    u, v = uv_from_directions(directions)
    column = np.clip(((u + 1) * (size / 2)).astype(np.int32), 0, size - 1)
    row = np.clip(((1 - v) * (size / 2)).astype(np.int32), 0, size - 1)
    # A direction on the very rim can round into a corner pixel that holds no light.
    return nearest_lit(size)[row * size + column]


def grid(size: int, supersample: int = 1) -> tuple[Float[np.ndarray, "n n"], ...]:
    """(u, v) of the centres of size*supersample squared ball positions, row 0 at the top."""
    n = size * supersample
    along = (np.arange(n) + 0.5) * (2 / n) - 1
    u, v = np.meshgrid(along, -along)
    return u, v


@lru_cache(maxsize=16)
def pixel_directions(size: int) -> Float[np.ndarray, "size size 3"]:
    """Direction of every pixel centre; centres off the disc give the nearest rim direction.

    Read-only.
    """
    result = directions_from_uv(*grid(size))
    result.setflags(write=False)
    return result


def subpixels(
    size: int, supersample: int = 4
) -> tuple[Float[np.ndarray, "pixels samples 3"], Bool[np.ndarray, "pixels samples"]]:
    """Directions spread evenly over each pixel, and which of them lie on the disc.

    Every pixel with any coverage has at least one sample on the disc: a sliver whose
    samples all miss it keeps the one nearest the rim, moved onto it.
    """
    u, v = (_by_pixel(a, size, supersample) for a in grid(size, supersample))
    radius = np.hypot(u, v)
    inside = radius <= 1
    sliver = (coverage(size).ravel() > 0) & ~inside.any(axis=1)
    inside[sliver, radius[sliver].argmin(axis=1)] = True
    return directions_from_uv(u, v), inside


@lru_cache(maxsize=16)
def coverage(size: int) -> Ball:
    """Share of each pixel's area that lies on the disc, 0 to 1 (read-only array).

    Integrated along u with the height of the circle in closed form: counting pixel
    centres instead overstates 4 pi by 1 % at N = 32 (and its far hemisphere by 4 %).
    """
    fine = 64
    u = np.abs((np.arange(size * fine) + 0.5) * (2 / (size * fine)) - 1)
    half_height = np.sqrt(1 - u * u)  # of the circle above the middle
    top = 1 - np.arange(size)[:, None] * (2 / size)
    low, high = np.minimum(abs(top), abs(top - 2 / size)), 2 / size
    inside = np.clip((half_height[None, :] - low) / high, 0.0, 1.0)
    if size % 2:  # the middle row straddles the horizon: both halves count
        inside[size // 2] = np.clip(half_height * size, 0.0, 1.0)
    area = inside.reshape(size, size, fine).mean(axis=2)
    area[area < 1e-4] = 0.0  # slivers too thin to hold light
    area.setflags(write=False)
    return area


@lru_cache(maxsize=16)
def solid_angles(size: int) -> Ball:
    """Solid angle of each pixel in sr: 16 / N^2 times its coverage; they sum to 4 pi; read-only."""
    result = coverage(size) * (16 / size**2)
    result.setflags(write=False)
    return result


def _by_pixel(values: np.ndarray, size: int, supersample: int) -> np.ndarray:
    blocks = values.reshape(size, supersample, size, supersample).swapaxes(1, 2)
    return blocks.reshape(size * size, supersample**2)


@lru_cache(maxsize=16)
def nearest_lit(size: int) -> Int[np.ndarray, "pixels"]:
    """For each pixel the index of itself, or of the pixel at the rim towards the centre."""
    u, v = grid(size)
    inward = np.minimum(1, (1 - 1 / size) / np.maximum(np.hypot(u, v), 1e-9))
    column, row = (
        ((u * inward + 1) * (size / 2)).astype(int),
        ((1 - v * inward) * (size / 2)).astype(int),
    )
    lit = coverage(size) > 0
    index = np.where(lit, np.arange(size * size).reshape(size, size), row * size + column).ravel()
    index.setflags(write=False)
    return index
