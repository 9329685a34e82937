"""The photo's own pixels on the sphere: what the camera saw is known, not estimated."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Self

import numpy as np
from jaxtyping import Float, Float32, Int, UInt8

from deeplight.area_means import mean_over_squares
from deeplight.camera import PinholeCamera
from deeplight.camera_response import CameraResponse
from deeplight.mappings import resample

CLIPPED = 251 / 255
"""From this pixel value on a channel may be clipped: compression moves white by a few levels."""
MOST_SHOWN = 1.05
"""Radiance that a clipped pixel is taken for before more is known: just over white."""
FEATHER = 0.03
"""Width of the photo's soft edge, as part of half its shorter side; at least 1.5 texels."""
_PIXELS_PER_TEXEL = 2  # along a side: a finer photo is averaged first, still gamma-encoded
_SAMPLES = 2  # along a side of a texel
_KEPT_UP_TO = 512  # rows: what is kept of larger latlongs would be tens of megabytes
_RESPONSE = CameraResponse()


Taps = tuple[Int[np.ndarray, "4 *batch"], Float32[np.ndarray, "4 *batch"]]
"""Pixels of a picture by their indices, and their weights."""


@dataclass(frozen=True)
class ImagePlane:
    """The rectangle that a photo fills on the plane at distance 1 before the camera, from its axis.

    Attributes:
        left, right, bottom, top: tangents, right and up positive.
    """

    left: float
    right: float
    bottom: float
    top: float

    @classmethod
    def centred(cls, height: int, width: int, vertical_fov_rad: float) -> Self:
        """Of a whole photo, whose middle the optical axis passes through."""
        half_width, half_height = PinholeCamera(width, height, vertical_fov_rad).tangents
        return cls(-half_width, half_width, -half_height, half_height)

    @property
    def shorter(self) -> float:
        """The shorter of width and height."""
        return min(self.right - self.left, self.top - self.bottom)


@dataclass(frozen=True, eq=False)
class ProjectedPhoto:
    """A photo on a latlong: linear radiance where the camera looked, 0 elsewhere.

    Attributes:
        radiance: relative to the camera's white; clipped pixels have at most `MOST_SHOWN`.
        seen: 1 where the photo shows the texel, falling to 0 at the photo's edge and outside.
        clipped: part of the texel, 0 to 1, where each channel may be clipped.
        pixels: the photo as it was looked up, averaged if it is much finer; [0, 1].
    """

    radiance: Float32[np.ndarray, "height width 3"]
    seen: Float32[np.ndarray, "height width"]
    clipped: Float32[np.ndarray, "height width 3"]
    pixels: Float32[np.ndarray, "rows columns 3"]

    @cached_property
    def box(self) -> tuple[slice, slice]:
        """The rows and columns that the photo shows anything of."""
        rows, columns = np.flatnonzero(self.seen.any(1)), np.flatnonzero(self.seen.any(0))
        if not len(rows):
            return slice(0), slice(0)
        return slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)

    @cached_property
    def seen_in_64_rows(self) -> Float32[np.ndarray, "64 128"]:
        """How much is seen of each of fewer texels."""
        height = len(self.seen)
        if height % 64:
            return resample.shrink(self.seen[..., None], 64, 128)[..., 0]
        step = height // 64
        # Sums of strided parts: numpy's mean along a few numbers takes ten times as long.
        rows = np.sum([self.seen[start::step] for start in range(step)], axis=0)
        result: np.ndarray = np.sum([rows[:, start::step] for start in range(step)], axis=0)
        return result / np.float32(step**2)


def project_photo(
    pixels: UInt8[np.ndarray, "rows columns 3"], plane: ImagePlane, height: int
) -> ProjectedPhoto:
    """Resample a photo to a latlong of `height` rows, each texel the mean of what it covers.

    Args:
        pixels: upright, gamma-encoded.
        plane: where they lie.
        height: rows of the latlong.
    """
    encoded = _reduced(pixels, plane, height)
    linear = np.minimum(_RESPONSE.radiance_from_pixel(encoded), MOST_SHOWN)
    clipped = (encoded >= CLIPPED).astype(np.float32)
    found = _kept_samples if height <= _KEPT_UP_TO else _samples
    samples = found(plane, height, encoded.shape[:2])
    parts = np.zeros((2, height, 2 * height, 3), np.float32)
    parts[0].reshape(-1, 3)[samples.texels] = samples.means(linear)
    if clipped.any():
        parts[1].reshape(-1, 3)[samples.texels] = samples.means(clipped)
    seen = np.zeros((height, 2 * height), np.float32)
    seen.ravel()[samples.texels] = samples.seen
    return ProjectedPhoto(parts[0], seen, parts[1], encoded)


@dataclass(frozen=True, eq=False)
class _Samples:
    """Where the texels that a photo may touch lie in it.

    Attributes:
        texels: their indices.
        taps: of the four pixels around each sample, their indices and their part of the texel's
            mean over the samples that lie inside the photo.
        seen: as of `ProjectedPhoto`.
    """

    texels: Int[np.ndarray, " texels"]
    taps: tuple[Int[np.ndarray, "taps texels"], Float32[np.ndarray, "taps texels"]]
    seen: Float32[np.ndarray, " texels"]

    def means(
        self, values: Float32[np.ndarray, "photo_rows photo_columns 3"]
    ) -> Float32[np.ndarray, "texels 3"]:
        """The mean over each texel."""
        at, weight = self.taps
        found = np.empty((len(self.texels), 3), np.float32)
        for channel in range(3):
            flat = np.ascontiguousarray(values[..., channel]).ravel()
            found[:, channel] = np.einsum("tk,tk->k", flat.take(at), weight)
        return found


