"""The camera's tilt by the photo's edges: upright ones run towards the point above our heads.

Each edge is asked how well it points along the projected vertical of a tilt (after Coughlan and
Yuille 1999, who ask for three directions at once). What the edges say is weighed against what was
thought of the pitch before them. Where no tilt stands out, as in grass or a face, that stays.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import radians, tan

import numpy as np
from jaxtyping import Float, Float32, UInt8
from PIL import Image

from deeplight.banded import BLAS_ALONE
from deeplight.estimators.projection import ImagePlane
from deeplight.frames import world_from_camera
from deeplight.io.tilt import Tilt

SOURCE = "upright edges"
LEAST_EVIDENCE = 12.0
"""How far, in standard deviations of chance, the best tilt must stand out of all."""
_HELD_PITCH_RAD, _HELD_SCALE_RAD = radians(-8), radians(22)
_HELD = Tilt(_HELD_PITCH_RAD, 0.0, "how cameras are held", _HELD_SCALE_RAD)
_ROLL_RAD = radians(2.5)  # two of three cameras that are held straight are held straighter
_ROLLED_RAD, _ROLLED = radians(10), 0.1  # others are rolled so much, and so much less likely
_SIDE = 256  # pixels along the longer side, or up to 1.5 times as many
_MOST, _FEWEST = 2000, 50  # edges: the strongest
_STEEPEST_LEAN = tan(radians(35))  # an upright edge leans by less in the picture
_LEAST_STEP = 5  # of 255, from one pixel to the next
_AGREES_RAD = radians(4)  # an edge that is off by more does not count
_SPREAD = _AGREES_RAD / radians(70)  # of all edges that may lean, those that agree by chance
_TRUST = 0.3  # neighbouring pixels are one edge: of their number so much counts
_LEAST_SCALE_RAD = radians(3)  # nobody's word is better, nor is that of all edges
_PITCHES_DEG, _ROLLS_DEG = (-63, 46, 3), (-21, 22, 3)  # from, up to, step
_PITCHES, _ROLLS = (np.radians(np.arange(*degrees)) for degrees in (_PITCHES_DEG, _ROLLS_DEG))


@dataclass(frozen=True, eq=False)
class Edges:
    """Edges of a picture that may be upright ones.

    Attributes:
        place: right and up on the plane at distance 1.
        across: the unit vector across each, in the picture, right and up.
        weight: of each; 1 on average.
    """

    place: Float32[np.ndarray, "edges 2"]
    across: Float32[np.ndarray, "edges 2"]
    weight: Float32[np.ndarray, " edges"]

    @property
    def chance(self) -> float:
        """Standard deviation of what agrees with a tilt by chance."""
        return float(np.sqrt((self.weight**2).sum() * _SPREAD))

    def agreement(self) -> Float[np.ndarray, "pitches rolls"]:
        """How much of the edges runs along the vertical of each tilt."""
        ups = _ups()
        # Seen at (x, y), a step up moves by (right + x back, up + y back) on the plane.
        across = np.stack([*self.across.T, (self.across * self.place).sum(1)], axis=1)
        along = np.stack([np.ones_like(self.weight), self.place[:, 1]], axis=1)
        along *= np.float32(np.sin(_AGREES_RAD)) / np.abs(self.across[:, :1])
        found = np.zeros(ups.shape[1], np.float32)
        several = BLAS_ALONE // ups.size  # edges: what they give stays near the processor
        for first in range(0, len(across), several):
            some = slice(first, first + several)
            off, upwards = across[some] @ ups, along[some] @ ups[1:]
            np.divide(off, upwards, out=off, where=upwards != 0)
            off *= off
            near = np.maximum(np.subtract(1, off, out=off), 0, out=off)
            near *= near
            found += self.weight[some] @ near
        return found.reshape(len(_PITCHES), len(_ROLLS)).astype(float)


def tilt_with_edges(
    pixels: UInt8[np.ndarray, "rows columns 3"], plane: ImagePlane, guess: Tilt | None
) -> tuple[Tilt | None, float]:
    """The guess corrected by upright edges, and by how many standard deviations they stand out.

    The mean of all tilts by how likely they are: those that the guess thinks likely and edges agree
    with. Without enough edges the guess comes back.

    Args:
        pixels: upright, gamma-encoded.
        plane: where they lie.
        guess: with its scale; left out, how cameras are held.
    """
    edges = upright_edges(pixels, plane)
    if edges is None:
        return guess, 0.0
    scores = edges.agreement() / edges.chance
    evidence = float(scores.max() - np.median(scores))
    if evidence < LEAST_EVIDENCE:
        return guess, evidence
    before = guess or _HELD
    scale = max(before.scale_rad, _LEAST_SCALE_RAD)
    off = (_PITCHES[:, None] - before.pitch_rad) / scale
    likely = _TRUST * scores - off**2 / 2 + _held(_ROLLS - before.roll_rad)
    chance = np.exp(likely - likely.max())
    chance /= chance.sum()
    of_pitch = chance.sum(1)
    pitch, roll = float(of_pitch @ _PITCHES), float(chance.sum(0) @ _ROLLS)
    scale = float(np.sqrt(of_pitch @ (_PITCHES - pitch) ** 2))
    source = SOURCE if guess is None else f"{SOURCE} and {guess.source}"
    return Tilt(pitch, roll, source, max(scale, _LEAST_SCALE_RAD)), evidence


def _held(roll: Float[np.ndarray, " rolls"]) -> Float[np.ndarray, " rolls"]:
    """ln of how likely cameras are held so, but for a constant."""
    straight = np.exp(-((roll / _ROLL_RAD) ** 2) / 2)
    held: np.ndarray = np.log(straight + _ROLLED * np.exp(-((roll / _ROLLED_RAD) ** 2) / 2))
    return held


def upright_edges(pixels: UInt8[np.ndarray, "rows columns 3"], plane: ImagePlane) -> Edges | None:
    """The strongest edges that lean by less than 35 degrees; None where there are hardly any."""
    rows, columns, _ = pixels.shape
    step = max(1, round(max(rows, columns) / _SIDE))
    if min(rows, columns) < 3 * step:
        return None
    whole = (0, 0, columns // step * step, rows // step * step)
    cells = Image.fromarray(np.ascontiguousarray(pixels)).reduce(step, whole)
    level = np.asarray(cells.convert("L")).astype(np.int16)  # in this order, as on the page
    right, up = _gradient(level)
    candidates = (np.abs(right) > 8 * _LEAST_STEP) & (np.abs(up) < _STEEPEST_LEAN * np.abs(right))
    chosen = np.flatnonzero(candidates)
    if len(chosen) < _FEWEST:
        return None
    across = np.stack([right.ravel()[chosen], up.ravel()[chosen]], axis=1).astype(np.float32)
    steepness = np.hypot(*across.T)
    if len(chosen) > _MOST:
        strongest = np.argsort(-steepness, kind="stable")[:_MOST]  # of equal ones, the upper
        chosen, across, steepness = chosen[strongest], across[strongest], steepness[strongest]
    row, column = np.divmod(chosen, right.shape[1])
    x = plane.left + (column + 1.5) * step / columns * (plane.right - plane.left)
    y = plane.top + (row + 1.5) * step / rows * (plane.bottom - plane.top)
    weight = np.sqrt(steepness)  # a bright lamp's edge is no better than a door's
    place = np.stack([x, y], axis=1).astype(np.float32)
    return Edges(place, across / steepness[:, None], weight / weight.mean())


def _gradient(level: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """To the right and up, times 8 and without the border (Sobel)."""
    along = level[:-2] + 2 * level[1:-1] + level[2:]
    across = level[:, :-2] + 2 * level[:, 1:-1] + level[:, 2:]
    return along[:, 2:] - along[:, :-2], across[:-2] - across[2:]


@lru_cache(maxsize=1)
def _ups() -> Float32[np.ndarray, "3 tilts"]:
    """Against gravity in the camera frame, for each pitch and roll."""
    ups = [world_from_camera(0.0, pitch, roll)[1] for pitch in _PITCHES for roll in _ROLLS]
    return np.array(ups, np.float32).T
