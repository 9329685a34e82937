"""Exact averages of a photo's pixels over cells between any edges, however they lie in memory.

With F(t) the integral of a line's pixels from 0 to t, their mean between a and b is
(F(b) - F(a)) / (b - a), and F(t) is the sum of the whole pixels before t plus a fraction of the
next. Clipping the whole part of t but not its fraction continues the first and last pixel for ever.
"""

from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from jaxtyping import Float, Float32, Int, Shaped

from deeplight.banded import Bands, bands, together
from deeplight.errors import ShapeError

_SHORT = 8  # whole pixels in an interval: of more, adding line by line is faster
_TOGETHER = 5  # intervals of a band at most: more are mostly zeros


def mean_over_cells(
    photo: Shaped[np.ndarray, "height width 3"],
    row_edges: Float[np.ndarray, " rows_plus_1"],
    column_edges: Float[np.ndarray, " columns_plus_1"],
) -> Float32[np.ndarray, "rows columns 3"]:
    """Average a photo over the cells between edges in pixels, exactly; values in [0, 1].

    Edges may lie between pixels and outside the photo, whose border pixels then go on.

    Args:
        photo: upright, RGB, gamma-encoded: uint8, uint16 or float in [0, 1].
        row_edges: from the upper end, rising.
        column_edges: from the left end, rising.

    Raises:
        ShapeError: the photo's type or range is another.
    """
    cells = _sums_in_memory_order(photo, row_edges, column_edges)
    # Divided once and last, so that a box filter by a whole factor is exact.
    widths = np.diff(column_edges).repeat(cells.shape[2])
    area = np.outer(np.diff(row_edges) * _white(photo.dtype), widths).astype(np.float32)
    cells = cells / area.reshape(cells.shape)
    if not (cells.min() > -1e-3 and cells.max() < 1 + 1e-3):  # false for nan as well
        raise ShapeError("a float photo within [0, 1]", "values outside it", "encode it first")
    return cells.clip(0, 1)  # rounding may leave it by an ulp


def mean_over_squares(
    photo: Shaped[np.ndarray, "height width 3"], side: float, at_least: int = 2
) -> Float32[np.ndarray, "rows columns 3"]:
    """Average a whole photo over nearly square cells of about `side` pixels; values in [0, 1].

    Args:
        photo: as for `mean_over_cells`.
        side: of a cell.
        at_least: number of cells along each side of the photo.
    """
    counts = ((length, max(at_least, round(length / side))) for length in photo.shape[:2])
    return mean_over_cells(photo, *(np.linspace(0, n, count + 1) for n, count in counts))


def _sums_in_memory_order(
    photo: Shaped[np.ndarray, "height width 3"],
    row_edges: Float[np.ndarray, " rows"],
    column_edges: Float[np.ndarray, " columns"],
) -> Float32[np.ndarray, "cell_rows cell_columns 3"]:
    """Sum over both axes, walking the pixels as they lie in memory.

    A photo turned upright by its EXIF orientation is a view with swapped or negative strides.
    Reading that view row by row is ten times slower, so it is the small result that gets turned.
    """
    if abs(photo.strides[0]) < abs(photo.strides[1]):
        turned = _sums_in_memory_order(photo.transpose(1, 0, 2), column_edges, row_edges)
        return turned.transpose(1, 0, 2)
    if photo.strides[0] < 0:
        flipped_edges = len(photo) - row_edges[::-1]
        return _sums_in_memory_order(photo[::-1], flipped_edges, column_edges)[::-1]
    if photo.strides[1] < 0:
        mirrored_edges = photo.shape[1] - column_edges[::-1]
        return _sums_in_memory_order(photo[:, ::-1], row_edges, mirrored_edges)[:, ::-1]
    first = int(np.clip(np.floor(column_edges[0]), 0, photo.shape[1] - 1))
    last = int(np.clip(np.ceil(column_edges[-1]), first + 1, photo.shape[1]))
    strips = _row_sums(photo[:, first:last], row_edges)
    return _column_sums(strips, column_edges - first)


def _row_sums(
    pixels: Shaped[np.ndarray, "height width 3"], edges: Float[np.ndarray, " rows_plus_1"]
) -> Float32[np.ndarray, "rows width 3"]:
    """Sum over intervals of the first axis."""
    height, width, channels = pixels.shape
    whole, fraction = _split(edges, height)
    longest = int(np.diff(whole).max())
    if longest <= _SHORT:
        several = together(longest + 1, width * channels, _TOGETHER)
        return _bands(edges.tobytes(), height, several).across_lines(pixels)
    sum_type = _sum_type(pixels.dtype, longest)
    sums = np.empty((len(edges) - 1, width, channels), np.float32)
    # This loop is twenty times faster than `np.add.reduceat` along this axis.
    for row, (top, end) in enumerate(pairwise(whole)):
        sums[row] = pixels[top:end].sum(axis=0, dtype=sum_type)
    part = pixels[whole] * fraction[:, None, None].astype(np.float32)
    sums += part[1:]
    sums -= part[:-1]
    return sums


def _column_sums(
    pixels: Float32[np.ndarray, "height width 3"], edges: Float[np.ndarray, " columns_plus_1"]
) -> Float32[np.ndarray, "height columns 3"]:
    """Sum over intervals of the second axis."""
    height, width, channels = pixels.shape
    longest = int(np.diff(_split(edges, width)[0]).max())
    several = together(longest + 1, height * channels**2, _TOGETHER)
    mixing = _bands(edges.tobytes(), width, several, channels)
    sums = mixing.along_lines(pixels.reshape(height, -1))
    return sums.reshape(height, -1, channels)


@lru_cache(maxsize=16)  # the next photo is often as large
def _bands(edges: bytes, length: int, several: int, channels: int = 1) -> Bands:
    """What sums `length` pixels over the intervals between edges (float64)."""
    whole, fraction = _split(np.frombuffer(edges), length)

    def integral(pixel: np.ndarray, edge: np.ndarray) -> np.ndarray:
        return np.where(pixel == whole[edge], fraction[edge], pixel < whole[edge])

    def weight(pixel: np.ndarray, interval: np.ndarray) -> np.ndarray:
        result: np.ndarray = integral(pixel, interval + 1) - integral(pixel, interval)
        return result

    mixing = bands(whole[:-1], whole[1:], length, weight, several)
    return mixing if channels == 1 else mixing.for_channels(channels)


def _split(
    edges: Float[np.ndarray, " edges"], length: int
) -> tuple[Int[np.ndarray, " edges"], Float[np.ndarray, " edges"]]:
    """Split each edge into a pixel of the picture and the rest, which may point outside."""
    whole = np.clip(np.floor(edges), 0, length - 1).astype(np.intp)
    return whole, edges - whole


def _sum_type(pixel_type: np.dtype[Any], count: int) -> type[np.generic]:
    """Give the narrowest type that holds the sum of `count` pixels: narrow is far faster."""
    if pixel_type == np.uint8:
        return np.uint16 if count * 255 <= 65535 else np.uint32
    return np.uint64 if pixel_type == np.uint16 else np.float32


def _white(pixel_type: np.dtype[Any]) -> float:
    """Give the pixel value that stands for white."""
    if pixel_type == np.uint8 or pixel_type == np.uint16:
        return float(np.iinfo(pixel_type).max)
    if np.issubdtype(pixel_type, np.floating):
        return 1.0
    got = f"{pixel_type}"
    raise ShapeError("a photo of type uint8, uint16 or float in [0, 1]", got, "convert it first")
