"""What takes the grain of few rays out of a preview; with many rays it does next to nothing.

Shadows are smooth but where objects touch the ground, and what an object looks like changes where
its surface turns or its colour does: so both may borrow rays from pixels near by.
"""

import numpy as np
from jaxtyping import Float

ENOUGH_SAMPLES = 64
"""With more rays than this a pixel's own do."""

_SPARK = 1.25  # times the second brightest neighbour
_REACH = 2
_NOTHING = 1e3  # squared difference from a pixel that shows no object
_ALIKE = 0.004  # squared difference of normals and albedos at which a neighbour counts 1 / e
_FEWEST = 5  # pixels, its own one of them, that count as much: in a crease few are alike


def smooth_sums(
    sums: Float[np.ndarray, "height width n"], rounds: int
) -> Float[np.ndarray, "height width n"]:
    """Weights 1 2 1 along both axes, this number of times.

    For sums over rays, not for their quotients: pixels without rays then count for nothing.
    """
    for axis in (0, 1) * rounds:
        padded = np.pad(sums, [(1, 1) if a == axis else (0, 0) for a in range(3)], mode="edge")
        first, last = (np.take(padded, range(k, k + sums.shape[axis]), axis) for k in (0, 2))
        sums = (first + 2 * sums + last) / 4
    return sums


def without_sparks(
    radiance: Float[np.ndarray, "height width 3"], cover: Float[np.ndarray, "height width"]
) -> Float[np.ndarray, "height width 3"]:
    """Dim each pixel that alone is brighter than all but one of its eight neighbours.

    A ray that met a small lamp by chance makes one; the reflection of a lamp has several pixels.

    Args:
        radiance: times the cover.
        cover: share of the pixel.
    """
    own = radiance.max(-1) / np.maximum(cover, 1e-6)
    padded = np.pad(own, 1, mode="edge")
    height, width = own.shape
    around = [
        padded[down : down + height, right : right + width]
        for down, right in np.ndindex(3, 3)
        if (down, right) != (1, 1)
    ]
    second = np.sort(np.stack(around), axis=0)[-2]
    limit = np.maximum(_SPARK * second, 1e-6)
    return radiance * np.minimum(1, limit / np.maximum(own, 1e-6))[..., None]


def denoised(
    radiance: Float[np.ndarray, "height width 3"],
    cover: Float[np.ndarray, "height width"],
    features: Float[np.ndarray, "height width n"],
    sharp: Float[np.ndarray, "height width"] | float = 0.0,
    step: int = 1,
) -> Float[np.ndarray, "height width 3"]:
    """Average the objects' radiance over neighbours of like surface.

    In a crease no pixel is like another: each shows another share of both sides. It borrows from
    those that are the least unlike.

    Args:
        radiance, features: times the cover; features are albedo and normal.
        cover: share of the pixel.
        sharp: share that reflects like a mirror, where even a crease shows a picture.
        step: pixels from neighbour to neighbour.

    Returns:
        Radiance, again times the cover.
    """
    padded = np.concatenate([radiance, cover[..., None], features], axis=-1)
    reach = step * _REACH
    padded = np.pad(padded, [(reach, reach), (reach, reach), (0, 0)])
    height, width = cover.shape
    own = features / np.maximum(cover, 1e-6)[..., None]
    around = [
        padded[down : down + height, right : right + width]
        for down in range(0, 2 * reach + 1, step)
        for right in range(0, 2 * reach + 1, step)
    ]
    apart = np.stack([_apart(other[..., 3], other[..., 4:], own) for other in around])
    nearest = np.partition(apart, _FEWEST - 1, axis=0)[_FEWEST - 1]
    alike = np.where(sharp > cover / 2, _ALIKE, np.maximum(nearest, _ALIKE))
    total, weights = np.zeros_like(radiance), np.zeros((height, width))
    for other, unlike in zip(around, apart, strict=True):
        weight = np.exp(-unlike / alike)
        total += weight[..., None] * other[..., :3]
        weights += weight * other[..., 3]
    result: np.ndarray = total * (cover / np.maximum(weights, 1e-9))[..., None]
    return result


def _apart(
    share: Float[np.ndarray, "height width"],
    features: Float[np.ndarray, "height width n"],
    own: Float[np.ndarray, "height width n"],
) -> Float[np.ndarray, "height width"]:
    """Squared differences of features; large where a neighbour has none."""
    differences = features / np.maximum(share, 1e-6)[..., None] - own
    apart: np.ndarray = np.where(share > 0, (differences**2).sum(-1), _NOTHING)
    return apart
