"""Typical, better and worse examples (the paper's figure of percentiles), and the worst of all."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Int64

from deeplight.dataset import DataSet
from deeplight.dataset.contact_sheet import GAP, Picture, column, label, row
from deeplight.evaluate.figures.spheres import block
from deeplight.evaluate.scores import Report

PERCENTILES = (25, 50, 75)
SCENES = ("indoor", "outdoor")


def percentile_figure(
    report: Report, data: DataSet, names: Sequence[str], ranked_by: str
) -> Picture:
    """Draw the examples at the 25th, 50th and 75th percentile of L_rec, indoor above outdoor.

    Left to right: the input, the filmed spheres, and those rendered in each estimator's light;
    diffuse, matte silver, mirror from top to bottom.

    Args:
        ranked_by: name of the estimator whose loss ranks the examples.
    """
    rows = []
    for scene in SCENES:
        ranked = ranking(report, ranked_by, scene)
        if not len(ranked):
            continue
        blocks = []
        for percentile in PERCENTILES:
            picture = block(report, data, at_percentile(ranked, percentile), names)
            blocks.append(column([label(f"{scene}, {percentile} %", picture.shape[1]), picture]))
        rows.append(row(blocks, 4 * GAP))
    return column(rows, 2 * GAP)


def worst_figures(
    report: Report, data: DataSet, names: Sequence[str], ranked_by: str, count: int = 6
) -> list[tuple[int, Picture]]:
    """The worst example of each of the `count` worst places: its position and a picture."""
    found: dict[str, int] = {}
    for position in ranking(report, ranked_by, "both")[::-1]:
        found.setdefault(str(report.places[position]), int(position))
        if len(found) == count:
            break
    return [(position, block(report, data, position, names)) for position in found.values()]


def ranking(report: Report, ranked_by: str, scene: str) -> Int64[np.ndarray, " ranked"]:
    """Positions of the examples of a kind of scene, from the least L_rec to the greatest."""
    inside = np.flatnonzero(report.inside(scene))
    loss = report.scores[ranked_by].reconstruction_loss()[inside]
    ranked: Int64[np.ndarray, " ranked"] = inside[np.argsort(loss)][: np.isfinite(loss).sum()]
    return ranked


def at_percentile(ranked: Int64[np.ndarray, " ranked"], percentile: float) -> int:
    return int(ranked[round(percentile / 100 * (len(ranked) - 1))])