def _samples(plane: ImagePlane, height: int, photo_size: tuple[int, int]) -> _Samples:
    """Find the samples of a photo of `photo_size` pixels in a latlong of `height` rows."""
    rows, columns = _touched(plane, height)
    x, y = (part.T.astype(np.float32) for part in _plane_positions(rows, columns, height))
    to_side = np.minimum(x - plane.left, plane.right - x)
    to_end = np.minimum(y - plane.bottom, plane.top - y)
    inside = ((to_side >= 0) & (to_end >= 0)).astype(np.float32)
    across = (x - plane.left) / (plane.right - plane.left)
    down = (plane.top - y) / (plane.top - plane.bottom)
    share = inside / np.maximum(inside.sum(0), 1)
    at, weight = _bilinear(across, down, photo_size)
    taps = at.reshape(-1, len(rows)), (weight * share).reshape(-1, len(rows))
    edge = max(FEATHER * plane.shorter / 2, 1.5 * np.pi / height)
    soft = smoothstep(to_side / edge) * smoothstep(to_end / edge)
    return _Samples(rows * 2 * height + columns, taps, soft.mean(0))


_kept_samples = lru_cache(maxsize=4)(_samples)  # the next photo is often the same camera's


def _reduced(
    pixels: UInt8[np.ndarray, "rows columns 3"], plane: ImagePlane, height: int
) -> Float32[np.ndarray, "new_rows new_columns 3"]:
    """The photo in [0, 1], averaged to some two pixels along a texel if it is much finer."""
    focal = pixels.shape[0] / (plane.top - plane.bottom)
    factor = focal * np.pi / height / _PIXELS_PER_TEXEL
    if factor < 1.5:
        return pixels.astype(np.float32) / np.float32(255)
    return mean_over_squares(pixels, factor)


def _touched(plane: ImagePlane, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows and columns of the texels that the photo may touch, and a few around it."""
    texel = np.pi / height
    phi = (np.arange(2 * height) + 0.5) * texel - np.pi
    low, high = np.arctan(plane.left) - texel, np.arctan(plane.right) + texel
    columns = np.flatnonzero((phi > low) & (phi < high))
    # On the plane a direction lies at (tan phi, cot theta / cos phi): the photo's horizontal
    # edges are highest where the cosine is largest.
    elevation = np.pi / 2 - (np.arange(height) + 0.5) * texel
    cosine = np.cos(phi[columns])
    wide = np.minimum(np.cos(np.abs(phi[columns]) - texel), 1)
    up = np.arctan(plane.top * np.where(plane.top > 0, wide, cosine)) + texel
    low_edge = np.arctan(plane.bottom * np.where(plane.bottom < 0, wide, cosine)) - texel
    touched = (elevation[:, None] < up) & (elevation[:, None] > low_edge)
    rows, chosen = np.nonzero(touched)
    return rows, columns[chosen]


def _plane_positions(
    rows: np.ndarray, columns: np.ndarray, height: int
) -> tuple[np.ndarray, np.ndarray]:
    """Right and up on the image plane at distance 1, of samples within each texel."""
    texel = np.pi / height
    steps = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    down, along = (grid.ravel() for grid in np.meshgrid(steps, steps, indexing="ij"))
    # The tangent and the cosine are a column's, the cotangent is a row's: a few hundred of each.
    phi = (np.arange(2 * height)[:, None] + along) * texel - np.pi
    front = np.cos(phi)
    ahead = front > 1e-6
    longer = np.divide(1.0, front, out=np.full_like(front, np.inf), where=ahead)
    tangent = np.where(ahead, np.tan(phi), np.inf)
    cotangent = 1 / np.tan((np.arange(height)[:, None] + down) * texel)
    return tangent[columns], cotangent[rows] * longer[columns]


def _bilinear(
    across: Float32[np.ndarray, "*batch"],
    down: Float32[np.ndarray, "*batch"],
    size: tuple[int, int],
) -> Taps:
    """Indices and weights of the four pixels around positions 0 to 1 from the upper left of a
    picture; outside, the edge goes on."""
    height, width = size
    column = np.clip(across * width - 0.5, 0, width - 1)
    row = np.clip(down * height - 0.5, 0, height - 1)
    left = np.minimum(column.astype(np.intp), width - 2)
    top = np.minimum(row.astype(np.intp), height - 2)
    right_part = (column - left).astype(np.float32)
    low_part = (row - top).astype(np.float32)
    first = top * width + left
    at = np.stack([first, first + 1, first + width, first + width + 1])
    upper, lower = 1 - low_part, low_part
    left_part = 1 - right_part
    weights = [left_part * upper, right_part * upper, left_part * lower, right_part * lower]
    return at, np.stack(weights)


def smoothstep(t: np.ndarray) -> np.ndarray:
    t = np.clip(t, 0, 1)
    result: np.ndarray = t * t * (3 - 2 * t)
    return result


def brightest(values: Float[np.ndarray, "*shape 3"]) -> Float[np.ndarray, "*shape"]:
    """The largest of the three channels; numpy's own `max(-1)` takes twenty times as long."""
    result: np.ndarray = np.maximum(np.maximum(values[..., 0], values[..., 1]), values[..., 2])
    return result
