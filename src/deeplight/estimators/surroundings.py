"""What lies around the photo: the network's ball as a smooth panorama that fits the photo's edge.

The ball's rim, straight ahead, is one direction drawn out to a circle: enlarged, it gives spokes, a
star. There the map is smoothed on the sphere. And next to the photo it is brought to what the photo
shows at its edge, fading with the angle, so that no seam remains.
"""

from functools import lru_cache

import numpy as np
from jaxtyping import Float, Float32

from deeplight.camera_response import CameraResponse
from deeplight.estimators.projection import CLIPPED, MOST_SHOWN, ImagePlane, smoothstep
from deeplight.frames import normalised
from deeplight.mappings import latlong, mirror_ball, resample
from deeplight.preprocess import mean_over_squares

_ROWS = 48
"""Rows at which the map is made: a texel is the size of the ball's finest pixel."""
_BLUR_RAD = float(np.radians(5))
"""Width of the map's smallest detail, about the ball's own."""
_STAR_BLUR_RAD = float(np.radians(16))
"""The same straight ahead, where the ball's outermost pixels are forty degrees long."""
_STAR_FROM_RAD, _STAR_TO_RAD = np.radians(100), np.radians(150)
"""From straight behind: the width grows between these angles."""
_RING_CELLS = 24  # along the photo's shorter side: the outermost are its edge
MAP_ROWS = 128
"""Rows at which the map is fitted to the photo; finer ones lie between these."""
REACH_RAD = float(np.radians(40))
"""So far from the photo's edge the map is adapted to it."""
_MOST_ADAPTED = np.log(200.0)
_DARKEST = 1e-3


