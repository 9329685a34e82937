"""What lies around the photo: the network's ball as a smooth panorama that fits the photo's edge.

The ball's rim, straight ahead, is one direction drawn out to a circle: enlarged, it gives spokes, a
star. There the map is smoothed on the sphere. And next to the photo it is brought to what the photo
shows at its edge, fading with the angle, so that no seam remains.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float, Float32, Int

from deeplight.area_means import mean_over_squares
from deeplight.banded import BLAS_ALONE, Bands, bands, together
from deeplight.camera_response import CameraResponse
from deeplight.estimators.projection import (
    CLIPPED,
    MOST_SHOWN,
    ImagePlane,
    ProjectedPhoto,
    smoothstep,
)
from deeplight.frames import normalised
from deeplight.mappings import latlong, mirror_ball, resample

_ROWS = 48
"""Rows at which the map is made: a texel is the size of the ball's finest pixel."""
_BLUR_RAD = float(np.radians(5))
"""Width of the map's smallest detail, about the ball's own."""
_STAR_BLUR_RAD = float(np.radians(16))
"""The same straight ahead, where the ball's outermost pixels are forty degrees long."""
_STAR_FROM_RAD, _STAR_TO_RAD = np.radians(100), np.radians(150)
"""From straight behind: the width grows between these angles."""
_RING_CELLS = 24  # along the photo's shorter side: the outermost are its edge
MAP_ROWS = 96
"""Rows at which the map is fitted to the photo; finer ones lie between these."""
REACH_RAD = float(np.radians(52))
"""So far from the photo's edge the map is adapted to it, by half at 20 degrees."""
_TILE = 4, 8  # texels of the map that are mixed at once
_LEAST_WEIGHT = 1e-10  # of a texel's largest: the pixels of less are left out
_TOGETHER = 12  # texels of an enlarged line that are mixed at once
_MOST_ADAPTED = np.log(200.0)
_DARKEST = 1e-3


