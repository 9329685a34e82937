"""Which frames of a clip are worth placing: the sharpest of those that show something new.

How far the picture has moved is followed from frame to frame. Comparing each frame with the last
kept one (phase correlation) is fooled by what moves with the camera, such as a finger, a gimbal's
arm or spheres on a rod, and then leaves a gap that nothing bridges.
"""

from collections.abc import Iterator
from itertools import pairwise

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from deeplight.io.video import VideoFrame

MOVED, ENOUGH = 0.1, 0.2
"""Of the picture's shorter side: between these the sharpest frame is kept."""
LEAST_STEP_S = 1 / 16
"""Frames nearer in time than this show the same: one of them is looked at."""
LONGEST_STEP_S = 0.15
"""Frames farther apart cannot be followed: each of them is kept."""
LONGEST_S = 2.0
"""A clip that stands still gives a frame now and then all the same."""
_TINY = 96  # pixels along the shorter side where movement is looked at
_STRIPS, _POINTS, _FEWEST = 4, 15, 8  # points of each strip: strong edges are not everywhere
_UNKNOWN = MOVED / 2  # taken for a step in which nothing can be followed: a bare wall, a blur
_MOST_ERROR = 24.0  # levels by which a followed point's surroundings may differ on average
_PYRAMID, _WINDOW = 3, (13, 13)

Tiny = UInt8[np.ndarray, "h w"]


def moving(source: Iterator[VideoFrame]) -> Iterator[VideoFrame]:
    """The first frame, and then the sharpest of those that show something new."""
    first = next(source)
    yield first
    flow, key_s, looked_s = _Flow(_tiny(first)), first.time_s, first.time_s
    best: tuple[VideoFrame, float, np.ndarray] | None = None
    for still in source:
        step_s = still.time_s - looked_s
        if step_s < LEAST_STEP_S:
            continue
        looked_s = still.time_s
        now = _tiny(still)
        flow.follow(now, step_s)
        moved, sharp = flow.moved, sharpness(now)
        if moved > MOVED and (best is None or sharp > best[1]):
            best = (still, sharp, flow.way)
        if best and (moved > ENOUGH or still.time_s - key_s > LONGEST_S):
            yield best[0]
            key_s = best[0].time_s
            flow.way = flow.way - best[2]
            best = None
        elif still.time_s - key_s > LONGEST_S:
            yield still
            key_s = still.time_s
            flow.way = np.zeros(2)
    if best:
        yield best[0]


class _Flow:
    """How far the picture has moved: `way`, of its shorter side, may be set back."""

    def __init__(self, first: Tiny) -> None:
        self.way = np.zeros(2)
        self._last = first

    @property
    def moved(self) -> float:
        return float(np.hypot(*self.way))

    def follow(self, now: Tiny, step_s: float) -> None:
        """Add the way of most that moves; what moves with the camera stands still."""
        last, self._last = self._last, now
        if step_s > LONGEST_STEP_S:
            self.way = self.way + [2 * ENOUGH, 0]
            return
        steps = _followed(last, now)
        if len(steps) < _FEWEST:
            self.way = self.way + [_UNKNOWN, 0]
            return
        far = steps[np.argsort(np.hypot(*steps.T))[len(steps) // 2 :]]
        self.way = self.way + np.median(far, axis=0) / min(now.shape)


def _followed(last: Tiny, now: Tiny) -> Float[np.ndarray, "n 2"]:
    """How far corners of all strips of the picture have moved, pixels."""
    found = []
    for top, bottom in pairwise(np.linspace(0, len(last), _STRIPS + 1).astype(int)):
        corners = cv2.goodFeaturesToTrack(last[top:bottom], _POINTS, 0.02, 5)
        if corners is not None:
            found.append(corners.reshape(-1, 2) + np.array([0, top], np.float32))
    if not found:
        return np.zeros((0, 2), np.float32)
    points = np.concatenate(found)
    to, status, wrong = cv2.calcOpticalFlowPyrLK(
        last, now, points, np.empty_like(points), winSize=_WINDOW, maxLevel=_PYRAMID
    )
    good = (status.ravel() > 0) & (wrong.ravel() < _MOST_ERROR)
    return np.asarray((to - points)[good])


def _tiny(still: VideoFrame) -> Tiny:
    return np.ascontiguousarray(still.averaged_luma(tiny))


def tiny(luma: np.ndarray) -> np.ndarray:
    """A picture averaged down to `_TINY` pixels along its shorter side."""
    step = max(1, min(luma.shape) // (3 * _TINY))  # every pixel of a large frame is not needed
    luma = np.ascontiguousarray(luma[::step, ::step])
    scale = _TINY / min(luma.shape)
    size = (round(luma.shape[1] * scale), round(luma.shape[0] * scale))
    return np.asarray(cv2.resize(luma, size, interpolation=cv2.INTER_AREA))


def sharpness(grey: UInt8[np.ndarray, "h w"]) -> float:
    """How much of a picture's contrast is fine detail: what moves fast has less."""
    return float(cv2.Laplacian(grey, cv2.CV_32F).var() / max(float(grey.var()), 1.0))
