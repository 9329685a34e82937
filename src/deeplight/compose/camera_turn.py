"""How the camera turns through a video: by the object's place, or by all that is seen.

Features of each frame are matched with the first frame's, which ends all drift when a turn closes,
or else with those of the last frame that opened a new view. While the object's place is in the
picture it is followed as well (`follow`), to a part of a pixel: then they only say how the camera
rolls, and nothing is lost where they say nothing.
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from itertools import groupby

import numpy as np
from jaxtyping import Float, UInt8

from deeplight.compose.follow import Follower, turned_to
from deeplight.compose.ground import Viewpoint, viewpoint_turned
from deeplight.errors import ConfigError
from deeplight.frames import Rotation
from deeplight.fuse.choose import sharpness, tiny
from deeplight.fuse.poses import angle_between
from deeplight.fuse.track import Features, features_of, matched

_FEATURES = 700  # of each frame: a rotation of two pictures needs fewer than many pictures' do
_NEW_VIEW_RAD = np.radians(8)  # from the one before it; nearer ones would only add drift
_BACK = 0.1  # of the shorter side: so far inside the picture a place is followed again
_CONTRADICTS_RAD = np.radians(6)  # less is said by a field of view or pitch that is assumed wrongly
_JUMP_RAD, _JUMP = np.radians(1.5), 0.3  # between two frames, of what the camera turned meanwhile
_BLURRED = 0.5  # of the fine detail of the last frame that was followed
_ROLLED_RAD = np.radians(4)  # by so much turned in the picture, a place is followed anew


class CameraTurn:
    """The camera of each frame, the first one's known.

    Attributes:
        lost: numbers of frames, from 0, that match nothing, such as those of another place after a
            cut: the camera stays where it was.
        hidden: of those where the object's place is in the picture and does not look as before:
            it is then where all else that is seen says, which may be some pixels off.
        blurred: of those of them that have lost their detail everywhere: the camera moved fast.
    """

    def __init__(self, first: Viewpoint, anchor: Float[np.ndarray, "3"]) -> None:
        """Begin before the first frame; `anchor`: the object's place in the world."""
        self.lost: list[int] = []
        self.hidden: list[int] = []
        self.blurred: list[int] = []
        self._first = self._now = first
        self._anchor = anchor
        self._frames = 0
        self._sharp = 0.0  # of the last frame in which the place was followed
        self._follower: Follower | None = None
        self._apart: Rotation = np.eye(3)  # the followed camera from the one that features say
        self._followed_roll = 0.0  # of the camera that the follower last began with
        self._views: list[tuple[Features, Rotation]] = []  # the first frame, the last new view

    def update(self, luma: UInt8[np.ndarray, "height width"]) -> Viewpoint:
        """The camera of the next frame."""
        number, self._frames = self._frames, self._frames + 1
        if number == 0:
            self._views = [(self._features(luma), self._first.world_from_camera)]
            self._sharp = sharpness(tiny(luma))
            self._follow(luma)
            return self._first
        found = self._found(self._features(luma))
        followed = self._followed(luma, found)
        if followed is not None:
            self._now, self._sharp = followed, sharpness(tiny(luma))
            if abs(followed.roll_rad - self._followed_roll) > _ROLLED_RAD:
                self._follow(luma)
            return self._now
        was_followed, self._follower = self._follower is not None, None
        self._apart = np.eye(3)
        if found is None:
            self.lost.append(number)
            return self._now
        self._now, by_first = found
        if self._inside(*self._place(), _BACK):
            if was_followed:
                self._name(number, luma)
            if by_first:
                self._follow(luma)
        return self._now

    def _followed(
        self, luma: UInt8[np.ndarray, "height width"], found: tuple[Viewpoint, bool] | None
    ) -> Viewpoint | None:
        """The camera that sees the object's place where it is followed to, rolled as features say;
        None out of the picture, where it is not seen, and where features contradict."""
        before = copy(self._follower)
        at = None
        if self._follower is not None:
            at = self._follower.update(luma.astype(np.float32), self._expected(found))
        if at is None or not self._inside(*at, 0):
            return None
        roll_rad = self._now.roll_rad if found is None else found[0].roll_rad
        try:
            now = turned_to(replace(self._now, roll_rad=roll_rad), self._anchor, *at)
        except ConfigError:  # nobody holds a camera so
            return None
        if found is None:
            return now
        found_turn = found[0].world_from_camera
        apart = now.world_from_camera @ found_turn.T
        moved = angle_between(self._now.world_from_camera, found_turn)
        # What a field of view or pitch that is assumed wrongly puts between the two grows slowly;
        # somebody who walks through the picture takes the place along at once.
        farther = angle_between(apart, np.eye(3)) > angle_between(self._apart, np.eye(3))
        if farther and angle_between(apart, self._apart) > max(_JUMP_RAD, _JUMP * moved):
            self._follower = before
            self._name(self._frames - 1, luma)
            return viewpoint_turned(self._first, self._apart @ found_turn)
        self._apart = apart
        return now if angle_between(apart, np.eye(3)) < _CONTRADICTS_RAD else None

    def _follow(self, luma: UInt8[np.ndarray, "height width"]) -> None:
        self._follower = Follower(luma.astype(np.float32), *self._place())
        self._followed_roll = self._now.roll_rad

    def _expected(self, found: tuple[Viewpoint, bool] | None) -> tuple[float, float] | None:
        """Where the object's place is by what features say, none out of the picture."""
        if found is None:
            return None
        try:
            seen_by = viewpoint_turned(self._first, self._apart @ found[0].world_from_camera)
        except ConfigError:  # nobody holds a camera so
            return None
        place = self._place(seen_by)
        return place if self._inside(*place, 0) else None

    def _name(self, number: int, luma: UInt8[np.ndarray, "height width"]) -> None:
        """Note a frame in which the place is not followed, and why."""
        blurred = sharpness(tiny(luma)) < _BLURRED * self._sharp
        (self.blurred if blurred else self.hidden).append(number)

    def _place(self, seen_by: Viewpoint | None = None) -> tuple[float, float]:
        x, y = (seen_by or self._now).pixels(self._anchor[None])[0]  # nan behind: nowhere inside
        return float(x), float(y)

    def _inside(self, x: float, y: float, margin: float) -> bool:
        width, height = self._first.camera.width, self._first.camera.height
        edge = margin * min(width, height)
        return edge <= x <= width - edge and edge <= y <= height - edge

    def _features(self, luma: UInt8[np.ndarray, "height width"]) -> Features:
        grey = np.broadcast_to(luma[..., None], (*luma.shape, 3))
        return features_of(grey, self._first.camera.tangents[1], _FEATURES)

    def _found(self, features: Features) -> tuple[Viewpoint, bool] | None:
        """The camera of these features, and whether the first frame says it, so without drift."""
        for number, (view, world_from_view) in enumerate(self._views):
            pair = matched([view, features], 0, 1)
            if pair is None:
                continue
            turn = world_from_view @ pair.first_from_second
            try:
                found = viewpoint_turned(self._first, turn)
            except ConfigError:  # on its side or upside down: nobody holds a camera so
                continue
            if angle_between(self._views[-1][1], turn) > _NEW_VIEW_RAD:
                self._views[1:] = [(features, turn)]
            return found, number == 0
        return None


def named_ranges(numbers: Sequence[int]) -> str:
    """Ascending numbers, in words: "3-5, 8"."""
    runs = [
        [number for _, number in group]
        for _, group in groupby(enumerate(numbers), lambda pair: pair[1] - pair[0])
    ]
    return ", ".join(f"{r[0]}-{r[-1]}" if len(r) > 1 else f"{r[0]}" for r in runs)
