"""Exposure and white balance of all views at once, from the sky they share.

A view shows radiance times its gain, so in logarithms view k sees cell t as g_k + x_t. All gains
are solved together with all cells by weighted least squares. Along a chain of neighbours small
errors would add up to a colour cast half-way round; here every overlap counts, that of the last
view with the first as well. Cells are eliminated first (they only couple to the views that see
them), which leaves one small symmetric system for each colour channel.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

OUTLIER = 0.15
"""A residual of this many ln counts half: a person, a reflection, an edge that parallax moved."""
_ROUNDS = 4
_OVERLAP_SIGMA, _TIE_SIGMA, _EXIF_SIGMA, _SAME_SIGMA = 0.05, 0.5, 0.03, 1.0
_INDEPENDENT_SR = 0.05  # neighbouring cells err alike: so many sr are one measurement


@dataclass(frozen=True, eq=False)
class Gains:
    """What the views' automatics had set, and the sky without it.

    Attributes:
        log_gain: of each view, ln; the first view has 0.
        cells: ln radiance of the coarse sky in the first view's unit; 0 where nothing was seen.
        trust: of each view in each cell, 0 to 1: low where it disagrees with the others.
        disagreement: of each view, weighted median of |residual|, ln.
    """

    log_gain: Float[np.ndarray, "views 3"]
    cells: Float[np.ndarray, "cells 3"]
    trust: Float[np.ndarray, "views cells"]
    disagreement: Float[np.ndarray, " views"]


def solve_gains(
    logs: Float[np.ndarray, "views cells 3"],
    weights: Float[np.ndarray, "views cells 3"],
    log_exposures: Float[np.ndarray, " views"],
    estimated: Float[np.ndarray, "views 3"],
) -> Gains:
    """Solve the gains of all views together.

    Args:
        logs: ln radiance that each view saw in each cell, in its own unit.
        weights: solid angle by which it saw it; 0 where it did not.
        log_exposures: what files say of the exposure, ln; nan where they do not.
        estimated: ln of the whole light that the network gives for each view, in its own unit. It
            ties views that share no sky, such as those of a front and a back camera.

    Returns:
        Gains relative to the first view.
    """
    robust = np.ones(weights.shape[:2], weights.dtype)
    for _ in range(_ROUNDS):
        gain, cells = _least_squares(logs, weights * robust[..., None], log_exposures, estimated)
        residual = logs - gain[:, None] - cells
        total = np.maximum(weights.sum(-1), 1e-12)
        size = np.sqrt((weights * residual**2).sum(-1) / total)
        robust = (1 / (1 + (size / OUTLIER) ** 2)).astype(weights.dtype)
    disagreement = np.array([_median(s, w.sum(-1)) for s, w in zip(size, weights, strict=True)])
    return Gains(gain, cells, robust, disagreement)


def _least_squares(
    logs: np.ndarray, weights: np.ndarray, log_exposures: np.ndarray, estimated: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    views = len(logs)
    matrices, rights = np.empty((3, views, views)), np.empty((3, views))
    for channel in range(3):
        w = weights[..., channel] * (1 / (_INDEPENDENT_SR * _OVERLAP_SIGMA**2))
        y = logs[..., channel]
        share = w / np.maximum(w.sum(0), 1e-12)
        matrices[channel] = np.diag(w.sum(1)) - w @ share.T
        rights[channel] = (w * (y - (share * y).sum(0))).sum(1)
        _tie(matrices[channel], rights[channel], estimated[:, channel])
    gain = _solve(matrices, rights, log_exposures)
    total = np.maximum(weights.sum(0), 1e-12)
    cells = (weights * (logs - gain[:, None])).sum(0) / total
    return gain, np.where(weights.sum(0) > 0, cells, 0)


def _tie(matrix: np.ndarray, right: np.ndarray, estimated: np.ndarray) -> None:
    """Add that the whole light is the same for all views, as far as a network can say."""
    views, weight = len(matrix), 1 / _TIE_SIGMA**2
    matrix += weight * (np.eye(views) - 1 / views)
    right += weight * (estimated - estimated.mean())


def _solve(matrices: np.ndarray, rights: np.ndarray, log_exposures: np.ndarray) -> np.ndarray:
    """All three channels together, because what EXIF says is about their mean."""
    views = len(log_exposures)
    whole, right = np.zeros((3, views, 3, views)), rights.copy()
    for channel in range(3):
        whole[channel, :, channel] = matrices[channel] + np.eye(views) / _SAME_SIGMA**2
    known = np.isfinite(log_exposures)
    if known.sum() > 1:
        centring = (np.eye(known.sum()) - 1 / known.sum()) / _EXIF_SIGMA**2
        places = np.ix_(known, known)
        pull = np.zeros(views)
        pull[known] = centring @ log_exposures[known]
        for one in range(3):
            right[one] += pull / 3
            for other in range(3):
                whole[one, :, other][places] += centring / 9
    flat = whole.reshape(3 * views, 3 * views)
    gain = np.linalg.solve(flat, right.ravel()).reshape(3, views).T
    return gain - gain[0]


def _median(values: np.ndarray, weights: np.ndarray) -> float:
    """Weighted median; 0 where nothing weighs."""
    if not weights.any():
        return 0.0
    order = np.argsort(values)
    share = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(share, share[-1] / 2)])
