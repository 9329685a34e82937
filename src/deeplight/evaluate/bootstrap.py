"""95 % intervals from resampling places, not examples.

Frames of one place are alike, so resampling them would promise too much. With a handful of places
even these intervals are optimistic.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64, Shaped

RESAMPLES = 2000
SEED = 0
_VALUES_AT_A_TIME = 20_000_000  # of draws x examples, for medians

Values = Float64[np.ndarray, " examples"]


@dataclass(frozen=True)
class Interval:
    """A number and its 95 % interval over resampled places; NaN where it is not defined.

    Of one place nothing can be resampled: the number stands without an interval, which is NaN.
    """

    value: float
    low: float
    high: float

    def __contains__(self, number: float) -> bool:
        return self.low <= number <= self.high

    @property
    def of_one_place(self) -> bool:
        """Whether there is a number but no interval."""
        return bool(np.isfinite(self.value) and np.isnan(self.low))


NOTHING = Interval(float("nan"), float("nan"), float("nan"))


class PlaceBootstrap:
    """Places drawn with replacement; the same draws for every number, so that pairs stay paired.

    A value that is not finite is left out of everything; who prints a number counts them.
    """

    def __init__(
        self,
        places: Shaped[np.ndarray, " examples"],
        resamples: int = RESAMPLES,
        seed: int = SEED,
    ) -> None:
        names, self._place_of = np.unique(places, return_inverse=True)
        self.places = len(names)
        even = np.full(self.places, 1 / self.places)
        draws = np.random.default_rng(seed).multinomial(self.places, even, resamples)
        self._times: Int64[np.ndarray, "draws places"] = draws

    def mean(self, values: Values) -> Interval:
        """The mean over examples."""
        defined = np.isfinite(values)
        return self._quotient(values, np.ones(len(values)), defined)

    def ratio(self, values: Values, reference: Values) -> Interval:
        """The mean of `values` over that of `reference`, where both are defined."""
        return self._quotient(values, reference, np.isfinite(values) & np.isfinite(reference))

    def difference(self, values: Values, reference: Values) -> Interval:
        """The mean of `values` less that of `reference`, where both are defined."""
        return self.mean(values - reference)

    def median(self, values: Values) -> Interval:
        """The median over examples."""
        defined = np.flatnonzero(np.isfinite(values))
        if not len(defined):
            return NOTHING
        order = defined[np.argsort(values[defined], kind="stable")]
        ranked, place = values[order], self._place_of[order]
        whole = _medians(ranked, np.ones((1, len(ranked))))[0]
        step = max(1, _VALUES_AT_A_TIME // len(ranked))
        drawn = [
            _medians(ranked, self._times[first : first + step, place])
            for first in range(0, len(self._times), step)
        ]
        return self._interval(float(whole), np.concatenate(drawn), len(np.unique(place)))

    def _quotient(
        self, above: Values, below: Values, defined: Bool[np.ndarray, " examples"]
    ) -> Interval:
        """The quotient of two sums, and the spread of it over the draws."""
        tops, bottoms = self._by_place(above, defined), self._by_place(below, defined)
        if not bottoms.any():
            return NOTHING
        with np.errstate(divide="ignore", invalid="ignore"):
            drawn = (self._times @ tops) / (self._times @ bottoms)
        # A draw of nothing but places without a value has no quotient.
        places = int(np.count_nonzero(self._by_place(np.ones(len(below)), defined)))
        return self._interval(float(tops.sum() / bottoms.sum()), drawn, places)

    @staticmethod
    def _interval(value: float, drawn: Float64[np.ndarray, " draws"], places: int) -> Interval:
        if places < 2:
            return Interval(value, float("nan"), float("nan"))
        low, high = np.nanpercentile(drawn, (2.5, 97.5))
        return Interval(value, float(low), float(high))

    def _by_place(self, values: Values, defined: Bool[np.ndarray, " examples"]) -> np.ndarray:
        return np.bincount(self._place_of, np.where(defined, values, 0.0), self.places)


def _medians(
    ranked: Float64[np.ndarray, " defined"], weights: Shaped[np.ndarray, "draws defined"]
) -> Float64[np.ndarray, " draws"]:
    """Weighted medians of sorted values; half-way between two that share the middle."""
    running = weights.cumsum(1, dtype=np.float64)
    half = running[:, -1:] / 2
    lower, upper = (running < half).sum(1), (running <= half).sum(1)
    found = (
        ranked[np.minimum(lower, len(ranked) - 1)] + ranked[np.minimum(upper, len(ranked) - 1)]
    ) / 2
    return np.where(half[:, 0] > 0, found, np.nan)
