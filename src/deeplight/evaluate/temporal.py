"""Flicker: how much an estimate changes from one frame to the next when the light does not.

The estimate of a frame is turned by the camera's known rotation into the next frame's view and
compared there with the next estimate. The change is the mean over all directions and channels of
|log2 L' - log2 L|, in stops. The true light changes too, by the camera's exposure and white balance
and by the turning of coarse pixels: its change, measured in the same way, stands next to it.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Float64, Int64, Shaped

from deeplight.evaluate.bootstrap import RESAMPLES, Interval, PlaceBootstrap
from deeplight.evaluate.scores import TRUE_LIGHTING, Report
from deeplight.frames import Rotation, turned
from deeplight.mappings import mirror_ball

DARKEST_STOPS = -13.0  # radiance 1e-4: black has no logarithm

Ball = Float[np.ndarray, "size size 3"]


@dataclass(frozen=True)
class Flicker:
    """How one estimator changes between neighbouring frames of a take, in stops.

    Attributes:
        estimator: which.
        change: of the estimate.
        true_change: of the true light; NaN where it is not known.
        error: of the estimate's change against the true one; 0 follows the light exactly.
        pairs: of neighbouring frames.
    """

    estimator: str
    change: Interval
    true_change: Interval
    error: Interval
    pairs: int

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)


@dataclass(frozen=True, eq=False)
class Changes:
    """The change over each pair of neighbouring frames.

    Attributes:
        pairs: positions in the report of the earlier and the later frame.
        change, error: by estimator; the error is missing where the true light is not known.
    """

    pairs: Int64[np.ndarray, "pairs 2"]
    change: Mapping[str, Float64[np.ndarray, " pairs"]]
    error: Mapping[str, Float64[np.ndarray, " pairs"]]


def neighbours(report: Report) -> Int64[np.ndarray, "pairs 2"]:
    """Frames n and n + 1 of one take whose camera poses are both known."""
    known = np.isfinite(report.world_from_camera).all((1, 2))
    where = {(str(report.takes[n]), int(report.frames[n])): int(n) for n in np.flatnonzero(known)}
    pairs = [
        (at, where[take, frame + 1])
        for (take, frame), at in where.items()
        if (take, frame + 1) in where
    ]
    return np.array(pairs, np.int64).reshape(-1, 2)


def changes(report: Report) -> Changes:
    """Measure the change of every estimator over every pair of neighbours."""
    pairs = neighbours(report)
    change: dict[str, list[float]] = {name: [] for name in report.log_radiance}
    error: dict[str, list[float]] = {name: [] for name in report.log_radiance}
    for first, second in pairs:
        poses = report.world_from_camera
        second_from_first = poses[second].T @ poses[first]
        steps = {
            name: step(answers[first], answers[second], second_from_first)
            for name, answers in report.log_radiance.items()
        }
        for name, found in steps.items():
            change[name].append(_mean(np.abs(found)))
            true = steps.get(TRUE_LIGHTING)
            if true is not None and true.shape == found.shape:
                error[name].append(_mean(np.abs(found - true)))
    return Changes(
        pairs,
        {name: np.array(values) for name, values in change.items()},
        {name: np.array(values) for name, values in error.items() if len(values) == len(pairs)},
    )


def step(earlier: Ball, later: Ball, later_from_earlier: Rotation) -> Ball:
    """Stops by which each direction of the later frame is brighter than it was, both ln radiance.

    Every pixel of the later ball is compared with the mean over what it covers of the earlier one.
    """
    size = len(earlier)
    directions, inside = mirror_ball.subpixels(size)
    before = mirror_ball.pixel_of_directions(turned(directions, later_from_earlier.T), size)
    stops = np.maximum(earlier.reshape(-1, 3) / np.log(2), DARKEST_STOPS)
    share = inside / np.maximum(inside.sum(1, keepdims=True), 1)
    turned_stops = np.einsum("psc,ps->pc", stops[before], share)
    found: Ball = np.maximum(later / np.log(2), DARKEST_STOPS) - turned_stops.reshape(later.shape)
    return found


def flicker(
    changed: Changes, places: Shaped[np.ndarray, " examples"], resamples: int = RESAMPLES
) -> list[Flicker]:
    """Means over the pairs, with intervals over places; none without neighbouring frames."""
    if not len(changed.pairs):
        return []
    draws = PlaceBootstrap(places[changed.pairs[:, 0]], resamples)
    unknown = np.full(len(changed.pairs), np.nan)
    true = draws.mean(changed.change.get(TRUE_LIGHTING, unknown))
    return [
        Flicker(
            name,
            draws.mean(values),
            true,
            draws.mean(changed.error.get(name, unknown)),
            len(values),
        )
        for name, values in changed.change.items()
    ]


def runs_of_frames(
    report: Report, pairs: Int64[np.ndarray, "pairs 2"], longest: int = 4
) -> list[Int64[np.ndarray, " frames"]]:
    """Runs of up to `longest` neighbouring frames, one of each take, in the order of the report."""
    follows = dict(pairs.tolist())
    later = set(follows.values())
    starts = [first for first in follows if first not in later]
    runs, seen = [], set()
    for start in starts:
        if report.takes[start] in seen:
            continue
        seen.add(report.takes[start])
        run = [start]
        while run[-1] in follows and len(run) < longest:
            run.append(follows[run[-1]])
        runs.append(np.array(run, np.int64))
    return runs


def _mean(values: Ball) -> float:
    """The mean over all directions, each by its solid angle."""
    inside: Bool[np.ndarray, "size size"] = mirror_ball.coverage(len(values)) > 0
    weight = mirror_ball.solid_angles(len(values))[inside]
    return float(np.average(values[inside].mean(-1), weights=weight))
