"""Means, spreads and 95 % intervals of a report, indoor and outdoor apart and together."""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float64

from deeplight.evaluate.run import Report

RESAMPLES = 2000
SEED = 0
REFERENCES = ("training_mean", "best_constant", "mean_spheres")
SCENES = ("indoor", "outdoor", "both")


@dataclass(frozen=True)
class Interval:
    """A number and its 95 % interval over resampled places; NaN where it is not defined."""

    value: float
    low: float
    high: float


@dataclass(frozen=True)
class Summary:
    """One metric of one estimator in one kind of scene.

    Attributes:
        estimator, scene, metric: which.
        mean: over the examples, and its interval.
        sd: standard deviation over the examples.
        examples: how many have a value.
        undefined: how many have none (NaN); they are in no other number here.
        places: how many places the examples come from; what the interval resamples.
        ratio: the mean over that of each constant baseline in `REFERENCES`, on the examples where
            both have a value.
    """

    estimator: str
    scene: str
    metric: str
    mean: Interval
    sd: float
    examples: int
    undefined: int
    places: int
    ratio: dict[str, Interval]

    def to_dict(self) -> dict[str, Any]:
        return asdict(self)


def summarise(report: Report, resamples: int = RESAMPLES) -> list[Summary]:
    """Summarise every metric of every estimator, in every kind of scene that has examples.

    Intervals are bootstrap percentiles over places, not examples: frames of one place are alike, so
    resampling them would promise too much. With a handful of places even these are optimistic.
    """
    found = []
    for scene in SCENES:
        inside = np.full(len(report.keys), True) if scene == "both" else report.scenes == scene
        if not inside.any():
            continue
        draws = _Draws(report.places[inside], resamples)
        columns = {
            name: {metric: values[inside] for metric, values in scores.metrics().items()}
            for name, scores in report.scores.items()
        }
        for name, metrics in columns.items():
            for metric, values in metrics.items():
                ratio = {
                    reference: draws.ratio(values, columns[reference][metric])
                    for reference in REFERENCES
                    if reference in columns and metric.startswith("l1_")
                }
                found.append(_summary(draws, (name, scene, metric), values, ratio))
    return found


def _summary(
    draws: "_Draws",
    names: tuple[str, str, str],
    values: Float64[np.ndarray, " examples"],
    ratio: dict[str, Interval],
) -> Summary:
    defined = np.isfinite(values)
    sd = float(values[defined].std()) if defined.any() else float("nan")
    return Summary(
        *names,
        mean=draws.mean(values),
        sd=sd,
        examples=int(defined.sum()),
        undefined=int((~defined).sum()),
        places=draws.places,
        ratio=ratio,
    )


class _Draws:
    """Places drawn with replacement, the same draws for every metric, so that ratios are paired."""

    def __init__(self, places: np.ndarray, resamples: int) -> None:
        names, self.place_of = np.unique(places, return_inverse=True)
        self.places = len(names)
        even = np.full(self.places, 1 / self.places)
        self.times = np.random.default_rng(SEED).multinomial(self.places, even, resamples)

    def mean(self, values: Float64[np.ndarray, " examples"]) -> Interval:
        defined = np.isfinite(values)
        sums, counts = self._by_place(values, defined), self._by_place(defined * 1.0, defined)
        return _interval(sums, counts, self.times)

    def ratio(
        self, values: Float64[np.ndarray, " examples"], reference: Float64[np.ndarray, " examples"]
    ) -> Interval:
        defined = np.isfinite(values) & np.isfinite(reference)
        sums = self._by_place(values, defined)
        return _interval(sums, self._by_place(reference, defined), self.times)

    def _by_place(self, values: np.ndarray, defined: np.ndarray) -> np.ndarray:
        return np.bincount(self.place_of, np.where(defined, values, 0.0), self.places)


def _interval(above: np.ndarray, below: np.ndarray, times: np.ndarray) -> Interval:
    """The quotient of two sums over places, and the spread of it over the draws."""
    if not below.any():
        return Interval(float("nan"), float("nan"), float("nan"))
    with np.errstate(divide="ignore", invalid="ignore"):
        drawn = (times @ above) / (times @ below)
    # A draw of nothing but places without a value has no quotient.
    low, high = np.nanpercentile(drawn, (2.5, 97.5))
    return Interval(float(above.sum() / below.sum()), float(low), float(high))
