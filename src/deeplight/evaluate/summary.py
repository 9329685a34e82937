"""Means, medians, spreads and 95 % intervals of a report, indoor and outdoor apart and together."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64

from deeplight.evaluate.bootstrap import RESAMPLES, SEED, Interval, PlaceBootstrap
from deeplight.evaluate.scores import TRUE_LIGHTING, Report

REFERENCES = ("training_mean", "best_constant", "mean_spheres")
SCENES = ("indoor", "outdoor", "both")
BINS = 5

__all__ = ["REFERENCES", "RESAMPLES", "SCENES", "SEED", "Interval", "Summary", "summarise"]


@dataclass(frozen=True)
class Summary:
    """One metric of one estimator in one kind of scene.

    Attributes:
        split, estimator, scene, metric: which.
        mean: over the examples, and its interval.
        median: likewise.
        sd: standard deviation over the examples.
        examples: how many have a value.
        undefined: how many have none (NaN); they are in no other number here.
        places: how many places the examples come from; what the interval resamples.
        ratio: the mean over that of each constant baseline in `REFERENCES`, on the examples where
            both have a value.
        difference: the mean less that of each other estimator, on the examples where both have a
            value; only for the estimators asked for.
    """

    split: str
    estimator: str
    scene: str
    metric: str
    mean: Interval
    median: Interval
    sd: float
    examples: int
    undefined: int
    places: int
    ratio: dict[str, Interval]
    difference: dict[str, Interval]

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)


def summarise(
    report: Report, compared: Sequence[str] = (), resamples: int = RESAMPLES
) -> list[Summary]:
    """Summarise every metric of every estimator, in every kind of scene that has examples.

    Args:
        compared: the estimators whose difference to every other one is wanted.
    """
    found = []
    for scene in SCENES:
        inside = report.inside(scene)
        if not inside.any():
            continue
        draws = PlaceBootstrap(report.places[inside], resamples)
        columns = {
            name: {metric: values[inside] for metric, values in scores.metrics().items()}
            for name, scores in report.scores.items()
        }
        for name, metrics in columns.items():
            others = [o for o in columns if o not in (name, TRUE_LIGHTING) and name in compared]
            found += [
                _summary(draws, (report.split, name, scene, metric), columns, others)
                for metric in metrics
            ]
    return found


def _summary(
    draws: PlaceBootstrap,
    names: tuple[str, str, str, str],
    columns: Mapping[str, Mapping[str, Float64[np.ndarray, " examples"]]],
    others: Sequence[str],
) -> Summary:
    _, estimator, _, metric = names
    values = columns[estimator][metric]
    against = {name: of[metric] for name, of in columns.items()}
    defined = np.isfinite(values)
    references = [r for r in REFERENCES if r in columns and metric.startswith(("l1_", "theta"))]
    return Summary(
        *names,
        mean=draws.mean(values),
        median=draws.median(values),
        sd=float(values[defined].std()) if defined.any() else float("nan"),
        examples=int(defined.sum()),
        undefined=int((~defined).sum()),
        places=draws.places,
        ratio={name: draws.ratio(values, against[name]) for name in references},
        difference={name: draws.difference(values, against[name]) for name in others},
    )


@dataclass(frozen=True)
class CalibrationBin:
    """How an estimator errs in scenes of about one brightness.

    Attributes:
        estimator: which.
        low, high: true mean radiance, relative to camera white, of the bin.
        energy_stops: mean error of the power from all directions; 0 is calibrated.
        diffuse_radiance: mean relative radiance error of the diffuse sphere.
        examples: in the bin.
    """

    estimator: str
    low: float
    high: float
    energy_stops: Interval
    diffuse_radiance: Interval
    examples: int


def calibration(
    report: Report, bins: int = BINS, resamples: int = RESAMPLES
) -> list[CalibrationBin]:
    """Bins of equally many examples by true brightness; none where the true light is not known."""
    known = np.flatnonzero(np.isfinite(report.true_radiance))
    ranked = known[np.argsort(report.true_radiance[known], kind="stable")]
    found = []
    for name, scores in report.scores.items():
        columns = scores.metrics()
        for chosen in np.array_split(ranked, bins):
            if not len(chosen) or "energy_stops" not in columns:
                continue
            draws = PlaceBootstrap(report.places[chosen], resamples)
            found.append(
                CalibrationBin(
                    name,
                    float(report.true_radiance[chosen[0]]),
                    float(report.true_radiance[chosen[-1]]),
                    draws.mean(columns["energy_stops"][chosen]),
                    draws.mean(scores.relative_radiance.mean(1)[chosen]),
                    len(chosen),
                )
            )
    return found
