"""Gains of views from the sky they share: exact where the model holds, robust where it does not."""

import numpy as np

from deeplight.fuse.gains import overlaps, solve_gains, trusted

VIEWS, CELLS = 12, 360
SIGMA = 0.002
UNKNOWN = np.full(VIEWS, np.nan)
RNG = np.random.default_rng(4)
SKY = RNG.normal(0, 1.5, (CELLS, 3))
GAINS = np.concatenate([np.zeros((1, 3)), RNG.normal(0, 0.8, (VIEWS - 1, 3))])


def ring() -> tuple[np.ndarray, np.ndarray]:
    """Views round a sky of cells, each seeing 60 of them, 30 apart: a closed turn."""
    weights = np.zeros((VIEWS, CELLS, 3), np.float32)
    for view in range(VIEWS):
        weights[view, np.arange(30 * view, 30 * view + 60) % CELLS] = 0.01
    logs = (SKY + GAINS[:, None] + RNG.normal(0, SIGMA, weights.shape)).astype(np.float32)
    return np.where(weights > 0, logs, 0), weights


def solved(logs: np.ndarray, weights: np.ndarray, exposures: np.ndarray = UNKNOWN) -> np.ndarray:
    differences, sure = np.zeros((2, VIEWS, VIEWS, 3))
    for k in range(1, VIEWS):
        found = overlaps(logs[k], weights[k], logs[:k], weights[:k])
        differences[k, :k], sure[k, :k] = found.difference, found.weight
        differences[:k, k], sure[:k, k] = -found.difference, found.weight
    return solve_gains(differences, sure, exposures, GAINS + 0.1)


def test_gains_come_back() -> None:
    assert np.abs(solved(*ring()) - GAINS).max() < 0.01


def test_people_are_outvoted() -> None:
    logs, weights = ring()
    for view in range(VIEWS):
        logs[view, np.arange(30 * view, 30 * view + 9) % CELLS] -= 2.0
    assert np.abs(solved(logs, weights) - GAINS).max() < 0.05


def test_errors_do_not_add_up_along_the_turn() -> None:
    """One overlap that lies is spread over the turn, and less than half is left in any view."""
    logs, weights = ring()
    logs[6:] += np.where(weights[6:] > 0, 0.2, 0).astype(np.float32)  # as if a cast crept in
    wrong = solved(logs, weights) - GAINS
    assert np.abs(wrong[6:] - 0.2).max() < 0.02  # the overlaps at 5-6 and 11-0 absorb nothing else


def test_files_exposures_settle_what_nothing_overlaps() -> None:
    logs, weights = ring()
    weights[6:] = 0
    exposures = GAINS.mean(1)
    free, fixed = solved(logs, weights), solved(logs, weights, exposures)
    missed = [np.abs(found[6:].mean(1) - GAINS[6:].mean(1)).max() for found in (free, fixed)]
    assert missed[1] < 0.1 < missed[0]


def test_the_disagreeing_view_is_not_trusted_where_it_disagrees() -> None:
    logs, weights = ring()
    weights = np.maximum(weights, 0.005)
    logs = (SKY + GAINS[:, None]).astype(np.float32) + np.zeros_like(weights)
    logs[3, 100:110] += 1.5
    trust = trusted(logs, weights, GAINS)
    assert trust[3, 100:110].max() < 0.1 < 0.9 < np.delete(trust, 3, 0)[:, 100:110].min()
