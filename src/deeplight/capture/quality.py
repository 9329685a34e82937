"""What each frame of a clip is worth: brightness, sharpness, and whether it moved on.

Measured on the grey of the background (the upper 80 %; the spheres are always sharp), made small
enough to be cheap and large enough to show the blur of a shaken hand.
"""

from array import array
from collections.abc import Iterable, Iterator

import cv2
import numpy as np
from jaxtyping import Float, Shaped, UInt8

from deeplight.camera import BACKGROUND_FRACTION
from deeplight.io.video import VideoFrame

MEASURED_SIDE = 270  # pixels of the shorter side where a frame is measured
COLUMNS = ("time_s", "mean", "black", "clipped", "sharpness", "change")
_LEVELS = np.arange(256.0)
_BLACK, _WHITE = 6, 249  # grey levels from which on a pixel counts as lost

Grey = UInt8[np.ndarray, "_ _"]  # any height and width
Samples = Shaped[np.ndarray, "_ _"]  # the same as stored, perhaps of 16 bits


class QualityLog:
    """A row of numbers for each frame: 24 bytes, so that an hour is 2.6 MB.

    The columns: time_s; mean, from 0 to 1; black and clipped, the shares of lost pixels;
    sharpness, the variance of the Laplacian over that of the grey; change, the mean difference to
    the frame before in grey levels (infinite for the first).
    """

    def __init__(self) -> None:
        self._rows = array("f")

    def watch(self, stills: Iterable[VideoFrame]) -> Iterator[VideoFrame]:
        """Hand `stills` on and measure each as it goes by."""
        last: Grey | None = None
        for still in stills:
            small = np.ascontiguousarray(still.averaged_luma(measured))
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


def measured(
    luma: Samples, side: int = MEASURED_SIDE, share: float = BACKGROUND_FRACTION
) -> Samples:
    """Give the upper `share` of the grey as an area average, its shorter side at most `side`."""
    rows = luma[: round(len(luma) * share)]
    scale = min(1.0, side / min(luma.shape))
    size = max(8, round(rows.shape[1] * scale)), max(8, round(rows.shape[0] * scale))
    return shrunk(rows, size)


def shrunk(grey: Samples, size: tuple[int, int]) -> Samples:
    """Area average to `size` (width, height), walking the pixels as they lie in memory.

    Phones store portrait lying down; the upright frame is then a view with swapped strides, which
    OpenCV would copy first.
    """
    if abs(grey.strides[0]) < abs(grey.strides[1]):
        return shrunk(grey.T, size[::-1]).T
    if grey.strides[0] < 0:
        return shrunk(grey[::-1], size)[::-1]
    if grey.strides[1] < 0:
        return shrunk(grey[:, ::-1], size)[:, ::-1]
    return np.asarray(cv2.resize(grey, size, interpolation=cv2.INTER_AREA))


def _numbers(time_s: float, small: Grey, last: Grey | None) -> tuple[float, ...]:
    levels = cv2.calcHist([small], [0], None, [256], [0, 256]).ravel().astype(float) / small.size
    mean = float(levels @ _LEVELS)
    variance = max(4.0, float(levels @ (_LEVELS - mean) ** 2))  # a blank wall is not sharp by noise
    edges = cv2.meanStdDev(cv2.Laplacian(small, cv2.CV_16S, ksize=1))[1].item() ** 2
    change = np.inf
    if last is not None and last.shape == small.shape:
        change = cv2.norm(small, last, cv2.NORM_L1) / small.size
    black, white = float(levels[:_BLACK].sum()), float(levels[_WHITE:].sum())
    return time_s, mean / 255, black, white, edges / variance, change
