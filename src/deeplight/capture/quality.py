"""What each frame of a clip is worth: brightness, sharpness, and whether it moved on.

Measured on the grey of the background (the upper 80 %; the spheres are always sharp), made small
enough to be cheap and large enough to show the blur of a shaken hand.
"""

from array import array
from collections.abc import Iterable, Iterator

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from deeplight.camera import BACKGROUND_FRACTION
from deeplight.io.video import Still

MEASURED_SIDE = 270  # pixels of the shorter side where a frame is measured
COLUMNS = ("time_s", "mean", "black", "clipped", "sharpness", "change")
_BLACK, _WHITE = 6, 249  # grey levels from which on a pixel counts as lost

Grey = UInt8[np.ndarray, "_ _"]  # any height and width


class QualityLog:
    """A row of numbers for each frame: 24 bytes, so that an hour is 2.6 MB.

    The columns: time_s; mean, from 0 to 1; black and clipped, the shares of lost pixels;
    sharpness, the variance of the Laplacian over that of the grey; change, the mean difference to
    the frame before in grey levels (infinite for the first).
    """

    def __init__(self) -> None:
        self._rows = array("f")

    def watch(self, stills: Iterable[Still]) -> Iterator[Still]:
        """Hand `stills` on and measure each as it goes by."""
        last: Grey | None = None
        for still in stills:
            small = measured(still.luma)
            self._rows.extend(_numbers(still.time_s, small, last))
            last = small
            yield still

    def __len__(self) -> int:
        return len(self._rows) // len(COLUMNS)

    def column(self, name: str) -> Float[np.ndarray, " frames"]:
        """Give one number of every frame."""
        rows: np.ndarray = np.array(self._rows, np.float32).reshape(-1, len(COLUMNS))
        return rows[:, COLUMNS.index(name)]

    def at(self, name: str, frame: int) -> float:
        """Give one number of one frame."""
        return self._rows[frame * len(COLUMNS) + COLUMNS.index(name)]


def measured(luma: Grey, side: int = MEASURED_SIDE, share: float = BACKGROUND_FRACTION) -> Grey:
    """Give the upper `share` of the grey as an area average, its shorter side at most `side`."""
    rows = luma[: round(len(luma) * share)]
    scale = min(1.0, side / min(luma.shape))
    size = max(8, round(rows.shape[1] * scale)), max(8, round(rows.shape[0] * scale))
    return _shrunk(rows, size)


def _shrunk(grey: Grey, size: tuple[int, int]) -> Grey:
    """Area average to `size` (width, height), walking the pixels as they lie in memory.

    Phones store portrait lying down; the upright frame is then a view with swapped strides, which
    OpenCV would copy first.
    """
    if abs(grey.strides[0]) < abs(grey.strides[1]):
        return _shrunk(grey.T, size[::-1]).T
    if grey.strides[0] < 0:
        return _shrunk(grey[::-1], size)[::-1]
    if grey.strides[1] < 0:
        return _shrunk(grey[:, ::-1], size)[:, ::-1]
    return np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA))


def _numbers(time_s: float, small: Grey, last: Grey | None) -> tuple[float, ...]:
    levels = np.bincount(small.ravel(), minlength=256) / small.size
    edges = cv2.Laplacian(np.ascontiguousarray(small), cv2.CV_32F, ksize=1)
    contrast = max(float(small.std()), 2.0)  # a blank wall is not sharp by its noise
    change = np.inf
    if last is not None and last.shape == small.shape:
        change = float(cv2.absdiff(small, last).mean())
    return (
        time_s,
        float(levels @ np.arange(256)) / 255,
        float(levels[:_BLACK].sum()),
        float(levels[_WHITE:].sum()),
        float(edges.var()) / contrast**2,
        change,
    )
