"""Several exposures of one view as one picture of linear radiance."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np
from jaxtyping import Float32, Float64, Shaped

from deeplight.bracket.exposures import Exposure
from deeplight.bracket.response import Response
from deeplight.errors import ConfigError

STILL_PX = 2
"""Frames that are off by no more lie on each other as well as a shutter's press allows."""
_CLEARLY = 0.7
_SHARED_PX = 400
_CLIPPED, _FADE = 0.985, 0.06
_DARK = 0.03

Grey = Float64[np.ndarray, "height width"]


@dataclass(frozen=True, eq=False)
class Merged:
    """Radiance for an exposure amount of 1, in the response's unit.

    Attributes:
        clipped: share of pixels that are white even in the shortest exposure: a lower bound.
        dark: share of pixels that are black even in the longest one.
    """

    radiance: Float32[np.ndarray, "height width 3"]
    clipped: float
    dark: float


def aligned(frames: Sequence[Exposure], shift: bool = False) -> list[Exposure]:
    """The frames, shifted by whole pixels onto the middle one if they may be.

    Raises:
        ConfigError: a frame is off by more than `STILL_PX` and may not be shifted.
    """
    offsets = [np.zeros(2, int)]
    for before, after in pairwise(frames):
        # Neighbouring exposures share the most; offsets add up along the bracket.
        offsets.append(offsets[-1] + np.array(offset_between(before, after)))
    offsets = [offset - offsets[len(frames) // 2] for offset in offsets]
    worst = max(range(len(frames)), key=lambda n: int(np.abs(offsets[n]).max()))
    if not shift and np.abs(offsets[worst]).max() > STILL_PX:
        x, y = offsets[worst]
        got = f"{frames[worst].path.name}, off by {abs(x)} x {abs(y)} pixels"
        raise ConfigError("frames that lie on each other", got, "use a tripod, or add --align")
    if not shift:
        return list(frames)
    return [
        replace(frame, pixels=_shifted(frame.pixels, int(offset[0]), int(offset[1])))
        for frame, offset in zip(frames, offsets, strict=True)
    ]


def offset_between(before: Exposure, after: Exposure) -> tuple[int, int]:
    """Pixels (right, down) that lay `after` onto `before`; 0 unless that clearly fits better.

    Phase correlation of the edges that both exposures show; logarithms make them alike. How well
    two frames fit is the correlation of their logarithms where neither is white or black.
    """
    one, other = (_log_grey(frame) for frame in (before, after))
    edges = [cv2.Laplacian(np.nan_to_num(log), cv2.CV_64F, ksize=5) for log in (one, other)]
    usable = np.isfinite(one) & np.isfinite(other)
    near_edge = cv2.dilate((~usable).astype(np.uint8), np.ones((7, 7), np.uint8)) > 0
    for edge in edges:
        edge[near_edge] = 0
    window = cv2.createHanningWindow(one.shape[::-1], cv2.CV_64F)
    (x, y), _ = cv2.phaseCorrelate(edges[1], edges[0], window)
    found = round(x), round(y)
    if not any(found) or max(map(abs, found)) > max(one.shape) // 4:
        return 0, 0
    moved = _shifted(other[..., None], *found)[..., 0]
    return found if _misfit(one, moved) < _CLEARLY * _misfit(one, other) else (0, 0)


def _misfit(one: Grey, other: Grey) -> float:
    """1 less the correlation, over what both show; 1 where they share too little."""
    usable = np.isfinite(one) & np.isfinite(other)
    if usable.sum() < _SHARED_PX:
        return 1.0
    return 1 - float(np.corrcoef(one[usable], other[usable])[0, 1])


def merged(frames: Sequence[Exposure], response: Response) -> Merged:
    """Weighted mean over the exposures of linear value over exposure amount.

    A value weighs as much as the light behind it, not at all near white in any channel and little
    near black. What is white in all keeps the shortest exposure's value, a lower bound.
    """
    total = np.zeros(frames[0].pixels.shape, np.float32)
    weights = np.zeros(frames[0].pixels.shape[:2], np.float32)
    for frame in frames:
        linear = frame.pixels if frame.linear else response.linear(frame.pixels)
        weight = (_trust(frame) * frame.amount).astype(np.float32)
        total += weight[..., None] * linear / np.float32(frame.amount)
        weights += weight
    shortest, longest = frames[0], frames[-1]
    bound = shortest.pixels if shortest.linear else response.linear(shortest.pixels)
    clipped = weights <= 0
    radiance = total / np.maximum(weights, 1e-30)[..., None]
    radiance[clipped] = bound[clipped] / np.float32(shortest.amount)
    dark_everywhere = (longest.pixels.max(-1) < 0.01).mean()
    return Merged(radiance.astype(np.float32), float(clipped.mean()), float(dark_everywhere))


def _trust(frame: Exposure) -> Float32[np.ndarray, "height width"]:
    """0 where a pixel is white, little where it is black, else 1.

    A linear file clips at its own maximum, if many pixels share that.
    """
    shown = frame.pixels.max(-1)
    if not frame.linear:
        dark = np.clip(frame.pixels.mean(-1) / _DARK, 1e-3, 1)
        return np.asarray(np.clip((_CLIPPED - shown) / _FADE, 0, 1) * dark, np.float32)
    top = float(shown.max())
    saturates = (shown >= top * 0.999).mean() > 1e-4
    white = top if saturates else np.inf
    return np.asarray(np.where(shown < 0.98 * white, 1, 0), np.float32)


def _log_grey(frame: Exposure) -> Grey:
    """ln of the grey value; NaN where it is too dark or too bright to say."""
    grey = frame.pixels.mean(-1)
    if frame.linear:
        grey = np.sqrt(grey / max(float(grey.max()), 1e-9))
    usable = (grey > 0.06) & (frame.pixels.max(-1) < (np.inf if frame.linear else 0.94))
    return np.where(usable, np.log(np.maximum(grey, 1e-3)), np.nan).astype(np.float64)


def _shifted(
    pixels: Shaped[np.ndarray, "height width channels"], right: int, down: int
) -> Shaped[np.ndarray, "height width channels"]:
    """Moved by whole pixels; the border repeats."""
    height, width, _ = pixels.shape
    rows = np.clip(np.arange(height) - down, 0, height - 1)
    columns = np.clip(np.arange(width) - right, 0, width - 1)
    return np.ascontiguousarray(pixels[rows][:, columns])
