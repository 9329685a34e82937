"""What the views saw, laid into one panorama at its own sharpness."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, UInt8

from deeplight.frames import turned
from deeplight.fuse.view import CLIPPED, View, cell_of, feather, inside

_SHARPNESS = 4
"""Power of the feather: near to the best view alone, yet without seams."""
_AGREES = 0.8  # an unclipped value may lie so far under what a clipped one says is the least
_REACH_PX = 2
_EDGE = 0.15  # feather at which a texel counts as wholly seen


@dataclass(frozen=True, eq=False)
class Seen:
    """The seen part of the sky.

    Attributes:
        radiance: linear, in the first view's unit; 0 where nothing was seen.
        share: how much each texel was seen, 0 to 1.
        clipped: share of the channels that clip in every view that saw them: there, radiance is a
            lower bound.
    """

    radiance: Float32[np.ndarray, "height width 3"]
    share: Float32[np.ndarray, "height width"]
    clipped: Float32[np.ndarray, "height width"]


def blended(
    views: Sequence[View],
    log_gain: Float[np.ndarray, "views 3"],
    trust: Float[np.ndarray, "views cells"],
    directions: Float32[np.ndarray, "height width 3"],
    at_once: int = 2**16,
) -> Seen:
    """Lay all views into a panorama whose texels look along `directions`, world.

    Where one view clips and another, exposed for less, shows at least as much, the other's value
    counts: differently exposed views give high dynamic range. A darker value contradicts the
    clipped one (a lamp that parallax moved, a person before it), and the better placed view wins.

    `at_once` is how many texels' samples, of all views, are in memory together.
    """
    shape, flat = directions.shape[:2], directions.reshape(-1, 3)
    scales = np.exp(-log_gain).astype(np.float32)
    bands = (flat[k : k + at_once] for k in range(0, len(flat), at_once))
    parts = [_band(views, scales, trust, band) for band in bands]
    radiance, share, clipped = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Seen(radiance.reshape(*shape, 3), share.reshape(shape), clipped.reshape(shape))


def _band(
    views: Sequence[View],
    scales: Float32[np.ndarray, "views 3"],
    trust: Float[np.ndarray, "views cells"],
    directions: Float32[np.ndarray, "n 3"],
) -> tuple[Float32[np.ndarray, "n 3"], Float32[np.ndarray, " n"], Float32[np.ndarray, " n"]]:
    """What `Seen` has, along some directions."""
    sampled = [_Sampled.of(view, directions) for view in views]
    shown = [k for k, one in enumerate(sampled) if one is not None]
    samples = [one for one in sampled if one is not None]
    scales, trust = scales[shown], trust[shown]
    share = np.zeros(len(directions), np.float32)
    bound, bound_weight = (np.zeros((len(directions), 3), np.float32) for _ in range(2))
    for k, one in enumerate(samples):
        one.values *= scales[k]
        share[one.at] = np.maximum(share[one.at], np.minimum(one.soft / _EDGE, 1))
        one.soft = one.soft**_SHARPNESS * trust[k][cell_of(directions[one.at])] + 1e-9
        clipped = np.where(one.clipped, one.values, 0)
        bound[one.at] = np.maximum(bound[one.at], clipped)
        bound_weight[one.at] += np.where(one.clipped, one.soft[:, None], 0)
    above, below = (_Mean(len(directions)) for _ in range(2))
    for one, scale in zip(samples, scales, strict=True):
        weight = np.where(one.clipped, 0, one.soft[:, None])
        agrees = one.nearby * scale > _AGREES * bound[one.at]
        above.add(one.at, one.values, weight * agrees)
        below.add(one.at, one.values, weight * ~agrees)
    radiance = np.where(below.weight > bound_weight, below.mean(), bound)
    radiance = np.where(above.weight > 0, above.mean(), radiance)
    clipped_all = (above.weight == 0) & (bound_weight >= below.weight) & (bound > 0)
    return radiance, share, clipped_all.mean(-1, dtype=np.float32)


class _Mean:
    """A weighted mean at places of a panorama."""

    def __init__(self, size: int) -> None:
        self.total, self.weight = (np.zeros((size, 3), np.float32) for _ in range(2))

    def add(self, at: np.ndarray, values: np.ndarray, weight: np.ndarray) -> None:
        self.total[at] += weight * values
        self.weight[at] += weight

    def mean(self) -> Float32[np.ndarray, "n 3"]:
        return self.total / np.maximum(self.weight, 1e-30)


@dataclass(eq=False)
class _Sampled:
    """What one view shows of the panorama: texels, radiance, clipping, trust.

    `nearby` is the most radiance within `_REACH_PX` pixels: what an edge or parallax may hide.
    """

    at: np.ndarray
    values: np.ndarray
    clipped: np.ndarray
    soft: np.ndarray
    nearby: np.ndarray

    @classmethod
    def of(cls, view: View, directions: np.ndarray) -> "_Sampled | None":
        """None if the view shows none of the directions."""
        at, own = _texels(view, directions)
        return cls(at, *_interpolated(view, own)) if len(at) else None


def _texels(view: View, directions: np.ndarray) -> tuple[np.ndarray, Float32[np.ndarray, "n 3"]]:
    """Indices of the texels that a view shows, and their directions in its camera."""
    reach = np.hypot(*view.camera.tangents)
    near = np.flatnonzero(directions @ view.towards.astype(np.float32) > 1 / np.hypot(1, reach))
    own = turned(directions[near], view.world_from_camera.T)
    shown = inside(view.camera, own)
    return near[shown], own[shown]


def _interpolated(
    view: View, directions: Float32[np.ndarray, "n 3"]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Radiance, clipping and feather at directions, interpolated, and radiance nearby."""
    camera = view.camera
    row, column = camera.pixel_of_directions(directions)
    row, column = row.clip(0, camera.height - 1.001), column.clip(0, camera.width - 1.001)
    top, left = row.astype(np.int32), column.astype(np.int32)
    down, right = (row - top).astype(np.float32), (column - left).astype(np.float32)
    down, right = down.clip(0, 1), right.clip(0, 1)
    index = top * camera.width + left
    radiance, pixels = view.radiance.reshape(-1, 3), view.pixels.reshape(-1, 3)
    soft = feather(camera).ravel()
    values = np.zeros((len(index), 3), np.float32)
    feathered = np.zeros(len(index), np.float32)
    brightest = np.zeros((len(index), 3), np.uint8)
    for offset, part in (
        (0, (1 - down) * (1 - right)),
        (1, (1 - down) * right),
        (camera.width, down * (1 - right)),
        (camera.width + 1, down * right),
    ):
        taps = np.minimum(index + offset, len(pixels) - 1)
        values += radiance[taps] * part[:, None]
        feathered += soft[taps] * part
        brightest = np.maximum(brightest, pixels[taps])
    nearby = view.linear(_greatest(view.pixels).reshape(-1, 3)[index])
    return values, brightest >= CLIPPED, feathered, nearby


def _greatest(pixels: UInt8[np.ndarray, "height width 3"]) -> UInt8[np.ndarray, "height width 3"]:
    """Each channel's greatest value within `_REACH_PX` rows and columns."""
    for axis in (0, 1):
        padded = np.pad(pixels, [(_REACH_PX * (a == axis),) * 2 for a in range(3)], "edge")
        size = pixels.shape[axis]
        parts = [padded.take(range(k, k + size), axis) for k in range(2 * _REACH_PX + 1)]
        pixels = np.maximum.reduce(parts)
    return pixels