def smooth_map(
    ball: Float[np.ndarray, "size size 3"], height: int
) -> Float32[np.ndarray, "height width 3"]:
    """A panorama of the ball without pixels and without spokes straight ahead.

    Linear in the ball; each ball pixel's power is kept, and even light stays even.
    """
    small = np.empty((_ROWS, 2 * _ROWS, 3), np.float32)
    turns = [(down, across) for down in (1, -1) for across in (1, -1)]
    balls = np.concatenate([ball[::down, ::across] for down, across in turns], axis=2)
    balls = balls.reshape(len(ball) ** 2, -1).astype(np.float32)
    found = np.empty((_ROWS // 2, _ROWS, len(turns) * 3), np.float32)
    for tile in _tiles(len(ball)):
        mixed = tile.kernel @ balls[tile.pixels]
        found[tile.rows, tile.columns] = mixed.reshape(*_TILE, -1)
    quarters = np.moveaxis(found.reshape(_ROWS // 2, _ROWS, len(turns), 3), 2, 0)
    for (down, across), quarter in zip(turns, quarters, strict=True):
        small[::down, ::across][: _ROWS // 2, :_ROWS] = quarter
    return kept_power(enlarged(small, height), power_of(small))


def enlarged(
    small: Float32[np.ndarray, "rows columns channels"], height: int, only: slice = slice(None)
) -> Float32[np.ndarray, "some_rows width channels"]:
    """Bilinear between the texels of a coarser panorama, around the back; `only` some rows."""
    rows, columns, channels = small.shape
    if rows == height:
        return small[only]
    around = np.concatenate([small[:, -1:], small, small[:, :1]], axis=1).reshape(rows, -1)
    first, end, _ = only.indices(height)
    several = together(rows / height, around.shape[1], _TOGETHER)
    lines = _down(rows, height, first, end, several).across_lines(around)
    several = together(columns / (2 * height), len(lines) * channels**2, _TOGETHER)
    found = _across(columns, 2 * height, several, channels).along_lines(lines)
    return found.reshape(-1, 2 * height, channels)


def resized(
    radiance: Float32[np.ndarray, "rows columns channels"], height: int
) -> Float32[np.ndarray, "height width channels"]:
    """A panorama at another number of rows, finer or coarser."""
    if height < len(radiance):
        return resample.shrink(radiance, height, 2 * height)
    return enlarged(radiance, height)


def _between(count: int, more: int) -> Float[np.ndarray, " more"]:
    """Where the middles of `more` texels lie between those of `count`."""
    return (np.arange(more) + 0.5) * (count / more) - 0.5


@lru_cache(maxsize=8)
def _across(columns: int, width: int, several: int, channels: int) -> Bands:
    """What brings `columns`, and one more at either end, to `width` ones."""
    mixing = _bilinear(_between(columns, width) + 1, columns + 2, several)
    return mixing.for_channels(channels)


@lru_cache(maxsize=16)
def _down(rows: int, height: int, first: int, end: int, several: int) -> Bands:
    """What brings `rows` to some of `height` ones."""
    at = _between(rows, height)[first:end].clip(0, rows - 1)
    return _bilinear(at, rows, several)


def _bilinear(at: Float[np.ndarray, " results"], count: int, several: int) -> Bands:
    """What lies at places between the first and the last of `count` texels."""
    before = at.astype(int)

    def weight(texel: np.ndarray, result: np.ndarray) -> np.ndarray:
        return np.maximum(1 - np.abs(texel - at[result]), 0)

    return bands(before, (before + 1).clip(max=count - 1), count, weight, several)


def power_of(radiance: Float32[np.ndarray, "height width 3"]) -> Float32[np.ndarray, "3"]:
    """Radiance of a panorama summed over all directions."""
    weights = latlong.solid_angles(*radiance.shape[:2])[:, 0].astype(np.float32)
    columns = weights @ radiance.reshape(len(radiance), -1)  # numpy's sum along a row is slow
    result: np.ndarray = columns.reshape(-1, 3).sum(axis=0)
    return result


def kept_power(
    radiance: Float32[np.ndarray, "height width 3"], power: Float32[np.ndarray, "3"]
) -> Float32[np.ndarray, "height width 3"]:
    """The panorama times what brings each channel's sum over the sphere to `power`."""
    factor = power / np.maximum(power_of(radiance), 1e-30)
    return times(radiance, factor)


def times(
    radiance: Float32[np.ndarray, "height width 3"], factor: Float[np.ndarray, "3"]
) -> Float32[np.ndarray, "height width 3"]:
    """A panorama times one number per channel, by whole rows: numpy is slow by threes."""
    row = np.tile(factor.astype(np.float32), radiance.shape[1])
    return (radiance.reshape(-1, row.size) * row).reshape(radiance.shape)


def hidden_kept(
    changed: Float32[np.ndarray, "height width 3"],
    before: Float32[np.ndarray, "height width 3"],
    photo: ProjectedPhoto,
) -> Float32[np.ndarray, "height width 3"]:
    """A changed map times what keeps the power of what the photo does not show, by channels."""
    unseen = 1 - enlarged(photo.seen_in_64_rows[..., None], len(before))
    unseen = unseen.repeat(3, axis=2)  # numpy is slow where its inner loop is a texel's three
    gain = power_of(before * unseen) / np.maximum(power_of(changed * unseen), 1e-30)
    return times(changed, gain)


def adapted(
    surroundings: Float32[np.ndarray, "height width 3"],
    pixels: Float32[np.ndarray, "rows columns 3"],
    plane: ImagePlane,
) -> Float32[np.ndarray, "height width 3"]:
    """The map brought to what the photo shows at its edge, less and less away from it.

    The ratio of photo and map along the edge is interpolated with weights that fall with the angle
    (Shepard 1968), so that near the edge it is the edge's own. Of its geometric and its arithmetic
    mean the one counts that changes the map less: a small dark thing in the photo's corner is no
    dark cloud outside, a small bright one no halo.
    """
    encoded = mean_over_squares(pixels, min(pixels.shape[:2]) / _RING_CELLS, at_least=3)
    ring = _ring(*encoded.shape[:2])
    radiance = np.minimum(CameraResponse().radiance_from_pixel(encoded), MOST_SHOWN)
    here = resample.sample_latlong(surroundings, _rays(plane, *ring.shape)[ring])
    ratio = np.zeros(encoded.shape, np.float32)
    ratio[ring] = np.log(np.maximum(radiance[ring], _DARKEST) / np.maximum(here, _DARKEST))
    # Where the photo is clipped it only says "at least".
    least = np.where(encoded > 0.9 * CLIPPED, 0, -_MOST_ADAPTED)
    ratio = ratio.clip(least.astype(np.float32), np.float32(_MOST_ADAPTED))

    rows, columns, _ = surroundings.shape
    turns = _mirrored(plane)
    part = rows // (2 if (-1, 1) in turns else 1), columns // (2 if (1, -1) in turns else 1)
    reach = _reach(plane, ring.shape, (rows, columns), part)
    logs = np.concatenate([ratio[::down, ::across][ring] for down, across in turns], axis=1)
    ratios = np.concatenate([logs, np.exp(logs)], axis=1)
    # By parts too small for BLAS to wake its threads: they wait for more in a busy loop.
    parts = range(0, len(reach.near), BLAS_ALONE // ratios.size)
    means = [reach.weight[at : at + parts.step] @ ratios for at in parts]
    log_mean, mean = np.moveaxis(np.concatenate(means).reshape(-1, 2, len(turns), 3), 1, 0)
    fade = reach.fade[:, None, None]
    # Of two ways to fade, too, the one that reaches less far, for brighter and for darker.
    factor = np.exp(fade * np.maximum(log_mean, 0))
    factor *= 1 - fade * np.maximum(1 - mean, 0)
    result = surroundings.copy()
    texels, (row, column) = result.reshape(-1, 3), np.divmod(reach.near, part[1])
    for turn, (down, across) in enumerate(turns):
        at_row = row if down > 0 else rows - 1 - row
        at_column = column if across > 0 else columns - 1 - column
        texels[at_row * columns + at_column] *= factor[:, turn]
    return result


@dataclass(frozen=True, eq=False)
class _Reach:
    """How the texels near a photo take part in what its edge shows.

    Attributes:
        near: indices of the texels, in the part of the map that was asked for.
        weight: of each cell of the edge; each texel's sum to 1.
        fade: 1 at the edge, 0 at `REACH_RAD` from it.
    """

    near: Int[np.ndarray, " texels"]
    weight: Float32[np.ndarray, "texels cells"]
    fade: Float32[np.ndarray, " texels"]


@lru_cache(maxsize=4)
def _reach(
    plane: ImagePlane, cells: tuple[int, int], size: tuple[int, int], part: tuple[int, int]
) -> _Reach:
    """The reach of a photo's edge into the upper left part of a map; kept for the next photo."""
    edge = _rays(plane, *cells)[_ring(*cells)]
    texels = latlong.directions(*size)[: part[0], : part[1]].reshape(-1, 3)
    middle = normalised(edge.mean(0))
    farthest = np.arccos((edge @ middle).min().clip(-1, 1)) + REACH_RAD
    near = np.flatnonzero(texels @ middle.astype(np.float32) > np.cos(min(farthest, np.pi)))
    # The chord is as good as the angle, and cheaper; in place, since these are many numbers.
    squared = texels[near] @ (-2 * edge.T).astype(np.float32)
    squared += 2
    away = 2 * np.arcsin(np.sqrt(squared.min(1).clip(0, 4)) / 2)
    fade = smoothstep(1 - away / REACH_RAD) ** 2
    spacing = plane.shorter / _RING_CELLS
    squared += np.float32(spacing**2 / 4)
    weight = np.sqrt(squared)
    weight *= squared
    np.reciprocal(weight, out=weight)
    weight /= weight.sum(1, keepdims=True)
    return _Reach(near, weight, fade.astype(np.float32))


def _mirrored(plane: ImagePlane) -> list[tuple[int, int]]:
    """Steps through rows and columns that turn one part of the sphere into all others like it:
    seen from a photo around the axis, left and right, top and bottom are alike."""
    downs = (1, -1) if plane.top == -plane.bottom else (1,)
    acrosses = (1, -1) if plane.right == -plane.left else (1,)
    return [(down, across) for down in downs for across in acrosses]


def _rays(plane: ImagePlane, rows: int, columns: int) -> Float[np.ndarray, "rows columns 3"]:
    """Directions of a photo's cells."""
    y = plane.top + (np.arange(rows) + 0.5) * ((plane.bottom - plane.top) / rows)
    x = plane.left + (np.arange(columns) + 0.5) * ((plane.right - plane.left) / columns)
    return normalised(np.stack([*np.meshgrid(x, y), np.full((rows, columns), -1.0)], -1))


def _ring(rows: int, columns: int) -> Bool[np.ndarray, "rows columns"]:
    """The outermost cells."""
    ring = np.ones((rows, columns), bool)
    ring[1:-1, 1:-1] = False
    return ring


@dataclass(frozen=True, eq=False)
class _Tile:
    """The part of `_spreading` for a few neighbouring texels, and the pixels that they mix."""

    rows: slice
    columns: slice
    pixels: Int[np.ndarray, " pixels"]
    kernel: Float32[np.ndarray, "texels pixels"]


@lru_cache(maxsize=2)
def _tiles(size: int) -> list[_Tile]:
    """The spreading for texels up and to the left: the others mirror it.

    By tiles, since a texel is mixed from the sixth of the ball that is near it.
    """
    whole = _spreading(size).reshape(_ROWS, 2 * _ROWS, -1)
    tiles = []
    for top in range(0, _ROWS // 2, _TILE[0]):
        for left in range(0, _ROWS, _TILE[1]):
            rows, columns = slice(top, top + _TILE[0]), slice(left, left + _TILE[1])
            kernel = whole[rows, columns].reshape(-1, size * size)
            counts = kernel > _LEAST_WEIGHT * kernel.max(1, keepdims=True)
            pixels = np.flatnonzero(counts.any(0))
            tiles.append(_Tile(rows, columns, pixels, np.ascontiguousarray(kernel[:, pixels])))
    return tiles


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
