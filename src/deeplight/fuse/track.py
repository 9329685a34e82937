"""How the camera was turned in each picture, from the pictures alone.

Features of pairs of pictures are matched; a rotation that a sample of two matches gives and most of
the others confirm places the pair (what moves or is very near is outvoted). Then all rotations, the
focal length and how far the camera strayed are solved together over all matches (`adjust`), first
with last where a turn closes, so that drift is spread and gone.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import exp, radians, tan

import cv2
import numpy as np
from jaxtyping import Float, Float32, UInt8

from deeplight.frames import Rotation, normalised
from deeplight.fuse.adjust import Free, Pair, adjusted, rays_of
from deeplight.fuse.poses import angle_between, nearest_rotation
from deeplight.fuse.zoom import is_zoom, log_zooms

WORKING_SIDE = 480
"""Pixels of the longer side of the pictures that features are looked for in."""
FEATURES = 1200
_CONTRAST = 0.01  # SIFT's: of fewer features a bare room's pairs have too few
FEWEST = 14
"""Matches that must agree on a rotation before a pair counts."""
_AGREE_RAD = radians(0.8)
_RATIO = 0.8  # a match must be so much better than the second best
_TRIALS = 300
_KEPT = 150  # matches of a pair that go into the adjustment
_AHEAD = 3  # neighbours in time that every picture is matched with
_REACH_RAD = radians(55)  # pictures that look nearer each other than this may overlap
_DRIFT_RAD = 0.01  # by which that grows with each picture between them
_SETTLED_RAD = radians(1)  # moved by less, pictures overlap as they did
_MOST_NEAR = 4  # further pairs of each picture that are tried
_ROUNDS, _MOST_STRANGERS = 3, 200  # further pairs, of pictures of which one is not placed, a round
_BRIGHT, _DARKEST = 160, 16  # levels of a picture's bright parts that features are looked for at
_ZOOM_ROUNDS, _ZOOM_FOUND = 8, 0.003  # and ln of what the last one may still find
_FOV_NEEDS_RAD = radians(50)  # turned by less, a step to the side looks like another field of view


@dataclass(frozen=True, eq=False)
class Tracked:
    """Where pictures looked.

    Attributes:
        rotations: world_from_camera by the picture's place in the sequence; those that could not
            be placed are missing. The first placed picture's frame is the world.
        scale: what tangents of half the fields of view are to be multiplied by, to fit best; 1 if
            they were known.
        residual_rad: median angle by which matches miss each other if the camera only turned.
        zooms: how much more each placed picture is magnified than the first of them; empty if the
            camera need not have zoomed.
    """

    rotations: dict[int, Rotation]
    scale: float
    residual_rad: float
    zooms: dict[int, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Features:
    """Points of one picture on the plane at distance 1, at the field of view assumed, and words.

    Those of all pictures are in memory together, so words are bytes, as SIFT makes them.
    """

    plane: Float[np.ndarray, "n 2"]
    words: UInt8[np.ndarray, "n 128"]

    @property
    def unit_words(self) -> Float32[np.ndarray, "n 128"]:
        """Roots of the words' shares (Arandjelovic 2012): their products are likenesses."""
        total = np.maximum(self.words.sum(1, keepdims=True, dtype=np.float32), 1e-9)
        return np.sqrt(self.words / total)


def track(
    pictures: Iterable[UInt8[np.ndarray, "_ _ 3"]],
    vertical_fovs_rad: Sequence[float],
    fov_known: bool,
) -> Tracked:
    """Find the rotation of each picture.

    Args:
        pictures: upright, in the order they were taken.
        vertical_fovs_rad: of each, known or assumed.
        fov_known: whether to keep to them; else all are of one camera.

    Returns:
        The largest group of pictures that could be placed together; empty if no two match.
    """
    features = [
        features_of(picture, tan(fov / 2))
        for picture, fov in zip(pictures, vertical_fovs_rad, strict=True)
    ]
    found, pairs = _tracked(features, fov_known)
    logs = log_zooms(pairs, found.rotations)
    if not is_zoom(logs):
        return found
    total = np.zeros(len(features))
    for _ in range(_ZOOM_ROUNDS):  # the first only sees the middle, where a zoom hardly moves
        total += np.interp(np.arange(len(features)), list(logs), list(logs.values()))
        alike = [
            replace(f, plane=f.plane * exp(-log)) for f, log in zip(features, total, strict=True)
        ]
        found, pairs = _tracked(alike, fov_known)
        logs = log_zooms(pairs, found.rotations)
        if max(np.abs(list(logs.values())), default=0.0) < _ZOOM_FOUND:
            break
    first = total[min(found.rotations)] if found.rotations else 0.0
    zooms = {number: exp(total[number] - first) for number in found.rotations}
    return replace(found, zooms=zooms)


