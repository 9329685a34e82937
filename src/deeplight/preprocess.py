"""Photo to network input: the one definition used by data set, training, runtime and web demo.

The network was trained on one camera: a portrait 9:16 frame with a vertical field of view of 66
degrees, of which it sees the upper 80 % (`ModelContract` holds these numbers). A photo of any size,
aspect and field of view is brought to that view: on the image plane at distance 1 it is the
rectangle from +tan 33 down to -0.6 tan 33 and 9/16 tan 33 to either side, around the photo's
centre. Each of the 135 x 192 cells is the exact area average of the photo's pixels under it, in
the photo's own gamma-encoded values. Where the photo does not reach, its edge pixels go on.

A 4:3 photo lying on its side reaches 27 degrees up and down: that view would overhang it above and
leave its lowest rows out. `slid_into_photo` slides the view down along the image plane until it
does neither; `estimators.look` turns the light back.
"""

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal, get_args

import numpy as np
from jaxtyping import Float, Float32, Int, Shaped, UInt8

from deeplight.camera import (
    BACKGROUND_HEIGHT,
    BACKGROUND_WIDTH,
    TRAINED_VERTICAL_FOV_RAD,
    PinholeCamera,
)
from deeplight.contract import ModelContract
from deeplight.errors import ShapeError

FovSource = Literal["given", "exif", "assumed"]

ASSUMED_LONG_SIDE_FOV_RAD = TRAINED_VERTICAL_FOV_RAD
"""Field of view of the photo's long side when nothing states it: a phone's main camera."""
FITS = 1.07
"""Of the photo's height: up to this a view has room in it. Higher ones gain nothing by sliding, on
validation places (`lab/evidence/photo_formats.py`)."""
LEAST_SLIDE = 1e-6
"""Of the photo's height: less is rounding."""
_SHORT = 6  # whole pixels in an interval: to this number taking all intervals at once is faster


@dataclass(frozen=True)
class Framing:
    """Where the trained camera's view lies in one photo.

    The edges are in pixels of the upright photo, from its upper left corner; pixel (row, column)
    covers [row, row + 1] x [column, column + 1]. They may lie outside the photo.
    """

    photo_height: int
    photo_width: int
    top: float
    bottom: float
    left: float
    right: float
    vertical_fov_rad: float  # of the whole photo, as used
    fov_source: FovSource
    input_height: int = BACKGROUND_HEIGHT
    input_width: int = BACKGROUND_WIDTH
    down: float = 0.0  # pixels by which the view was slid below the photo's centre

    @property
    def pitch_rad(self) -> float:
        """How far up the view looks from the photo's optical axis; negative where it was slid."""
        focal = self.photo_height / 2 / math.tan(self.vertical_fov_rad / 2)  # in pixels
        return -math.atan(self.down / focal)

    @property
    def camera(self) -> PinholeCamera:
        """Of the whole photo."""
        return PinholeCamera(self.photo_width, self.photo_height, self.vertical_fov_rad)

    @property
    def visible_fraction(self) -> float:
        """Part of the trained view that the photo shows, by image area; 1.0 is all of it."""
        rows = min(self.bottom, self.photo_height) - max(self.top, 0.0)
        columns = min(self.right, self.photo_width) - max(self.left, 0.0)
        whole = (self.bottom - self.top) * (self.right - self.left)
        return min(rows * columns / whole, 1.0)

    @property
    def used_fraction(self) -> float:
        """Part of the photo that the network sees, by area; the rest was cropped away."""
        whole = (self.bottom - self.top) * (self.right - self.left)
        return min(self.visible_fraction * whole / (self.photo_height * self.photo_width), 1.0)


