"""A teapot of our own, by formula: body, lid, spout, handle, foot."""

from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int

from deeplight.compose.shapes import Points, polygonised

_LOW, _HIGH = np.array([-1.12, -0.06, -0.62]), np.array([1.06, 1.12, 0.62])
_SPOUT = np.array([[0.40, 0.34, 0.0], [0.68, 0.46, 0.0], [0.78, 0.70, 0.0], [0.94, 0.82, 0.0]])
_SPOUT_RADII = np.array([0.15, 0.105, 0.075, 0.07])


@lru_cache(maxsize=4)
def pot(
    cells: int = 72,
) -> tuple[Float[np.ndarray, "n 3"], Int[np.ndarray, "m 3"], Float[np.ndarray, "n 3"]]:
    """Vertices, triangles and normals of a teapot, about 2 long and 1 high, on y = 0."""
    return polygonised(_distance, _LOW, _HIGH, cells)


def _distance(p: Points) -> Float[np.ndarray, "*n"]:
    x, y, z = p[..., 0], p[..., 1], p[..., 2]
    ring = np.hypot(x, z)
    body = _ellipse(ring, y - 0.44, 0.56, 0.42)
    foot = _rounded(ring, y - 0.05, 0.34, 0.04, 0.02)
    result = _joined(body, foot, 0.06)
    result = _joined(result, _rounded(ring, y - 0.84, 0.27, 0.02, 0.015), 0.02)  # the rim
    result = _joined(result, _ellipse(ring, y - 0.82, 0.25, 0.14), 0.01)  # the lid
    result = _joined(result, np.hypot(ring, y - 1.01) - 0.065, 0.03)  # its knob
    result = _joined(result, _spout(p), 0.08)
    # The handle: a flattened ring about Z; what would stand inside the body is part of it anyway.
    around = np.hypot((x + 0.62) / 1.15, y - 0.48) - 0.27
    result = _joined(result, np.hypot(around * 1.05, z) - 0.055, 0.05)
    flat: np.ndarray = np.maximum(result, -y)
    return flat


def _spout(p: Points) -> np.ndarray:
    """Cones between balls, smoothly joined, with a hollow at the end."""
    result = np.full(p.shape[:-1], 1e3)
    for start, end, first, last in zip(
        _SPOUT[:-1], _SPOUT[1:], _SPOUT_RADII[:-1], _SPOUT_RADII[1:], strict=True
    ):
        along = end - start
        share = np.clip(((p - start) @ along) / (along @ along), 0, 1)
        away = np.linalg.norm(p - start - share[..., None] * along, axis=-1)
        result = _joined(result, away - first - share * (last - first), 0.05)
    hollow: np.ndarray = np.linalg.norm(p - _SPOUT[-1] - [0.07, 0.05, 0], axis=-1) - 0.075
    return np.maximum(result, -hollow)


def _ellipse(ring: np.ndarray, y: np.ndarray, across: float, up: float) -> np.ndarray:
    """About the distance to an ellipsoid around Y."""
    scaled = np.hypot(ring / across, y / up)
    slope = np.maximum(np.hypot(ring / across**2, y / up**2), 1e-9)
    result: np.ndarray = scaled * (scaled - 1) / slope
    return result


def _rounded(
    ring: np.ndarray, y: np.ndarray, radius: float, half: float, edge: float
) -> np.ndarray:
    """Distance to a disc of some thickness with rounded edges."""
    out, above = ring - radius + edge, np.abs(y) - half + edge
    outside = np.hypot(np.maximum(out, 0), np.maximum(above, 0))
    result: np.ndarray = outside + np.minimum(np.maximum(out, above), 0) - edge
    return result


def _joined(a: np.ndarray, b: np.ndarray, softness: float) -> np.ndarray:
    overlap = np.maximum(softness - np.abs(a - b), 0) / softness
    result: np.ndarray = np.minimum(a, b) - overlap**2 * softness / 4
    return result
