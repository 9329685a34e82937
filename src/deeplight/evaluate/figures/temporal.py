"""Four frames one after another, filmed and rendered (the paper's temporal figure)."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float64, Int64

from deeplight.dataset import DataSet
from deeplight.dataset.contact_sheet import GAP, Picture, column, label, row
from deeplight.evaluate.figures.spheres import answer_column, example_at, filmed_column, title
from deeplight.evaluate.scores import Report
from deeplight.evaluate.temporal import Changes, runs_of_frames


def temporal_figure(
    report: Report, data: DataSet, changed: Changes, names: Sequence[str], ranked_by: str
) -> Picture | None:
    """The inputs above, below them the spheres of those frames: filmed, then of each of `names`.

    Shown is the take whose flicker under `ranked_by` is the median of all; a take of fewer than
    four frames shows what it has. None where no take has neighbouring frames.
    """
    runs = runs_of_frames(report, changed.pairs)
    if not runs:
        return None
    longest = max(len(run) for run in runs)
    runs = [run for run in runs if len(run) == longest]
    change = [_mean_change(run, changed, ranked_by) for run in runs]
    run = runs[int(np.argsort(change)[len(change) // 2])]
    examples = [example_at(report, data, int(position)) for position in run]
    inputs = [
        column(
            [label(f"frame {example.meta.frame}", example.background.shape[1]), example.background]
        )
        for example in examples
    ]
    groups = [("filmed", [filmed_column(example, data) for example in examples])]
    groups += [
        (name, [answer_column(report, data, int(position), name) for position in run])
        for name in names
    ]
    shown = []
    for name, columns in groups:
        spheres = row(columns)
        shown.append(column([title(name, spheres.shape[1]), spheres]))
    return column([row(inputs, GAP), row(shown, 2 * GAP)], GAP)


def _mean_change(run: Int64[np.ndarray, " frames"], changed: Changes, name: str) -> float:
    inside = np.isin(changed.pairs, run).all(1)
    values: Float64[np.ndarray, " pairs"] = changed.change[name][inside]
    return float(values.mean())
