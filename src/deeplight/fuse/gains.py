"""Exposure and white balance of all views at once, from the sky they share.

A view shows radiance times its gain, so where views i and j see the same cell of the sky, their
logarithms differ by g_i - g_j. Each overlap gives one such difference for each colour channel; the
gains of all views are solved from all overlaps together, by weighted least squares. Along a chain
of neighbours small errors would add up to a colour cast half-way round; here every overlap counts,
that of the last view with the first as well.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

OUTLIER = 0.15
"""A difference that misses its overlap's own by this many ln counts half: a person, a reflection,
an edge that parallax moved."""
_SCALES = (0.8, 0.4, 0.2, OUTLIER)
_OVERLAP_SIGMA, _TIE_SIGMA, _EXIF_SIGMA, _SAME_SIGMA = 0.02, 1.0, 0.03, 3.0
_INDEPENDENT_SR = 0.05  # neighbouring cells err alike: this number of sr is one measurement

Cells = Float[np.ndarray, "views cells 3"]


@dataclass(frozen=True, eq=False)
class Overlap:
    """What one view and each of several others say about the sky they share.

    Attributes:
        difference: ln by which the others are brighter; 0 where nothing is shared.
        weight: how sure that is: shared solid angle less outliers, sr.
        shared: shared solid angle with its outliers, summed over the channels, sr.
        disagreement: mean of |rest| beyond that difference, ln: of the same sky about 0.1.
    """

    difference: Float[np.ndarray, "views 3"]
    weight: Float[np.ndarray, "views 3"]
    shared: Float[np.ndarray, " views"]
    disagreement: Float[np.ndarray, " views"]


def overlaps(
    own: Float[np.ndarray, "cells 3"],
    own_weight: Float[np.ndarray, "cells 3"],
    logs: Cells,
    weights: Cells,
) -> Overlap:
    """Compare one view with others, cell by cell, robustly.

    Args:
        own, own_weight: ln radiance in its own unit and solid angle of the cells it saw.
        logs, weights: the same of the others.
    """
    seen = np.flatnonzero(own_weight.any(1))
    shared = np.minimum(weights[:, seen], own_weight[seen])
    beyond = logs[:, seen] - own[seen]
    total = np.maximum(shared.sum(1), 1e-12)
    difference = (shared * beyond).sum(1) / total
    weight = shared
    for scale in _SCALES:
        weight = shared / (1 + ((beyond - difference[:, None]) / scale) ** 2)
        difference = (weight * beyond).sum(1) / np.maximum(weight.sum(1), 1e-12)
    rest = (shared * np.abs(beyond - difference[:, None])).sum((1, 2)) / total.sum(1)
    return Overlap(difference, weight.sum(1), shared.sum((1, 2)), rest)


def solve_gains(
    differences: Float[np.ndarray, "views views 3"],
    weights: Float[np.ndarray, "views views 3"],
    log_exposures: Float[np.ndarray, " views"],
    log_power: Float[np.ndarray, "views 3"],
) -> Float[np.ndarray, "views 3"]:
    """Solve the gains of all views together.

    Args:
        differences: g_j - g_i at [i, j], as the overlaps say.
        weights: their solid angles; 0 where i and j share nothing. Symmetric.
        log_exposures: what files say of the exposure, ln; nan where they do not.
        log_power: ln of the whole light that the network gives for each view, in its own unit. It
            ties views that share no sky, such as those of a front and a back camera.

    Returns:
        ln gain of each view; the first has 0.
    """
    sure = weights * (1 / (_INDEPENDENT_SR * _OVERLAP_SIGMA**2))
    views = len(sure)
    centring = np.eye(views) - 1 / views
    matrices, rights = np.empty((3, views, views)), np.empty((3, views))
    for channel in range(3):
        w = sure[..., channel]
        matrices[channel] = np.diag(w.sum(1)) - w + centring / _TIE_SIGMA**2
        rights[channel] = (w * differences[..., channel]).sum(0)
        rights[channel] += centring @ log_power[:, channel] / _TIE_SIGMA**2
    return _solve(matrices, rights, log_exposures)


def _solve(matrices: np.ndarray, rights: np.ndarray, log_exposures: np.ndarray) -> np.ndarray:
    """All three channels; together only where EXIF data speaks, which is about their mean."""
    views = len(log_exposures)
    matrices = matrices + np.eye(views) / _SAME_SIGMA**2
    known = np.isfinite(log_exposures)
    if known.sum() < 2:
        gain = np.linalg.solve(matrices, rights[..., None])[..., 0].T
        return gain - gain[0]
    whole, right = np.zeros((3, views, 3, views)), rights.copy()
    pull = np.zeros((views, views))
    pull[np.ix_(known, known)] = np.eye(known.sum()) - 1 / known.sum()
    pull /= _EXIF_SIGMA**2
    for one in range(3):
        right[one] += pull @ np.where(known, log_exposures, 0) / 3
        whole[one, :, one] = matrices[one]
        for other in range(3):
            whole[one, :, other] += pull / 9
    flat = whole.reshape(3 * views, 3 * views)
    gain = np.linalg.solve(flat, right.ravel()).reshape(3, views).T
    return gain - gain[0]


def trusted(
    logs: Cells, weights: Cells, log_gain: Float[np.ndarray, "views 3"]
) -> Float[np.ndarray, "views cells"]:
    """How far each view agrees with the others in each cell, 0 to 1; 1 where it is alone."""
    aligned = logs - log_gain[:, None].astype(np.float32)
    trust = np.ones(weights.shape[:2], np.float32)
    for _ in range(3):
        counted = weights * trust[..., None]
        mean = (counted * aligned).sum(0) / np.maximum(counted.sum(0), 1e-12)
        size = (weights * np.abs(aligned - mean)).sum(-1) / np.maximum(weights.sum(-1), 1e-12)
        trust = 1 / (1 + (size / OUTLIER) ** 2)
    return trust
