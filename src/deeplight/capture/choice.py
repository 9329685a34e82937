"""Which frames of a clip become examples; every frame left out has one cause."""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8

from deeplight.capture.quality import QualityLog, Samples, measured
from deeplight.errors import ConfigError
from deeplight.io.video import VideoFrame

CAUSES = ("duplicated", "badly_exposed", "exposure_jump", "blurred", "near_duplicate")
KEEP = ""

_FROZEN = 0.12  # grey levels: a camera that films gives more, by its noise alone
_FROZEN_SHARE = 0.05  # of the clip's median change: a repeated picture, coded once more
_ALIKE_SIDE = 48  # pixels of the shorter side where two views are compared
_NEIGHBOURS = 31  # frames among which a blurred one stands out


@dataclass(frozen=True)
class ChoiceSettings:
    """What is left out.

    Attributes:
        blur: below this part of the median sharpness of the frames around, a frame is blurred.
        least_sharpness: below it every frame is blurred, whatever the others are.
        clipped: greatest share of white pixels in the background.
        black: greatest share of black ones.
        jump_stops: greatest change of brightness from one frame to the next; 0 allows any.
        alike: least mean difference to the frame kept before, in grey levels, brightness
            evened out; 0 keeps every frame, as the paper does.
        least_kept: a clip in which fewer frames are good fails.
    """

    blur: float = 0.35
    least_sharpness: float = 0.0004
    clipped: float = 0.5
    black: float = 0.6
    jump_stops: float = 0.0
    alike: float = 2.0
    least_kept: int = 1

    def __post_init__(self) -> None:
        for name in ("blur", "least_sharpness", "clipped", "black", "jump_stops", "alike"):
            value = getattr(self, name)
            if not 0 <= value < np.inf:
                raise ConfigError(f"choice.{name} of at least 0", f"{value}", "correct it")
        if self.least_kept < 1:
            raise ConfigError("choice.least_kept from 1", f"{self.least_kept}", "correct it")


def causes_by_log(log: QualityLog, how: ChoiceSettings) -> list[str]:
    """Give for every frame the first cause to leave it out, or `KEEP`, from its numbers alone."""
    sharpness = log.column("sharpness")
    typical = _median_around(sharpness)
    blurred = (sharpness < how.blur * typical) | (sharpness < how.least_sharpness)
    exposed_badly = (log.column("clipped") > how.clipped) | (log.column("black") > how.black)
    causes = np.full(len(log), KEEP, object)
    for cause, found in (
        ("blurred", blurred),
        ("exposure_jump", _jumps(log.column("mean"), how.jump_stops)),
        ("badly_exposed", exposed_badly),
        ("duplicated", _frozen(log.column("change"))),
    ):
        causes[found] = cause
    return list(causes)


class Chooser:
    """The second pass over a clip: gives the frames to keep and notes the cause of every other."""

    def __init__(self, causes: list[str], alike: float) -> None:
        self.causes = list(causes)
        self._alike = alike

    def keep(self, stills: Iterable[VideoFrame]) -> Iterator[VideoFrame]:
        """Give the frames that are good and differ enough from the one given before."""
        last: Float[np.ndarray, "height width"] | None = None
        left = sum(cause == KEEP for cause in self.causes)
        for still in stills:
            if self.causes[still.number] == KEEP:
                left -= 1
                view = evened(still.averaged_luma(_view)) if self._alike else None
                if view is not None and last is not None and _difference(view, last) < self._alike:
                    self.causes[still.number] = "near_duplicate"
                else:
                    last = view
                    yield still
            if not left:  # the rest need not be decoded
                return

    @property
    def kept(self) -> int:
        return self.causes.count(KEEP)

    @property
    def dropped(self) -> dict[str, int]:
        """How many frames each cause left out; causes without any are not named."""
        counts = Counter(cause for cause in self.causes if cause != KEEP)
        return {cause: counts[cause] for cause in CAUSES if counts[cause]}


def _view(luma: Samples) -> Samples:
    return measured(measured(luma), _ALIKE_SIDE, 1.0)


def evened(grey: UInt8[np.ndarray, "height width"]) -> Float[np.ndarray, "height width"]:
    """Bring the mean to 128, so that exposure alone makes no new view."""
    wide = grey.astype(np.float32)
    return wide * np.float32(128 / max(float(wide.mean()), 8.0))


def _difference(
    one: Float[np.ndarray, "height width"], other: Float[np.ndarray, "height width"]
) -> float:
    return cv2.norm(np.ascontiguousarray(one), np.ascontiguousarray(other), cv2.NORM_L1) / one.size


def _frozen(change: Float[np.ndarray, " frames"]) -> Bool[np.ndarray, " frames"]:
    typical = float(np.median(change[1:])) if len(change) > 1 else 0.0
    return change < max(_FROZEN, _FROZEN_SHARE * typical)


def _jumps(mean: Float[np.ndarray, " frames"], stops: float) -> Bool[np.ndarray, " frames"]:
    if not stops or len(mean) < 2:
        return np.zeros(len(mean), bool)
    linear: np.ndarray = np.log2(np.maximum(mean, 1 / 255)) * 2.2
    return np.concatenate([[False], np.abs(np.diff(linear)) > stops])


def _median_around(values: Float[np.ndarray, " frames"]) -> Float[np.ndarray, " frames"]:
    half = min(_NEIGHBOURS, len(values)) // 2
    padded = np.pad(values, half, mode="reflect") if half else values
    windows: np.ndarray = np.lib.stride_tricks.sliding_window_view(padded, 2 * half + 1)
    around: np.ndarray = np.median(windows, axis=-1)
    # Not a long hectic stretch on its own: the whole clip has a say.
    return np.maximum(around, np.float32(0.5) * np.median(values))