def _tracked(features: list[Features], fov_known: bool) -> tuple[Tracked, list[Pair]]:
    """Rotations of pictures that are all magnified alike, and the pairs that say them."""
    count = len(features)
    tried = {(k, j) for j in range(count) for k in range(max(0, j - _AHEAD), j)}
    pairs = _all_matched(features, sorted(tried))
    rotations, _, _ = _solved(pairs, count, fov_known, strays=False)
    for _ in range(_ROUNDS):  # a closed turn may bring further pictures within reach
        near = _near(rotations, tried)
        found = _all_matched(features, [*near, *_strangers(rotations, count, tried)])
        if not found:
            break
        pairs += found
        before = rotations
        rotations, _, _ = _solved(pairs, count, fov_known, strays=False)
        if _settled(before, rotations):
            break
    rotations, scale, residual = _solved(pairs, count, fov_known, strays=True)
    return Tracked(rotations, scale, residual), pairs


def _settled(before: dict[int, Rotation], after: dict[int, Rotation]) -> bool:
    """Whether the same pictures look where they did: then no others have come within reach."""
    return before.keys() == after.keys() and all(
        angle_between(turn, after[number]) < _SETTLED_RAD for number, turn in before.items()
    )


def features_of(
    picture: UInt8[np.ndarray, "height width 3"], half_height: float, most: int = FEATURES
) -> Features:
    """What may be found again in another picture.

    Args:
        picture: upright.
        half_height: of the picture on the plane at distance 1.
        most: features, the clearest ones.
    """
    scale = min(1.0, WORKING_SIDE / max(picture.shape[:2]))
    grey = cv2.cvtColor(np.ascontiguousarray(picture), cv2.COLOR_RGB2GRAY)
    if scale < 1:
        grey = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    bright = max(float(np.quantile(grey, 0.95)), _DARKEST)
    if bright < _BRIGHT:  # of a burst's dark exposures: SIFT looks for contrast in levels
        grey = cv2.convertScaleAbs(grey, alpha=_BRIGHT / bright)
    points, words = cv2.SIFT.create(most, contrastThreshold=_CONTRAST).detectAndCompute(grey, None)
    if words is None or len(words) < 2:
        return Features(np.zeros((0, 2)), np.zeros((0, 128), np.uint8))
    at = np.array([point.pt for point in points])
    height, width = grey.shape
    plane = (at + 0.5 - [width / 2, height / 2]) * [1, -1] * (2 * half_height / height)
    return Features(plane, words.astype(np.uint8))


def _all_matched(features: list[Features], tried: Sequence[tuple[int, int]]) -> list[Pair]:
    found = (matched(features, *pair) for pair in tried)
    return [pair for pair in found if pair is not None]


def _near(rotations: dict[int, Rotation], tried: set[tuple[int, int]]) -> list[tuple[int, int]]:
    """Pairs not tried yet that may overlap, the nearest first, a few of each picture.

    The nearest of all are those with which a turn closes; more than a few of the others say the
    same again.
    """
    if not rotations:
        return []
    numbers = sorted(rotations)
    looks = np.stack([rotations[number] for number in numbers])
    cosine = (np.einsum("iab,jab->ij", looks, looks) - 1) / 2
    angle = np.arccos(np.clip(cosine, -1, 1))
    gap = np.abs(np.subtract.outer(numbers, numbers))
    first, second = np.nonzero(np.triu(angle < _REACH_RAD + _DRIFT_RAD * gap, 1))
    found, count = [], np.zeros(len(numbers), int)
    for k in np.argsort(angle[first, second], kind="stable"):
        a, b = int(first[k]), int(second[k])
        pair = numbers[a], numbers[b]
        if pair not in tried and max(count[a], count[b]) < _MOST_NEAR:
            count[[a, b]] += 1
            tried.add(pair)
            found.append(pair)
    return found


