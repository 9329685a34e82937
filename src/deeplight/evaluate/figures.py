"""Pictures to judge by eye: typical, better and worse examples, filmed and predicted."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, UInt8

from deeplight.camera_response import encode, soft_clip
from deeplight.dataset import DataSet, Example
from deeplight.dataset.contact_sheet import GAP, PAPER, Picture, column, enlarged, label, row
from deeplight.evaluate.run import BatchEstimator, Report, rendered_radiance
from deeplight.preprocess import normalise
from deeplight.reflectance import rig_bases
from deeplight.sphere import LOSS_WEIGHTS, SPHERES, SphereView

PERCENTILES = (25, 50, 75)
SPHERE_PX = 64
ORDER = ("diffuse", "matte_silver", "mirror")  # top to bottom, as in the paper


def percentile_figure(
    report: Report, data: DataSet, estimators: Sequence[BatchEstimator], ranked_by: str
) -> Picture:
    """Draw the examples at the 25th, 50th and 75th percentile of L_rec, indoor above outdoor.

    Left to right: the input, the filmed spheres, and those rendered in each estimator's light;
    diffuse, matte silver, mirror from top to bottom (the paper's figure of percentiles).

    Args:
        ranked_by: name of the estimator whose loss ranks the examples.
    """
    index = data.index(report.split)
    rows = []
    for scene in ("indoor", "outdoor"):
        inside = np.flatnonzero(report.scenes == scene)
        loss = sum(LOSS_WEIGHTS[s] * report.scores[ranked_by].l1[s][inside] for s in SPHERES)
        ranked = inside[np.argsort(loss)]  # NaN comes last
        if not len(ranked):
            continue
        blocks = []
        for percentile in PERCENTILES:
            chosen = ranked[round(percentile / 100 * (len(ranked) - 1))]
            block = _block(index[int(report.numbers[chosen])], data, estimators)
            blocks.append(column([label(f"{scene}, {percentile} %", block.shape[1]), block]))
        rows.append(row(blocks, 4 * GAP))
    return column(rows, 2 * GAP)


def _block(example: Example, data: DataSet, estimators: Sequence[BatchEstimator]) -> Picture:
    """One example: input, filmed spheres, predicted spheres."""
    rig = data.rigs[example.meta.rig]
    views, bases = rig.views, rig_bases(rig)
    columns = [_column("filmed", {n: p / 255 for n, p in example.spheres.items()}, views)]
    inputs = normalise(example.background[None])
    for estimator in estimators:
        radiance = rendered_radiance(bases, estimator.estimate_inputs(inputs))
        pixels = {name: encode(soft_clip(r[0])) for name, r in radiance.items()}
        columns.append(_column(estimator.name, pixels, views))
    shown = column([_title("input", example.background.shape[1]), example.background])
    return row([shown, *columns], GAP // 2)


def _column(
    title: str, pixels: dict[str, Float[np.ndarray, "size size 3"]], views: dict[str, SphereView]
) -> Picture:
    spheres = [enlarged(_cut_out(pixels[name], views[name]), SPHERE_PX) for name in ORDER]
    return column([_title(title, SPHERE_PX), *spheres])


def _title(name: str, width: int) -> Picture:
    """Two lines, since a name is longer than a sphere is wide."""
    first, _, rest = name.partition("_")
    return column([label(first, width), label(rest.replace("_", " "), width)])


def _cut_out(
    pixels: Float[np.ndarray, "size size 3"], view: SphereView
) -> UInt8[np.ndarray, "size size 3"]:
    alpha = view.alpha()[..., None]
    shown = alpha * np.clip(np.nan_to_num(pixels), 0, 1) * 255 + (1 - alpha) * PAPER
    picture: np.ndarray = np.floor(shown + 0.5).astype(np.uint8)
    return picture
