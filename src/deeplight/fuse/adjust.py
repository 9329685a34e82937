"""All rotations, the focal length and how far the camera strayed, in one robust least squares.

Nobody turns a phone about its lens. A camera that strays by c sees what lies at distance d in
direction r moved to c / d + s r, and the part of c along r drops out: a step to the side looks like
a rotation in the middle of the picture, and unlike one towards its edges. Solved for, it leaves the
rotations alone. 1 / d is taken for a smooth function of the direction, as in a room; what stands
out has parallax left, which the robust weights outvote. A hand strays by centimetres, and that is
what places are drawn to; where it strayed by nothing that can be seen they would only fit noise,
and bend a turn that does not close, so they have to explain something of what rotations leave.

Matches miss by parts of a pixel, and a smaller field of view makes pixels, and so all misses,
smaller. So misses are compared in the pixels' size, not in angles: else noise makes every field of
view too small, and a turn that does not close is off by as much.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import radians

import numpy as np
from jaxtyping import Float, Int

from deeplight.frames import Rotation, crosses, dot, exponential, normalised
from deeplight.harmonics import basis

SOFT_RAD = radians(0.3)
"""A residual of this size counts half at most."""
_LEAST_SOFT_RAD = radians(0.05)
_SOFT = 2.0  # medians of the residuals that count half, where that is less
_ROUNDS = 20
_MOST, _FEWEST = 12_000, 20  # matches in all, and of each pair if that would leave too few
_COUNTED = 60  # matches of a pair that count in full: they share what the model leaves out
_FOV_SIGMA = 0.15  # ln of the tangent: how far an assumed field of view may be off
_STRAY_SIGMA = 0.05  # of where the camera is, in mean distances of what it sees
_DEPTH_SIGMA = 0.3  # of each harmonic of 1 / distance, whose mean is 1
_DEPTH_ORDER = 3
_DEPTHS = (_DEPTH_ORDER + 1) ** 2 - 1
_EXPLAINED = 0.9  # of the residual of rotations alone may be left with strayed cameras
_FIRST_STAYS = 1e3
_FARTHEST = 0.4  # from the origin, in mean distances
_NEARNESS = (0.2, 2.4)
_NUDGE = 1e-4


@dataclass(frozen=True, eq=False)
class Pair:
    """Two pictures that show the same.

    Attributes:
        first, second: their places in the sequence.
        one, other: matched points on the plane at distance 1.
        first_from_second: the rotation that most of them agree on.
    """

    first: int
    second: int
    one: Float[np.ndarray, "n 2"]
    other: Float[np.ndarray, "n 2"]
    first_from_second: Rotation


@dataclass(frozen=True, eq=False)
class _Matches:
    """Of all pairs, of each the same number, filled up with some that do not count.

    Attributes:
        i, j: each pair's pictures, by their place among those solved for.
        one, other: their points.
        counts: how much each counts, 0 for those that fill up.
    """

    i: Int[np.ndarray, " pairs"]
    j: Int[np.ndarray, " pairs"]
    one: Float[np.ndarray, "pairs most 2"]
    other: Float[np.ndarray, "pairs most 2"]
    counts: Float[np.ndarray, "pairs most"]

    @classmethod
    def of(cls, pairs: Sequence[Pair], order: dict[int, int]) -> "_Matches":
        most = min(max(len(p.one) for p in pairs), max(_FEWEST, _MOST // len(pairs)))
        one, other = np.zeros((len(pairs), most, 2)), np.zeros((len(pairs), most, 2))
        counts = np.zeros((len(pairs), most))
        for k, pair in enumerate(pairs):
            number = min(most, len(pair.one))
            one[k, :number], other[k, :number] = pair.one[:number], pair.other[:number]
            counts[k, :number] = min(1.0, _COUNTED / number)
        i, j = (np.array([order[n] for n in side]) for side in zip(*map(_ends, pairs), strict=True))
        return cls(i, j, one, other, counts)


def _ends(pair: Pair) -> tuple[int, int]:
    return pair.first, pair.second


@dataclass(frozen=True, eq=False)
class _Cameras:
    """All that is solved for: places in mean distances, harmonics of 1 / distance in the world."""

    turns: Float[np.ndarray, "pictures 3 3"]
    places: Float[np.ndarray, "pictures 3"]
    log_scale: float
    depths: Float[np.ndarray, " harmonics"]

    def points(
        self,
        at: Int[np.ndarray, " pairs"],
        plane: Float[np.ndarray, "pairs n 2"],
        more: float = 0.0,
    ) -> tuple[Float[np.ndarray, "pairs n 3"], Float[np.ndarray, "pairs n 3"]]:
        """Rays in the world, and the directions of what they meet as seen from the origin."""
        rays = rays_of(plane, self.log_scale + more) @ self.turns[at].transpose(0, 2, 1)
        if not self.places.any():
            return rays, rays
        places = self.places[at, None] * self.nearness(rays)[..., None]
        along = dot(rays, places)[..., None]
        reach = np.sqrt(1 - dot(places, places)[..., None] + along**2) - along
        return rays, places + reach * rays

    def nearness(self, rays: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n"]:
        """1 / distance of what lies in directions."""
        nearness: np.ndarray = 1 + self.harmonics(rays) @ self.depths
        return np.clip(nearness, _NEARNESS[0], _NEARNESS[1])

    def harmonics(self, rays: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n harmonics"]:
        """Slopes of 1 / distance by `depths`, none where depths are not solved for."""
        if not len(self.depths):
            return np.zeros((*rays.shape[:-1], 0))
        harmonics: np.ndarray = basis(rays, _DEPTH_ORDER)[..., 1:]
        return harmonics

    def moved(self, step: Float[np.ndarray, " unknowns"]) -> "_Cameras":
        own, shared = step[: 6 * len(self.turns)].reshape(-1, 6), step[6 * len(self.turns) :]
        turned = [t @ exponential(s) for t, s in zip(self.turns, own[:, :3], strict=True)]
        places = self.places + own[:, 3:]
        far = np.linalg.norm(places, axis=1, keepdims=True)
        places = places * np.minimum(1, _FARTHEST / np.maximum(far, 1e-9))
        scale = float(np.clip(self.log_scale + shared[0], -0.5, 0.5))
        return _Cameras(np.stack(turned), places, scale, self.depths + shared[1:])


@dataclass(frozen=True)
class Free:
    """What may change besides the rotations."""

    scale: bool
    places: bool


def adjusted(
    pairs: Sequence[Pair], rotations: dict[int, Rotation], free: Free
) -> tuple[dict[int, Rotation], float, float]:
    """Solve for all pictures together (Gauss-Newton, Cauchy's weights).

    Args:
        pairs: of which only those between the pictures of `rotations` count.
        rotations: world_from_camera to begin with, by the picture's place in the sequence.
        free: whether the focal length and the cameras' places are solved for as well.

    Returns:
        Rotations in the first picture's frame, the factor by which the plane's points were too
        near its middle, and the median angle by which matches miss each other with rotations alone.
    """
    order = {number: place for place, number in enumerate(rotations)}
    used = [p for p in pairs if p.first in order and p.second in order]
    if not used:
        return rotations, 1.0, 0.0
    matches = _Matches.of(used, order)
    turns, places = np.stack(list(rotations.values())), np.zeros((len(order), 3))
    cameras = _Cameras(turns, places, 0.0, np.zeros(0))
    cameras, residual = _solved(cameras, matches, free.scale)
    if free.places:
        strayed = replace(cameras, depths=np.zeros(_DEPTHS))
        strayed, left = _solved(strayed, matches, free.scale)
        more = 3 * len(order) + _DEPTHS  # unknowns, which fit noise as well
        by_chance = np.sqrt(max(0.0, 1 - more / (2 * np.count_nonzero(matches.counts))))
        if left < _EXPLAINED * by_chance * residual:
            cameras = strayed
    turns = cameras.turns[0].T @ cameras.turns
    found = {number: turns[place] for number, place in order.items()}
    return found, float(np.exp(cameras.log_scale)), residual


def rays_of(plane: Float[np.ndarray, "*n 2"], log_scale: float = 0.0) -> Float[np.ndarray, "*n 3"]:
    """Unit rays through points of the plane at distance 1, the points moved out by e^log_scale."""
    rays = np.concatenate([plane * np.exp(log_scale), -np.ones((*plane.shape[:-1], 1))], axis=-1)
    return normalised(rays)


def _solved(cameras: _Cameras, matches: _Matches, free_scale: bool) -> tuple[_Cameras, float]:
    """The cameras that fit best, and the median residual; where there are depths, strayed ones."""
    soft = 3 * SOFT_RAD
    for _ in range(_ROUNDS):
        step = _step(cameras, matches, free_scale, soft)
        cameras = cameras.moved(step)
        missed = _missed(cameras, matches)
        soft = max(float(np.clip(_SOFT * missed, _LEAST_SOFT_RAD, SOFT_RAD)), 0.7 * soft)
        if np.abs(step).max() < 1e-5:
            break
    return cameras, missed


def _missed(cameras: _Cameras, matches: _Matches) -> float:
    """The median angle by which matches miss each other."""
    _, a = cameras.points(matches.i, matches.one)
    _, b = cameras.points(matches.j, matches.other)
    return float(np.median(np.linalg.norm(a - b, axis=-1)[matches.counts > 0]))


def _step(
    cameras: _Cameras, matches: _Matches, free_scale: bool, soft: float
) -> Float[np.ndarray, " unknowns"]:
    """One step of each picture's rotation (in its own frame) and place, then of what they share:
    ln of the scale, and depths."""
    slopes, residual = _linear(cameras, matches)
    weight = matches.counts / (1 + dot(residual, residual) / soft**2)
    pairs, own = len(matches.i), 6 * len(cameras.turns)
    flat = slopes.reshape(pairs, -1, slopes.shape[-1])
    weighted = (slopes * weight[..., None, None]).reshape(flat.shape).transpose(0, 2, 1)
    blocks, rights = weighted @ flat, weighted @ -residual.reshape(pairs, -1, 1)
    total = own + 1 + len(cameras.depths)
    rows = np.concatenate(
        [6 * end[:, None] + np.arange(6) for end in (matches.i, matches.j)]
        + [np.tile(np.arange(own, total), (pairs, 1))],
        axis=1,
    )
    cells = rows[:, :, None] * total + rows[:, None]
    flat_matrix: np.ndarray = np.bincount(cells.ravel(), blocks.ravel(), total**2)
    matrix = flat_matrix.reshape(total, total)
    right: np.ndarray = np.bincount(rows.ravel(), rights.ravel(), total)
    strayed = np.arange(own).reshape(-1, 6)[:, 3:]
    pull, value = np.zeros(total), np.zeros(total)
    pull[strayed], value[strayed] = (soft / _STRAY_SIGMA) ** 2, cameras.places
    pull[own], value[own] = (soft / _FOV_SIGMA) ** 2, cameras.log_scale
    pull[own + 1 :], value[own + 1 :] = (soft / _DEPTH_SIGMA) ** 2, cameras.depths
    matrix[np.diag_indices(total)] += pull + 1e-9
    right -= pull * value
    fixed = np.zeros(total, bool)
    fixed[own] = not free_scale
    fixed[strayed[0] if len(cameras.depths) else strayed] = True
    matrix[fixed] = matrix[:, fixed] = right[fixed] = 0
    matrix[fixed, fixed] = 1
    matrix[:3, :3] += np.eye(3) * _FIRST_STAYS
    return np.asarray(np.linalg.solve(matrix, right))


def _linear(
    cameras: _Cameras, matches: _Matches
) -> tuple[Float[np.ndarray, "pairs n 3 slopes"], Float[np.ndarray, "pairs n 3"]]:
    """Slopes by the first picture's step, the second's, the scale and the depths; residuals."""
    slopes = np.zeros((*matches.counts.shape, 3, 13 + len(cameras.depths)))
    residual, nudged = np.zeros((2, *matches.counts.shape, 3))
    noise = np.zeros(matches.counts.shape)
    for sign, first, at, plane in (
        (1, 0, matches.i, matches.one),
        (-1, 6, matches.j, matches.other),
    ):
        rays, points = cameras.points(at, plane)
        residual += sign * points
        nudged += sign * cameras.points(at, plane, _NUDGE)[1]
        inwards = 1 / (1 + np.exp(2 * cameras.log_scale) * (plane**2).sum(-1))  # squared cosine
        noise += (1.5 * inwards - 0.5) / 2  # d ln of a pixel's size, across and along the radius
        slopes[..., first : first + 3] = -sign * crosses(rays) @ cameras.turns[at, None]
        if not len(cameras.depths):
            continue
        across = np.eye(3) - rays[..., :, None] * rays[..., None, :]
        slopes[..., first + 3 : first + 6] = sign * cameras.nearness(rays)[..., None, None] * across
        parallax = across @ cameras.places[at, None, :, None]
        slopes[..., 13:] += sign * parallax * cameras.harmonics(rays)[..., None, :]
    slopes[..., 12] = (nudged - residual) / _NUDGE - noise[..., None] * residual
    return slopes, residual