def _strangers(
    rotations: dict[int, Rotation], count: int, tried: set[tuple[int, int]]
) -> list[tuple[int, int]]:
    """Some pairs of a placed picture and one that is not: of a second turn, or out of order."""
    lost = [number for number in range(count) if number not in rotations]
    pairs = [(min(a, b), max(a, b)) for b in lost for a in rotations]
    found = [pair for pair in pairs if pair not in tried]
    found = found[:: max(1, -(-len(found) // _MOST_STRANGERS))]
    tried.update(found)
    return found


def matched(
    features: Mapping[int, Features] | Sequence[Features], first: int, second: int
) -> Pair | None:
    """Match two pictures and find the rotation between them, None if they do not overlap."""
    a, b = features[first], features[second]
    if min(len(a.plane), len(b.plane)) < FEWEST:
        return None
    likeness = a.unit_words @ b.unit_words.T
    best = likeness.argmax(1)
    rows = np.arange(len(best))
    top = likeness[rows, best]
    likeness[rows, best] = -1
    second_best = likeness.max(1)
    likeness[rows, best] = top
    clear = 2 - 2 * top < _RATIO**2 * (2 - 2 * second_best)
    mutual = likeness.argmax(0)[best] == rows
    kept = np.flatnonzero(clear & mutual)
    if len(kept) < FEWEST:
        return None
    one, other = a.plane[kept], b.plane[best[kept]]
    rng = np.random.default_rng([first, second])
    found = _rotation_of(rays_of(one), rays_of(other), rng)
    if found is None:
        return None
    turn, agree = found
    chosen = np.flatnonzero(agree)
    if len(chosen) > _KEPT:
        chosen = rng.choice(chosen, _KEPT, replace=False)
    return Pair(first, second, one[chosen], other[chosen], turn)


def _rotation_of(
    one: Float[np.ndarray, "n 3"], other: Float[np.ndarray, "n 3"], rng: np.random.Generator
) -> tuple[Rotation, np.ndarray] | None:
    """The rotation that most matches agree on (RANSAC), and which do: one = R other."""
    pairs = rng.integers(0, len(one), (_TRIALS, 2))
    pairs = pairs[np.linalg.norm(one[pairs[:, 0]] - one[pairs[:, 1]], axis=1) > 0.05]
    if not len(pairs):
        return None
    left, right = _frames_of(one[pairs]), _frames_of(other[pairs])
    turns = left @ right.transpose(0, 2, 1)
    products = (one[:, :, None] * other[:, None]).reshape(-1, 9)
    cosine = turns.reshape(-1, 9) @ products.T
    # A field of view that is only assumed bends rays towards the edge: the first gate is wide.
    agrees = cosine > 1 - (2.5 * _AGREE_RAD) ** 2 / 2  # |a - b|^2 = 2 - 2 a b
    agree = agrees[agrees.sum(1).argmax()]
    for gate in (2.5, 2.0):
        if agree.sum() < FEWEST:
            return None
        turn = nearest_rotation(one[agree].T @ other[agree])
        agree = np.linalg.norm(one - other @ turn.T, axis=1) < gate * _AGREE_RAD
    # Of chance matches some agree with any rotation: ask for a share as well (Brown, Lowe 2007).
    return (turn, agree) if agree.sum() > max(FEWEST, 8 + 0.25 * len(one)) else None


def _frames_of(pairs: Float[np.ndarray, "t 2 3"]) -> Float[np.ndarray, "t 3 3"]:
    """An orthonormal frame spanned by each pair of rays."""
    middle, across = pairs.sum(1), pairs[:, 0] - pairs[:, 1]
    x = normalised(middle)
    y = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    return np.stack([x, y, np.cross(x, y)], axis=2)


def _chained(pairs: list[Pair], count: int) -> dict[int, Rotation]:
    """Rotations of the largest connected group, along the pairs with most matches."""
    groups: list[dict[int, Rotation]] = []
    placed: set[int] = set()
    for start in range(count):
        if start in placed:
            continue
        group = {start: np.eye(3)}
        while True:
            best, step = 0, None
            for p in pairs:
                if (p.first in group) != (p.second in group) and len(p.one) > best:
                    best, step = len(p.one), p
            if step is None:
                break
            if step.first in group:
                group[step.second] = group[step.first] @ step.first_from_second
            else:
                group[step.first] = group[step.second] @ step.first_from_second.T
        placed |= set(group)
        groups.append(group)
    largest = max(groups, key=len, default={})
    if len(largest) < 2:
        return {}
    origin = largest[min(largest)].T
    return {number: origin @ turn for number, turn in sorted(largest.items())}


def _solved(
    pairs: list[Pair], count: int, fov_known: bool, strays: bool
) -> tuple[dict[int, Rotation], float, float]:
    """Rotations, scale of the tangents and residual; where too little turned, the scale stays 1
    and the camera in its place."""
    chained = _chained(pairs, count)
    views = np.array([-turn[:, 2] for turn in chained.values()]).reshape(-1, 3)
    narrow = not len(views) or bool((views @ views.T).min() > np.cos(_FOV_NEEDS_RAD))
    return adjusted(pairs, chained, Free(not (fov_known or narrow), strays and not narrow))
