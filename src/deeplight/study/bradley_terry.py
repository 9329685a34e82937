"""Strengths from paired comparisons (Bradley and Terry 1952), with intervals.

P(i is chosen over j) = 1 / (1 + exp(s_j - s_i)). Answers of one person are alike, and so are those
about one scene; both are resampled with replacement, independently, and an answer counts as often
as its person times its scene was drawn (the pigeonhole bootstrap, Owen 2007, which errs on the
side of too wide).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64, Int64

RESAMPLES = 2000
SEED = 0
PRIOR = 0.1  # wins each way that are added to every pair: who never lost has a finite strength
_STEPS = 60

Strengths = Float64[np.ndarray, "*draws methods"]
Wins = Float64[np.ndarray, "*draws methods methods"]


@dataclass(frozen=True, eq=False)
class Comparisons:
    """Answers as numbers: who won, who lost, who was asked, about which scene."""

    winners: Int64[np.ndarray, " answers"]
    losers: Int64[np.ndarray, " answers"]
    people: Int64[np.ndarray, " answers"]
    scenes: Int64[np.ndarray, " answers"]
    methods: int

    def wins(self) -> Wins:
        """How often the row was chosen over the column."""
        return self._counted(np.ones((1, len(self.winners))))[0]

    def drawn_wins(self, resamples: int = RESAMPLES, seed: int = SEED) -> Wins:
        """The same over people and scenes drawn with replacement.

        With one person (or one scene) only scenes (or people) are drawn; with one of both
        there is nothing to draw, and every draw is the answers themselves.
        """
        random = np.random.default_rng(seed)
        weight = np.ones((resamples, len(self.winners)))
        for of in (self.people, self.scenes):
            names, number = np.unique(of, return_inverse=True)
            if len(names) > 1:
                even = np.full(len(names), 1 / len(names))
                weight *= random.multinomial(len(names), even, resamples)[:, number]
        return self._counted(weight)

    def _counted(self, weight: Float64[np.ndarray, "draws answers"]) -> Wins:
        contest = np.zeros((len(self.winners), self.methods**2))
        contest[np.arange(len(contest)), self.winners * self.methods + self.losers] = 1
        return (weight @ contest).reshape(-1, self.methods, self.methods)


def fit(wins: Wins, prior: float = PRIOR) -> Strengths:
    """The most likely strengths, in log odds, with mean 0.

    Newton's method on the concave likelihood; steps are limited to 1.

    Args:
        wins: how often the row was chosen over the column, also fractions.
        prior: added to every pair both ways.
    """
    methods = wins.shape[-1]
    counted = wins + prior * (1 - np.eye(methods))
    games = counted + np.swapaxes(counted, -1, -2)
    strength = np.zeros(wins.shape[:-1])
    for _ in range(_STEPS):
        chance = chances(strength)
        slope = (counted - games * chance).sum(-1)
        bend = games * chance * (1 - chance)
        laplacian = np.eye(methods) * bend.sum(-1)[..., None] - bend
        # The strengths' common level is free; the added ones hold it at 0.
        step = np.linalg.solve(laplacian + 1 / methods, slope[..., None])[..., 0]
        strength = strength + np.clip(step, -1, 1)
        strength -= strength.mean(-1, keepdims=True)
        if np.abs(step).max() < 1e-9:
            break
    return strength


def chances(strength: Strengths) -> Wins:
    """P(the row is chosen over the column)."""
    result: np.ndarray = 1 / (1 + np.exp(strength[..., None, :] - strength[..., :, None]))
    return result