def frame_photo(
    height: int,
    width: int,
    vertical_fov_rad: float | None = None,
    fov_source: FovSource = "given",
    contract: ModelContract | None = None,
) -> Framing:
    """Find the trained camera's view in an upright photo of `height` x `width` square pixels.

    The optical axis is taken to pass through the photo's centre. Without a field of view the long
    side is assumed to span 66 degrees, whatever `fov_source` says.

    Raises:
        ShapeError: the field of view is not inside (0, pi).
    """
    contract = contract or ModelContract()
    if fov_source not in get_args(FovSource):
        raise ShapeError(f"a source out of {get_args(FovSource)}", repr(fov_source), "name one")
    if vertical_fov_rad is None:
        focal = max(height, width) / 2 / math.tan(ASSUMED_LONG_SIDE_FOV_RAD / 2)  # in pixels
        vertical_fov_rad, fov_source = 2 * math.atan(height / 2 / focal), "assumed"
    elif 0 < vertical_fov_rad < math.pi:
        focal = height / 2 / math.tan(vertical_fov_rad / 2)
    else:
        got = f"{math.degrees(vertical_fov_rad):g}"
        raise ShapeError("a field of view between 0 and 180 degrees", got, "correct it")
    return Framing(
        photo_height=height,
        photo_width=width,
        top=height / 2 - focal * contract.top,
        bottom=height / 2 - focal * contract.bottom,
        left=width / 2 - focal * contract.right,
        right=width / 2 + focal * contract.right,
        vertical_fov_rad=vertical_fov_rad,
        fov_source=fov_source,
        input_height=contract.height,
        input_width=contract.width,
    )


def slid_into_photo(framing: Framing) -> Framing:
    """Slide the view down into a photo that is tall enough for it; other photos keep theirs."""
    height = framing.photo_height
    down = min(-framing.top, height - framing.bottom)
    if down < LEAST_SLIDE * height or framing.bottom - framing.top > FITS * height:
        return framing
    top, bottom = framing.top + down, framing.bottom + down
    return replace(framing, top=top, bottom=bottom, down=framing.down + down)


def network_input(
    photo: Shaped[np.ndarray, "height width 3"], framing: Framing
) -> Float32[np.ndarray, "3 input_height input_width"]:
    """Average the photo over the cells of `framing` and bring it to [-0.5, 0.5].

    Args:
        photo: upright, RGB, gamma-encoded: uint8, uint16 or float in [0, 1].

    Raises:
        ShapeError: the photo's size is not that of `framing`, or its type or range is another.
    """
    cells: np.ndarray = _cell_means(photo, framing) - np.float32(0.5)
    return np.ascontiguousarray(cells.transpose(2, 0, 1))


def background(
    photo: Shaped[np.ndarray, "height width 3"], framing: Framing
) -> UInt8[np.ndarray, "input_height input_width 3"]:
    """Give the same cells as `network_input`, rounded to 8 bits: what the data set stores."""
    levels: np.ndarray = np.floor(_cell_means(photo, framing) * np.float32(255) + np.float32(0.5))
    return levels.astype(np.uint8)


def landscape_background(
    stored: UInt8[np.ndarray, "height width 3"],
) -> UInt8[np.ndarray, "input_height input_width 3"]:
    """Give the landscape network's view of a stored portrait background: its middle, enlarged.

    Section 4.3. A photo of full size brought to the landscape contract has more detail: here 135
    pixels are spread over 192.
    """
    height, width, _ = stored.shape
    portrait, landscape = ModelContract(), ModelContract.landscape()
    rows = height / (portrait.background_fraction - portrait.background_top)  # of the full frame
    framing = Framing(
        photo_height=height,
        photo_width=width,
        top=rows * (landscape.background_top - portrait.background_top),
        bottom=rows * (landscape.background_fraction - portrait.background_top),
        left=0.0,
        right=float(width),
        vertical_fov_rad=math.atan(portrait.top) - math.atan(portrait.bottom),
        fov_source="given",
        input_height=landscape.height,
        input_width=landscape.width,
    )
    return background(stored, framing)