def smooth_map(
    ball: Float[np.ndarray, "size size 3"], height: int
) -> Float32[np.ndarray, "height width 3"]:
    """A panorama of the ball without pixels and without spokes straight ahead.

    Linear in the ball; each ball pixel's power is kept, and even light stays even.
    """
    kernel = _quarter(len(ball))
    small = np.empty((_ROWS, 2 * _ROWS, 3), np.float32)
    turns = [(down, across) for down in (1, -1) for across in (1, -1)]
    balls = np.stack([ball[::down, ::across] for down, across in turns], axis=2)
    found = kernel @ balls.reshape(len(kernel[0]), -1).astype(np.float32)
    quarters = np.moveaxis(found.reshape(_ROWS // 2, _ROWS, len(turns), 3), 2, 0)
    for (down, across), quarter in zip(turns, quarters, strict=True):
        small[::down, ::across][: _ROWS // 2, :_ROWS] = quarter
    return kept_power(enlarged(small, height), power_of(small))


def enlarged(
    small: Float32[np.ndarray, "rows columns channels"], height: int
) -> Float32[np.ndarray, "height width channels"]:
    """Bilinear between the texels of a coarser panorama, around the back."""
    rows, columns, _ = small.shape
    if rows == height:
        return small
    at = (np.arange(height) + 0.5) * (rows / height) - 0.5
    top, down = _taps(np.clip(at, 0, rows - 1))
    between = (
        small[top] * (1 - down[:, None, None])
        + small[(top + 1).clip(0, rows - 1)] * (down[:, None, None])
    )
    at = (np.arange(2 * height) + 0.5) * (columns / (2 * height)) - 0.5
    left, across = _taps(at)
    across = across[None, :, None]
    result: np.ndarray = between[:, left % columns] * (1 - across)
    result += between[:, (left + 1) % columns] * across
    return result


def power_of(radiance: Float32[np.ndarray, "height width 3"]) -> Float32[np.ndarray, "3"]:
    """Radiance of a panorama summed over all directions."""
    weights = latlong.solid_angles(*radiance.shape[:2])[:, 0].astype(np.float32)
    return weights @ radiance.sum(axis=1)


def kept_power(
    radiance: Float32[np.ndarray, "height width 3"], power: Float32[np.ndarray, "3"]
) -> Float32[np.ndarray, "height width 3"]:
    """The panorama times what brings each channel's sum over the sphere to `power`."""
    factor = power / np.maximum(power_of(radiance), 1e-30)
    return radiance * factor.astype(np.float32)


def adapted(
    surroundings: Float32[np.ndarray, "height width 3"],
    pixels: Float32[np.ndarray, "rows columns 3"],
    plane: ImagePlane,
) -> Float32[np.ndarray, "height width 3"]:
    """The map brought to what the photo shows at its edge, less and less away from it.

    The ratio of photo and map along the edge is interpolated in logarithms with weights that fall
    with the angle (Shepard 1968), so that near the edge it is the edge's own.
    """
    directions, radiance, clipped = _edge(pixels, plane)
    here = np.maximum(resample.sample_latlong(surroundings, directions), _DARKEST)
    ratio = np.log(np.maximum(radiance, _DARKEST) / here).clip(-_MOST_ADAPTED, _MOST_ADAPTED)
    ratio = np.where(clipped, np.maximum(ratio, 0), ratio)  # there the photo only says "at least"
    rows, columns, _ = surroundings.shape
    texels = latlong.directions(rows, columns).reshape(-1, 3)
    middle = normalised(directions.mean(0))
    farthest = np.arccos((directions @ middle).min().clip(-1, 1)) + REACH_RAD
    near = np.flatnonzero(texels @ middle.astype(np.float32) > np.cos(min(farthest, np.pi)))
    # The chord is as good as the angle, and cheaper; in place, since these are a million numbers.
    squared = texels[near] @ (-2 * directions.T).astype(np.float32)
    squared += 2
    away = 2 * np.arcsin(np.sqrt(squared.min(1).clip(0, 4)) / 2)
    spacing = plane.shorter / _RING_CELLS
    squared += np.float32(spacing**2 / 4)
    weight = np.sqrt(squared)
    weight *= squared
    np.reciprocal(weight, out=weight)
    fade = smoothstep(1 - away / REACH_RAD)[:, None]
    mean = (weight @ ratio.astype(np.float32)) / weight.sum(1, keepdims=True)
    factor = np.ones((rows * columns, 3), np.float32)
    # Of the two ways to fade a ratio the one that reaches less far, for darker and for brighter.
    factor[near] = np.where(mean < 0, 1 - fade * (1 - np.exp(mean)), np.exp(fade * mean))
    result: np.ndarray = surroundings * factor.reshape(rows, columns, 3)
    return result


def _edge(
    pixels: Float32[np.ndarray, "rows columns 3"], plane: ImagePlane
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Directions, linear radiance and whether it is clipped, of cells along the photo's edge."""
    encoded = mean_over_squares(pixels, min(pixels.shape[:2]) / _RING_CELLS, at_least=3)
    counts = encoded.shape[:2]
    y = plane.top + (np.arange(counts[0]) + 0.5) * ((plane.bottom - plane.top) / counts[0])
    x = plane.left + (np.arange(counts[1]) + 0.5) * ((plane.right - plane.left) / counts[1])
    rays = normalised(np.stack([*np.meshgrid(x, y), np.full(counts, -1.0)], -1))
    ring = np.ones(counts, bool)
    ring[1:-1, 1:-1] = False
    values = encoded[ring]
    linear = np.minimum(CameraResponse().radiance_from_pixel(values), MOST_SHOWN)
    return rays[ring], linear, values > 0.9 * CLIPPED


@lru_cache(maxsize=2)
def _quarter(size: int) -> Float32[np.ndarray, "texels pixels"]:
    """The part of `_spreading` for texels up and to the left: the others mirror it."""
    whole = _spreading(size).reshape(_ROWS, 2 * _ROWS, -1)
    quarter = np.ascontiguousarray(whole[: _ROWS // 2, :_ROWS]).reshape(-1, size * size)
    quarter.setflags(write=False)
    return quarter


def _spreading(size: int) -> Float32[np.ndarray, "texels pixels"]:
    """How each texel of the map is mixed from the ball's pixels.

    Smooth lobes, brought by turns to rows that sum to 1, so that even light stays even, and to
    columns that hold their pixel's solid angle, so that its power is kept (Sinkhorn 1964).
    """
    texels = latlong.directions(_ROWS, 2 * _ROWS).reshape(-1, 3)
    width = _BLUR_RAD + (_STAR_BLUR_RAD - _BLUR_RAD) * smoothstep(
        (np.arccos(texels[:, 2].clip(-1, 1)) - _STAR_FROM_RAD) / (_STAR_TO_RAD - _STAR_FROM_RAD)
    )
    sharpness = (1 / width**2).astype(np.float32)[:, None]
    directions, inside = mirror_ball.subpixels(size, 2)
    kernel = np.zeros((len(texels), size * size), np.float32)
    for sample in range(directions.shape[1]):
        cosine = texels @ directions[:, sample].T.astype(np.float32)
        kernel += np.exp((cosine - 1) * sharpness) * inside[:, sample].astype(np.float32)
    lit = mirror_ball.solid_angles(size).ravel().astype(np.float32)
    kernel[:, lit == 0] = 0
    weights = latlong.solid_angles(_ROWS, 2 * _ROWS).reshape(-1).astype(np.float32)
    for _ in range(12):
        kernel /= kernel.sum(1, keepdims=True)
        held = weights @ kernel
        kernel *= np.divide(lit, held, out=np.zeros_like(lit), where=held > 0)
    return kernel


def _taps(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    first = np.floor(at).astype(int)
    return first, (at - first).astype(np.float32)
