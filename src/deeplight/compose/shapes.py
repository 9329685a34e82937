"""Built-in objects: a ball and a bunny, both made here by formula.

The paper's object is the Stanford bunny, whose licence does not allow redistribution in an
Apache-2.0 package. This one is ours: a sum of smoothly joined ellipsoids.
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float, Int

Points = Float[np.ndarray, "*n 3"]
Distance = Callable[[Points], Float[np.ndarray, "*n"]]

_GRID = 60  # cells along the bunny's box
_LOW, _HIGH = np.array([-0.72, -0.06, -0.52]), np.array([0.62, 1.48, 0.52])

# Centre, radii, turn about Z in degrees (then about Y), softness of the joint. The bunny looks
# along -X and a little towards +Z; its parts behind z = 0 mirror those in front.
_MIDDLE = (
    ((0.06, 0.40, 0.0), (0.44, 0.39, 0.35), 8, 0.08),  # body
    ((-0.26, 0.34, 0.0), (0.24, 0.34, 0.27), -10, 0.10),  # chest
    ((-0.38, 0.76, 0.0), (0.25, 0.215, 0.205), 18, 0.10),  # head
    ((-0.55, 0.71, 0.0), (0.125, 0.11, 0.12), 0, 0.07),  # muzzle
    ((0.50, 0.24, 0.0), (0.125, 0.12, 0.12), 0, 0.03),  # tail
)
_PAIRS = (
    ((0.20, 0.24, 0.24), (0.27, 0.25, 0.15), 10, 0.05),  # haunch
    ((0.00, 0.05, 0.27), (0.27, 0.075, 0.11), 0, 0.04),  # hind foot
    ((-0.36, 0.06, 0.14), (0.17, 0.08, 0.085), 0, 0.04),  # fore paw
    ((-0.32, 0.20, 0.16), (0.09, 0.22, 0.09), -8, 0.06),  # fore leg
    ((-0.50, 0.68, 0.09), (0.10, 0.09, 0.09), 0, 0.05),  # cheek
    ((-0.20, 1.10, 0.115), (0.085, 0.33, 0.052), -24, 0.03),  # ear
)


@lru_cache(maxsize=4)
def bunny(
    cells: int = _GRID,
) -> tuple[Float[np.ndarray, "n 3"], Int[np.ndarray, "m 3"], Float[np.ndarray, "n 3"]]:
    """Vertices, triangles and normals of a sitting bunny, about 1.4 high, on y = 0."""
    return polygonised(_bunny_distance, _LOW, _HIGH, cells)


@lru_cache(maxsize=4)
def ball(
    cells: int = 40,
) -> tuple[Float[np.ndarray, "n 3"], Int[np.ndarray, "m 3"], Float[np.ndarray, "n 3"]]:
    """Vertices, triangles and normals of a ball of diameter 1 on y = 0."""
    low, high = np.full(3, -0.55), np.full(3, 0.55)
    vertices, faces, normals = polygonised(
        lambda p: np.linalg.norm(p, axis=-1) - 0.5, low, high, cells
    )
    return vertices + [0, 0.5, 0], faces, normals


def polygonised(
    distance: Distance, low: Float[np.ndarray, "3"], high: Float[np.ndarray, "3"], cells: int
) -> tuple[Float[np.ndarray, "n 3"], Int[np.ndarray, "m 3"], Float[np.ndarray, "n 3"]]:
    """Triangles of the surface distance = 0, one vertex in each cell that it crosses.

    Surface nets (Gibson 1998), the vertices then moved onto the surface along its gradient.
    """
    step = float((high - low).max()) / cells
    counts = np.ceil((high - low) / step).astype(int) + 1
    corners = np.stack(np.meshgrid(*(np.arange(n) for n in counts), indexing="ij"), -1)
    inside = distance(low + corners * step) < 0
    eight = [_shifted(inside, np.array(shift)) for shift in np.ndindex(2, 2, 2)]
    among = np.stack(eight).sum(0)
    crossed = (among > 0) & (among < 8)
    number = np.full(crossed.shape, -1)
    number[crossed] = np.arange(crossed.sum())
    vertices = low + (np.argwhere(crossed) + 0.5) * step
    for _ in range(3):
        gradient = _gradient(distance, vertices, step / 8)
        length = np.maximum((gradient**2).sum(-1, keepdims=True), 1e-6)
        move = gradient * (distance(vertices)[:, None] / length)
        vertices = vertices - np.clip(move, -0.7 * step, 0.7 * step)
    normals = _gradient(distance, vertices, step / 8)
    normals /= np.maximum(np.linalg.norm(normals, axis=-1, keepdims=True), 1e-9)
    faces = np.concatenate([_quads(inside, number, axis) for axis in range(3)])
    return vertices, faces, normals


def _bunny_distance(points: Points) -> Float[np.ndarray, "*n"]:
    folded = points * [1, 1, 0] + [0, 0, 1] * np.abs(points)
    result = np.full(points.shape[:-1], 1e3)
    for p, parts in ((points, _MIDDLE), (folded, _PAIRS)):
        for centre, radii, turn_deg, softness in parts:
            one = _ellipsoid(p - centre, np.array(radii), np.radians(turn_deg))
            overlap = np.maximum(softness - np.abs(result - one), 0) / softness
            result = np.minimum(result, one) - overlap**2 * softness / 4
    flat: np.ndarray = np.maximum(result, -points[..., 1])
    return flat


def _ellipsoid(p: Points, radii: Float[np.ndarray, "3"], turn_rad: float) -> np.ndarray:
    """About the distance to an ellipsoid turned about Z; exact on its surface."""
    cos, sin = np.cos(turn_rad), np.sin(turn_rad)
    p = np.stack(
        [cos * p[..., 0] + sin * p[..., 1], cos * p[..., 1] - sin * p[..., 0], p[..., 2]], -1
    )
    scaled = np.linalg.norm(p / radii, axis=-1)
    slope = np.maximum(np.linalg.norm(p / radii**2, axis=-1), 1e-9)
    result: np.ndarray = scaled * (scaled - 1) / slope
    return result


def _shifted(inside: Bool[np.ndarray, "x y z"], by: Int[np.ndarray, "3"]) -> np.ndarray:
    """One of the eight corners of every cell."""
    return inside[tuple(slice(b, n - 1 + b) for b, n in zip(by, inside.shape, strict=True))]


def _gradient(
    distance: Distance, p: Float[np.ndarray, "n 3"], h: float
) -> Float[np.ndarray, "n 3"]:
    steps = np.eye(3) * h
    return np.stack([distance(p + s) - distance(p - s) for s in steps], -1) / (2 * h)


def _quads(
    inside: Bool[np.ndarray, "x y z"], number: Int[np.ndarray, "u v w"], axis: int
) -> Int[np.ndarray, "m 3"]:
    """Two triangles for each grid edge along `axis` that the surface crosses, facing outwards."""
    first, second = np.moveaxis(inside, axis, 0)[:-1], np.moveaxis(inside, axis, 0)[1:]
    edges = np.argwhere((first != second)[:, 1:-1, 1:-1]) + [0, 1, 1]
    cell = np.moveaxis(number, axis, 0)
    a, b, c = edges.T
    ring = np.stack([cell[a, b - j, c - k] for j, k in ((1, 1), (0, 1), (0, 0), (1, 0))], -1)
    leaving = first[a, b, c]  # from inside to outside along the axis
    if axis == 1:  # moving it to the front has exchanged the other two's handedness
        leaving = ~leaving
    ring = np.where(leaving[:, None], ring, ring[:, ::-1])
    return np.concatenate([ring[:, [0, 1, 2]], ring[:, [0, 2, 3]]])
