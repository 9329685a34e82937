"""Light that gathers while one looks around: a few dozen small views, solved again with each.

Memory is constant: at most `MOST_VIEWS` pictures of 192 rows. A new picture takes the place that it
looks at, where the picture before it goes; else it opens a place. So places stay apart and stand
still, however slowly one turns. When all are taken the most redundant one goes. What is kept are
pictures, not a panorama, so exposures can be corrected later, when the turn closes.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import radians
from pathlib import Path

import numpy as np
from jaxtyping import Float, Float32, UInt8

from deeplight.environment import Environment
from deeplight.errors import ConfigError, InputError, ShapeError
from deeplight.frames import Rotation, require_rotation
from deeplight.fuse.gains import overlaps, solve_gains, trusted
from deeplight.fuse.merge import environment_of, log_power
from deeplight.fuse.steady import Kept, Steadily
from deeplight.fuse.view import CELLS, HEIGHT, ROWS, View
from deeplight.io.arrays_file import read_arrays
from deeplight.io.atomic import replacing
from deeplight.io.boundary import reading

MOST_VIEWS = 64
NEAR_RAD = radians(7)
"""A view nearer to a place than this, and of like exposure, says the same as the one there."""
LIKE_EXPOSURE = 0.5
"""ln of gains up to which two views count as equally exposed."""
CHANGED = 0.45
"""Mean disagreement, ln, of a view with the sky so far that speaks of another light or place."""
LEAST_OVERLAP_SR = 0.05
MUCH_OVERLAP_SR = 0.15
"""Views that agree about less than the first are not asked whether they agree, unless they share
this: then they contradict each other."""
PATIENCE = 3
"""This number of such views in a row, and what was before them is forgotten."""
_VERSION = 1

Estimate = Callable[[UInt8[np.ndarray, "height width 3"]], Float32[np.ndarray, "size size 3"]]
"""Gives ln radiance on the mirror ball for a picture: the network."""


@dataclass(frozen=True, eq=False)
class Added:
    """What became of a frame.

    Attributes:
        views: how many are kept now.
        forgotten: everything before the last few frames was dropped: the light or place changed.
        disagreement: of this frame with what was known, ln; 0 where nothing overlaps.
        log_gain: ln of this frame's exposure and white balance over the first frame's.
    """

    views: int
    forgotten: bool
    disagreement: float
    log_gain: Float[np.ndarray, "3"]


class Session:
    """The light of a place as far as it has been seen.

    Examples:
        >>> session = Session(vertical_fov_rad=1.15, estimate=network)   # doctest: +SKIP
        >>> session.add(frame, world_from_camera)                        # doctest: +SKIP
        >>> session.environment().main_light.direction                   # doctest: +SKIP
    """

    def __init__(
        self, vertical_fov_rad: float, estimate: Estimate, most_views: int = MOST_VIEWS
    ) -> None:
        """Begin without views.

        Args:
            vertical_fov_rad: of every upright frame.
            estimate: the network; called once for each frame that brings no estimate of its own.
            most_views: how many to keep.
        """
        if not 0 < vertical_fov_rad < np.pi or most_views < 2:
            got = f"{vertical_fov_rad:g} rad, {most_views} views"
            raise ShapeError(
                "a field of view inside (0, pi) and 2 views or more", got, "correct it"
            )
        self.vertical_fov_rad = vertical_fov_rad
        self._estimate, self._most = estimate, most_views
        self._views: list[View] = []
        self._places: list[Rotation] = []  # of the view that opened each one's place
        n = most_views + 1
        self._logs, self._weights = (np.zeros((n, CELLS, 3), np.float32) for _ in range(2))
        self._differences, self._sure = (np.zeros((n, n, 3)) for _ in range(2))
        self._power = np.zeros((n, 3))
        self._log_gain = np.zeros((0, 3))
        self._first_turn: Rotation = np.eye(3)
        self._unit = np.zeros(3)  # ln gain of the first kept view
        self._strange = self._count = 0
        self._trust: Float[np.ndarray, "views cells"] | None = None
        self._shown = Kept()

    @property
    def views(self) -> tuple[View, ...]:
        """What is kept; the first one defines the unit."""
        return tuple(self._views)

    @property
    def gains(self) -> Float[np.ndarray, "views 3"]:
        """ln of each view's gain: 0 is the first frame's exposure and white balance."""
        return self._log_gain + self._unit

    def add(
        self,
        frame: UInt8[np.ndarray, "height width 3"],
        world_from_camera: Rotation,
        log_estimate: Float32[np.ndarray, "size size 3"] | None = None,
        log_exposure: float = float("nan"),
        vertical_fov_rad: float | None = None,
    ) -> Added:
        """Take in a frame.

        Args:
            frame: upright, gamma-encoded RGB of any size.
            world_from_camera: how the camera was turned, in any world whose axes stand still.
            log_estimate: what the network gives for it; left out, the session asks it.
            log_exposure: ln of its exposure, where its file says.
            vertical_fov_rad: of this frame, where it is another camera's.

        Raises:
            ShapeError: the rotation is none.
        """
        require_rotation(world_from_camera, "world_from_camera")
        estimate = self._estimate(frame) if log_estimate is None else log_estimate
        fov = self.vertical_fov_rad if vertical_fov_rad is None else vertical_fov_rad
        view = View(
            small(frame, fov),
            np.array(world_from_camera, float),
            fov,
            np.asarray(estimate, np.float32),
            log_exposure,
            self._count,
        )
        self._count += 1
        return self._take(view)

    def environment(
        self,
        world_from_camera: Rotation | None = None,
        log_gain: Float[np.ndarray, "3"] | None = None,
        height: int = HEIGHT,
        steady: bool = False,
    ) -> Environment:
        """The light so far.

        Args:
            world_from_camera: the camera in whose frame; left out, the first frame's.
            log_gain: of the frame relative to whose white, out of `gains`; left out, the first's.
            height: rows of the panorama.
            steady: for a light shown while one turns. Its power then stays what the last steady
                one had until that is contradicted by more than its uncertainty, e^0.3 at first
                and nothing once half of the sphere was seen, and the lamp where nothing was seen
                stays until another place is 1.5 times as bright; what was seen stays itself.

        Raises:
            InputError: nothing has been added yet.
        """
        if not self._views:
            raise InputError("a frame", "a session without any", "add one first")
        turn = self._first_turn if world_from_camera is None else world_from_camera
        n = len(self._views)
        unit = np.zeros(3) if log_gain is None else np.asarray(log_gain)
        gains = self.gains - unit
        if self._trust is None:
            self._trust = trusted(self._logs[:n], self._weights[:n], gains)
        steadily = Steadily(self._shown, unit, turn) if steady else None
        return environment_of(self._views, gains, self._trust, turn, height, steadily)

    def reset(self) -> None:
        """Forget everything: the place has been left."""
        self._shown = Kept()
        self._views, self._log_gain, self._unit = [], np.zeros((0, 3)), np.zeros(3)
        self._places = []
        self._strange = self._count = 0

    def _take(self, view: View) -> Added:
        if not self._views:
            self._first_turn = view.world_from_camera
        slot = len(self._views)
        self._views.append(view)
        self._places.append(view.world_from_camera)
        disagreement = self._compare(slot)
        self._solve()
        log_gain = self.gains[slot]
        self._strange = self._strange + 1 if disagreement > CHANGED else 0
        forgotten = self._strange >= PATIENCE
        if forgotten:
            newest = sorted(range(slot + 1), key=lambda k: self._views[k].number)[-PATIENCE:]
            self._keep(newest)
            self._strange, self._shown = 0, Kept()
        else:
            self._thin(slot)
        return Added(len(self._views), forgotten, disagreement, log_gain)

    def _compare(self, slot: int) -> float:
        """Fill in what the view in a slot and all before it share; how far they disagree."""
        view = self._views[slot]
        self._logs[slot], self._weights[slot] = view.cells()
        self._power[slot] = log_power(view)
        found = overlaps(
            self._logs[slot], self._weights[slot], self._logs[:slot], self._weights[:slot]
        )
        self._differences[slot, :slot], self._differences[:slot, slot] = (
            found.difference,
            -found.difference,
        )
        self._sure[slot, :slot] = self._sure[:slot, slot] = found.weight
        self._differences[slot, slot] = self._sure[slot, slot] = 0
        sure = found.weight.sum(1)
        overlapping = (sure > LEAST_OVERLAP_SR) | (found.shared > MUCH_OVERLAP_SR)
        before = view.number - self._strange  # later ones may be of the new place
        overlapping &= np.array([other.number < before for other in self._views[:slot]], bool)
        if not overlapping.any():
            return 0.0
        return float(np.average(found.disagreement[overlapping], weights=sure[overlapping]))

    def _solve(self) -> None:
        self._trust = None
        n = len(self._views)
        exposures = np.array([view.log_exposure for view in self._views])
        sure, differences = self._sure[:n, :n], self._differences[:n, :n]
        self._log_gain = solve_gains(differences, sure, exposures, self._power[:n])

    def _thin(self, newest: int) -> None:
        """Drop the view whose place the newest takes, or the most redundant one."""
        gains, places = self._log_gain, np.stack(self._places)
        cosine = (np.einsum("iab,jab->ij", places, places) - 1) / 2
        alike = np.abs(gains.mean(1)[:, None] - gains.mean(1)) < LIKE_EXPOSURE
        angle = np.where(alike, np.arccos(np.clip(cosine, -1, 1)), np.pi)
        np.fill_diagonal(angle, np.inf)
        angle[0] = np.inf  # the first view defines the unit
        nearest = int(angle[:, newest].argmin())
        if angle[nearest, newest] < NEAR_RAD:
            self._places[newest] = self._places[nearest]
            self._keep([newest if k == nearest else k for k in range(newest)])
        elif newest >= self._most:
            worst = int(angle.min(1).argmin())
            self._keep([k for k in range(newest + 1) if k != worst])

    def _keep(self, kept: list[int]) -> None:
        shift = self._log_gain[kept[0]]
        self._unit = self._unit + shift
        self._log_gain = self._log_gain[kept] - shift
        to = [k for k, source in enumerate(kept) if k != source]  # most stay where they are
        source = [kept[k] for k in to]
        for array in (self._logs, self._weights, self._power):
            array[to] = array[source]
        n = len(kept)
        for pairs in (self._differences, self._sure):
            pairs[:n, :n] = pairs[np.ix_(kept, kept)]
        self._views = [self._views[k] for k in kept]
        self._places = [self._places[k] for k in kept]
        self._trust = None

    def save(self, path: Path) -> None:
        """Write the state as .npz, whole or not at all.

        Raises:
            OSError: the file cannot be written.
        """
        state: dict[str, np.ndarray] = {
            "version": np.array(_VERSION),
            "vertical_fov_rad": np.array(self.vertical_fov_rad),
            "most_views": np.array(self._most),
            "count": np.array([self._count, self._strange]),
            "unit": self._unit,
            "first_turn": self._first_turn,
            "rotations": np.array([v.world_from_camera for v in self._views]),
            "places": np.array(self._places),
            "estimates": np.array([v.log_estimate for v in self._views]),
            "exposures": np.array(
                [[v.log_exposure, v.number, v.vertical_fov_rad] for v in self._views]
            ),
            **{f"pixels_{k}": view.pixels for k, view in enumerate(self._views)},
        }
        with replacing(path) as temporary, temporary.open("wb") as file:
            np.savez(file, allow_pickle=False, **state)

    @classmethod
    def load(cls, path: Path, estimate: Estimate) -> "Session":
        """Go on where `save` was called.

        Raises:
            OSError: the file cannot be read.
            ConfigError: it holds no session of this version.
        """
        with reading(path, ConfigError), np.errstate(all="ignore"):
            try:
                session = cls._restored(read_arrays(path), estimate)
            except (KeyError, ValueError, TypeError) as error:
                got = f"{path}: {error}"
                raise ConfigError("a session saved by deeplight", got, "begin a new one") from error
            if session._views:
                session._solve()
            return session

    @classmethod
    def _restored(cls, state: Mapping[str, np.ndarray], estimate: Estimate) -> "Session":
        if int(state["version"]) != _VERSION:
            raise ValueError("a session of another version")
        session = cls(float(state["vertical_fov_rad"]), estimate, int(state["most_views"]))
        exposures, rotations = state["exposures"], state["rotations"]
        places = state.get("places", rotations)  # files of before have none
        if len(state["estimates"]) > MOST_VIEWS + 1:
            raise ValueError("more views than a session keeps")
        for k, own in enumerate(state["estimates"]):
            turn, (exposure, number, fov) = rotations[k], exposures[k]
            pixels = state[f"pixels_{k}"]
            if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[2] != 3:
                raise ValueError(f"view {k} is no picture")
            view = View(pixels, turn, float(fov), own, float(exposure), int(number))
            session._views.append(view)
            session._places.append(places[k].reshape(3, 3))
            session._compare(k)
        session._first_turn = state["first_turn"]
        session._unit = state["unit"]
        session._count, session._strange = (int(n) for n in state["count"])
        return session


def small(
    frame: UInt8[np.ndarray, "height width 3"], vertical_fov_rad: float
) -> UInt8[np.ndarray, "rows columns 3"]:
    """The frame averaged down until a pixel is as wide as a texel of `HEIGHT` rows."""
    import cv2

    height, width, _ = frame.shape
    # Tangents, not angles: in the middle of the picture, where pixels are widest.
    rows = round(ROWS * np.tan(vertical_fov_rad / 2) / np.tan(radians(33)))
    if rows >= height:
        return np.ascontiguousarray(frame)
    size = (max(2, round(width * rows / height)), max(2, rows))
    return np.asarray(cv2.resize(np.ascontiguousarray(frame), size, interpolation=cv2.INTER_AREA))