def normalise(
    backgrounds: UInt8[np.ndarray, "*batch height width 3"],
) -> Float32[np.ndarray, "*batch 3 height width"]:
    """Bring stored backgrounds, one or a batch, to the network's layout and [-0.5, 0.5]."""
    scaled = backgrounds.astype(np.float32) / np.float32(255) - np.float32(0.5)
    return np.ascontiguousarray(np.moveaxis(scaled, -1, -3))


def _cell_means(
    photo: Shaped[np.ndarray, "height width 3"], framing: Framing
) -> Float32[np.ndarray, "input_height input_width 3"]:
    """Average the photo over the cells of `framing`; values in [0, 1]."""
    expected = (framing.photo_height, framing.photo_width, 3)
    if photo.shape != expected:
        raise ShapeError(f"a photo of shape {expected}", f"{photo.shape}", "frame this photo first")
    row_edges = np.linspace(framing.top, framing.bottom, framing.input_height + 1)
    column_edges = np.linspace(framing.left, framing.right, framing.input_width + 1)
    return mean_over_cells(photo, row_edges, column_edges)


def mean_over_cells(
    photo: Shaped[np.ndarray, "height width 3"],
    row_edges: Float[np.ndarray, " rows_plus_1"],
    column_edges: Float[np.ndarray, " columns_plus_1"],
) -> Float32[np.ndarray, "rows columns 3"]:
    """Average a photo over the cells between edges in pixels, exactly; values in [0, 1].

    Edges may lie between pixels and outside the photo, whose border pixels then go on.

    Args:
        photo: upright, RGB, gamma-encoded: uint8, uint16 or float in [0, 1].

    Raises:
        ShapeError: the photo's type or range is another.
    """
    cells = _averages_in_memory_order(photo, row_edges, column_edges)
    cells /= np.float32(_white(photo.dtype))
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


def _averages_in_memory_order(
    photo: Shaped[np.ndarray, "height width 3"],
    row_edges: Float[np.ndarray, " rows"],
    column_edges: Float[np.ndarray, " columns"],
) -> Float32[np.ndarray, "cell_rows cell_columns 3"]:
    """Average over both axes, walking the pixels as they lie in memory.

    A photo turned upright by its EXIF orientation is a view with swapped or negative strides.
    Reading that view row by row is ten times slower, so it is the small result that gets turned.
    """
    if abs(photo.strides[0]) < abs(photo.strides[1]):
        turned = _averages_in_memory_order(photo.transpose(1, 0, 2), column_edges, row_edges)
        return turned.transpose(1, 0, 2)
    if photo.strides[0] < 0:
        flipped_edges = len(photo) - row_edges[::-1]
        return _averages_in_memory_order(photo[::-1], flipped_edges, column_edges)[::-1]
    if photo.strides[1] < 0:
        mirrored_edges = photo.shape[1] - column_edges[::-1]
        return _averages_in_memory_order(photo[:, ::-1], row_edges, mirrored_edges)[:, ::-1]
    first = int(np.clip(np.floor(column_edges[0]), 0, photo.shape[1] - 1))
    last = int(np.clip(np.ceil(column_edges[-1]), first + 1, photo.shape[1]))
    strips = _row_means(photo[:, first:last], row_edges)
    return _column_means(strips, column_edges - first)


# Both means below are over the intervals between consecutive edges, which may lie anywhere. With
# F(t) the integral of the pixels from 0 to t, an interval's mean is (F(b) - F(a)) / (b - a), and
# F(t) is the sum of the whole pixels before t plus a fraction of the next. Clipping the whole part
# of t but not its fraction continues the first and the last pixel for ever.


