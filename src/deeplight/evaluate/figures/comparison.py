"""The same photos under every estimator: the ablation figure of the paper."""

from collections.abc import Sequence

from deeplight.dataset import DataSet
from deeplight.dataset.contact_sheet import GAP, Picture, column
from deeplight.evaluate.figures.percentiles import SCENES, at_percentile, ranking
from deeplight.evaluate.figures.spheres import block
from deeplight.evaluate.scores import Report


def comparison_figure(
    report: Report, data: DataSet, names: Sequence[str], ranked_by: str
) -> Picture:
    """A typical indoor photo above a typical outdoor one.

    Left to right: input, filmed spheres, and the spheres in the light of each of `names`. The
    example is the one whose L_rec, by `ranked_by`, is at the 40th percentile.
    """
    chosen = [
        at_percentile(ranked, 40)
        for scene in SCENES
        if len(ranked := ranking(report, ranked_by, scene))
    ]
    return column(
        [block(report, data, position, names) for position in dict.fromkeys(chosen)], 2 * GAP
    )
