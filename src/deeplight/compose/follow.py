"""An object that stays where it stands while the camera turns: for videos.

The camera is taken to turn about one point: that is what a hand mostly does. The surface around
the object is followed from frame to frame, and the camera turned so that the object's place
appears there.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from deeplight.compose.ground import Viewpoint
from deeplight.frames import rotation

_TRACKED_WIDTH = 240  # pixels; frames are averaged down to about it
_WINDOW = 0.6  # side of the followed patch, of the frame's shorter side
_REKEY = 0.2  # a patch that has moved by this part of itself is taken anew
_ALIKE = 0.4  # correlation of a patch with itself a moment later; of another place's it is about 0
_PLAIN = 4.0  # levels of standard deviation, below which all is alike: a bare wall and its noise


class Follower:
    """One place of the first frame, followed through a video."""

    def __init__(self, luma: Float[np.ndarray, "height width"], x: float, y: float) -> None:
        self._step = max(1, round(luma.shape[1] / _TRACKED_WIDTH))
        self._key = self._small(luma)
        self._side = max(16, int(_WINDOW * min(self._key.shape)) // 2 * 2)
        self._at_key = self._at = np.array([x, y]) / self._step
        self._begun = self._key, self._at_key

    def update(
        self,
        luma: Float[np.ndarray, "height width"],
        expected: tuple[float, float] | None = None,
    ) -> tuple[float, float] | None:
        """Where the place is in the next frame: (x, y) in pixels.

        None where it is not seen: after a cut, or behind a hand. Where all is alike there is
        nothing to follow, and it stays where it was. `expected` is where something else says
        that it is; if that is far off, because the camera moved fast, it is looked for there.
        """
        small = self._small(luma)
        near = self._at if expected is None else np.array(expected) / self._step
        start = self._at if self._is_near(near, self._at) else near
        at = self._found(small, start, self._key, self._at_key)
        if at is None:
            return None
        if self._key is not self._begun[0] and self._is_near(at, self._begun[1]):
            # Back where it began: what patches taken on the way, blurred ones above all, were off
            # by is gone.
            again = self._found(small, at, *self._begun)
            if again is not None and self._is_near(again, self._begun[1]):
                at, (self._key, self._at_key) = again, self._begun
        self._at = at
        if not self._is_near(at, self._at_key):
            self._key, self._at_key = small, at
        x, y = at * self._step
        return float(x), float(y)

    def _found(
        self,
        small: Float[np.ndarray, "rows columns"],
        at: Float[np.ndarray, "2"],
        key: Float[np.ndarray, "rows columns"],
        at_key: Float[np.ndarray, "2"],
    ) -> Float[np.ndarray, "2"] | None:
        """Where a frame shows a place of another one, looked for around `at`."""
        patch, before = self._patch(key, at_key), at
        for _ in range(2):  # once more from where it was found, for the rest
            at = at_key + np.round(at) - np.round(at_key) + _shift(patch, self._patch(small, at))
        found = self._patch(small, at)
        if _alike(patch, found):
            return at
        return before if _is_plain(patch) and _is_plain(found) else None

    def _is_near(self, one: Float[np.ndarray, "2"], other: Float[np.ndarray, "2"]) -> bool:
        return bool(np.abs(one - other).max() <= _REKEY * self._side)

    def _small(self, luma: Float[np.ndarray, "height width"]) -> Float[np.ndarray, "rows columns"]:
        n = self._step
        height, width = (size // n for size in luma.shape)
        blocks = luma[: height * n, : width * n].astype(np.float32).reshape(height, n, width, n)
        small: np.ndarray = blocks.mean((1, 3))
        return small

    def _patch(
        self, frame: Float[np.ndarray, "rows columns"], at: Float[np.ndarray, "2"]
    ) -> Float[np.ndarray, "side side"]:
        """The square around a place; beyond the frame its edge goes on."""
        x, y = np.round(at).astype(int)
        reach = np.arange(self._side) - self._side // 2
        rows = np.clip(y + reach, 0, frame.shape[0] - 1)
        columns = np.clip(x + reach, 0, frame.shape[1] - 1)
        return frame[np.ix_(rows, columns)]


def turned_to(viewpoint: Viewpoint, point: Float[np.ndarray, "3"], x: float, y: float) -> Viewpoint:
    """The camera turned, roll kept, so that a point of the world appears at pixel (x, y)."""
    wanted = point - [0, viewpoint.height_m, 0]
    wanted = wanted / np.linalg.norm(wanted)
    seen = replace(viewpoint, pitch_rad=0.0, yaw_rad=0.0).ray(x, y)  # roll is in it
    length = np.hypot(seen[1], seen[2])
    half = np.arccos(np.clip(wanted[1] / length, -1, 1))
    start = np.arctan2(seen[2], seen[1])
    turns = (np.array([half, -half]) - start + np.pi) % (2 * np.pi) - np.pi
    pitch = float(turns[np.abs(turns - viewpoint.pitch_rad).argmin()])
    raised = rotation("x", pitch) @ seen
    # The angle about +Y from one to the other, as seen from above.
    across = wanted[0] * raised[2] - wanted[2] * raised[0]
    along = wanted[0] * raised[0] + wanted[2] * raised[2]
    return replace(viewpoint, pitch_rad=pitch, yaw_rad=float(np.arctan2(across, along)))


def _window(side: int) -> Float[np.ndarray, "side side"]:
    line = np.hanning(side + 2)[1:-1]
    return line[:, None] * line


def _varied(patch: Float[np.ndarray, "side side"]) -> Float[np.ndarray, "side side"]:
    """What differs from its mean, weighted so that its squares sum up to its variance."""
    window = _window(len(patch))
    weight = window / window.sum()
    result: np.ndarray = (patch - (weight * patch).sum()) * np.sqrt(weight)
    return result


def _is_plain(patch: Float[np.ndarray, "side side"]) -> bool:
    return bool((_varied(patch) ** 2).sum() < _PLAIN**2)


def _alike(key: Float[np.ndarray, "side side"], other: Float[np.ndarray, "side side"]) -> bool:
    """Whether two patches show the same, however bright."""
    first, second = _varied(key), _varied(other)
    scale = np.sqrt((first**2).sum() * (second**2).sum())
    return bool((first * second).sum() > _ALIKE * scale)


def _shift(
    key: Float[np.ndarray, "side side"], other: Float[np.ndarray, "side side"]
) -> Float[np.ndarray, "2"]:
    """By how much (x, y) the second patch shows the first one moved: phase correlation."""
    flat = _window(len(key))
    first, second = (np.fft.rfft2((p - p.mean()) * flat) for p in (key, other))
    cross = second * np.conj(first)
    # Between plain and phase correlation: noise, which has all frequencies alike, counts less.
    peak = np.fft.irfft2(cross / np.maximum(np.abs(cross), 1e-9) ** 0.75, s=key.shape)
    size = len(key)
    row, column = np.unravel_index(peak.argmax(), peak.shape)
    parts = []
    for at, line in ((column, peak[row, :]), (row, peak[:, column])):
        low, middle, high = line[at - 1], line[at], line[(at + 1) % size]
        bend = low - 2 * middle + high
        fine = 0.0 if bend >= 0 else 0.5 * (low - high) / bend
        parts.append((at + fine + size / 2) % size - size / 2)
    return np.array(parts)
