"""Gradient boosting with small trees, for a few thousand rows: what columns could say of a number.

Friedman 2001 with squared loss; trees of two levels, thresholds at quantiles of each column.
"""

from typing import NamedTuple, Self

import numpy as np
from jaxtyping import Float, Int

ROUNDS, RATE, LEVELS, LEAST, SHARE = 150, 0.05, 2, 20, 0.5
THRESHOLDS = np.linspace(0.05, 0.95, 19)


class Split(NamedTuple):
    """Of a node: rows whose `column` is above `threshold` go right."""

    column: int
    threshold: float


class Boosted:
    """A sum of trees; each is a list of splits, level by level, and the values of its leaves."""

    def __init__(self, columns: Float[np.ndarray, "n columns"], target: np.ndarray) -> None:
        random = np.random.default_rng(0)
        self.base = float(target.mean())
        self.trees: list[tuple[list[Split], np.ndarray]] = []
        left = target - self.base
        edges = np.quantile(columns, THRESHOLDS, axis=0)
        for _ in range(ROUNDS):
            some = random.random(len(left)) < SHARE
            splits = self._grown(columns[some], left[some], edges)
            leaves = leaf_of(columns, splits)
            values = np.zeros(2**LEVELS)
            for leaf in range(len(values)):
                inside = some & (leaves == leaf)
                values[leaf] = RATE * left[inside].mean() if inside.any() else 0.0
            self.trees.append((splits, values))
            left = left - values[leaves]

    @classmethod
    def of(cls, columns: np.ndarray, target: np.ndarray) -> Self:
        """From the rows whose target is known."""
        known = np.isfinite(target)
        return cls(columns[known], target[known])

    def __call__(self, columns: Float[np.ndarray, "n columns"]) -> Float[np.ndarray, " n"]:
        total = np.full(len(columns), self.base)
        for splits, values in self.trees:
            total += values[leaf_of(columns, splits)]
        return total

    def _grown(self, columns: np.ndarray, left: np.ndarray, edges: np.ndarray) -> list[Split]:
        splits: list[Split] = []
        node = np.zeros(len(left), int)
        for level in range(LEVELS):
            for own in range(2**level):
                rows = node == own
                splits.append(best_split(columns[rows], left[rows], edges))
            node = leaf_of(columns, splits)
        return splits


def best_split(columns: np.ndarray, left: np.ndarray, edges: np.ndarray) -> Split:
    """The split that leaves the least square; one that parts nothing where there is none."""
    best, found = 0.0, Split(0, np.inf)
    for column, thresholds in enumerate(edges.T):
        above = columns[:, column, None] > thresholds
        high = above.sum(0)
        low = len(left) - high
        sums = left @ above
        gain = np.square(sums) / np.maximum(high, 1) + np.square(left.sum() - sums) / np.maximum(
            low, 1
        )
        gain = np.where((high >= LEAST) & (low >= LEAST), gain, 0.0)
        if gain.max() > best:
            best, found = float(gain.max()), Split(column, float(thresholds[gain.argmax()]))
    return found


def leaf_of(columns: np.ndarray, splits: list[Split]) -> Int[np.ndarray, " n"]:
    """Which leaf each row falls into, as far as the splits go."""
    node, start, width = np.zeros(len(columns), int), 0, 1
    while start + width <= len(splits):
        here = splits[start : start + width]
        chosen = np.array([split.column for split in here])[node]
        limit = np.array([split.threshold for split in here])[node]
        node = 2 * node + (columns[np.arange(len(columns)), chosen] > limit)
        start, width = start + width, 2 * width
    return node