def _row_means(
    pixels: Shaped[np.ndarray, "height width 3"], edges: Float[np.ndarray, " rows_plus_1"]
) -> Float32[np.ndarray, "rows width 3"]:
    """Average over intervals of the first axis.

    Whole pixels are summed in integers, so a box filter by a whole factor is exact.
    """
    whole, fraction = _split(edges, len(pixels))
    if int(np.diff(whole).max()) <= _SHORT:
        means = _short_sums(pixels, whole)
    else:  # this loop is twenty times faster than `np.add.reduceat` along this axis
        sum_type = _sum_type(pixels.dtype, int(np.diff(whole).max()))
        means = np.empty((len(edges) - 1, *pixels.shape[1:]), np.float32)
        for row, (first, last) in enumerate(pairwise(whole)):
            means[row] = pixels[first:last].sum(axis=0, dtype=sum_type)
    part = pixels[whole] * fraction[:, None, None]
    means += part[1:]
    means -= part[:-1]
    means /= np.diff(edges).astype(np.float32)[:, None, None]
    return means


def _column_means(
    pixels: Float32[np.ndarray, "height width 3"], edges: Float[np.ndarray, " columns_plus_1"]
) -> Float32[np.ndarray, "height columns 3"]:
    """Average over intervals of the second axis; along it reduceat is fast."""
    whole, fraction = _split(edges, pixels.shape[1])
    if int(np.diff(whole).max()) <= _SHORT:
        # Turned, so that what is added lies in one piece.
        lines = np.ascontiguousarray(pixels.swapaxes(0, 1))
        means = _short_sums(lines, whole).swapaxes(0, 1)
    else:
        means = np.add.reduceat(pixels, whole, axis=1)[:, :-1]
        means[:, np.diff(whole) == 0] = 0  # for an empty interval reduceat gives its first pixel
    means += np.diff(pixels[:, whole] * fraction[:, None], axis=1)
    means /= np.diff(edges).astype(np.float32)[:, None]
    return means


def _short_sums(
    pixels: Shaped[np.ndarray, "height width 3"], whole: Int[np.ndarray, " edges"]
) -> Float32[np.ndarray, "rows width 3"]:
    """Sum the whole rows of each interval: all first ones at once, then all second ones."""
    first, span = whole[:-1], np.diff(whole)
    if pixels.dtype == np.uint8:
        return _short_sums_of_bytes(pixels, first, span)
    sums = np.zeros((len(first), *pixels.shape[1:]), _sum_type(pixels.dtype, int(span.max())))
    for turn in range(int(span.max())):
        chosen = np.flatnonzero(span > turn)
        if len(chosen) == len(first):
            sums += pixels[first + turn]
        else:
            sums[chosen] += pixels[first[chosen] + turn]
    return sums.astype(np.float32)


def _short_sums_of_bytes(
    pixels: UInt8[np.ndarray, "height width 3"],
    first: Int[np.ndarray, " rows"],
    span: Int[np.ndarray, " rows"],
) -> Float32[np.ndarray, "rows width 3"]:
    """Sum intervals of rows by words of two bytes, each byte apart: adding bytes to numbers of
    another type takes numpy six times as long."""
    _, width, channels = pixels.shape
    if width % 2:  # one column more, so that a row is whole words
        return _short_sums_of_bytes(np.pad(pixels, ((0, 0), (0, 1), (0, 0))), first, span)[:, :-1]
    sums = np.zeros((2, len(first), width * channels // 2), np.uint16)
    for turn in range(int(span.max())):
        at = np.minimum(first + turn, len(pixels) - 1)
        # An index, since `take` would first copy a view whole.
        taken = pixels[at].reshape(len(first), -1).view("<u2")
        if (span <= turn).any():
            taken[span <= turn] = 0
        sums[0] += taken & 255
        sums[1] += taken >> 8
    result = np.empty((*sums.shape[1:], 2), np.float32)
    result[..., 0], result[..., 1] = sums
    return result.reshape(len(first), width, channels)


def _split(
    edges: Float[np.ndarray, " edges"], length: int
) -> tuple[Int[np.ndarray, " edges"], Float32[np.ndarray, " edges"]]:
    """Split each edge into a pixel of the picture and the rest, which may point outside."""
    whole = np.clip(np.floor(edges), 0, length - 1).astype(np.intp)
    return whole, (edges - whole).astype(np.float32)


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
