"""A report as a table in the terminal, and as files: results.json and results.csv."""

import csv
import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich import box
from rich.table import Table

from deeplight.evaluate.run import Report
from deeplight.evaluate.summary import SCENES, Interval, Summary
from deeplight.io.atomic import replacing

COLUMNS = {
    "l1_diffuse": "L1 diffuse",
    "l1_matte_silver": "L1 silver",
    "l1_mirror": "L1 mirror",
    "theta_rgb_deg": "θ rgb °",
    "radiance_absolute": "radiance err",
}


def terminal_tables(summaries: Sequence[Summary], split: str) -> list[Table]:
    """Give one table for each kind of scene: mean ± sd over its 95 % interval, by estimator."""
    return [
        _scene_table([s for s in summaries if s.scene == scene], f"{split}, {_title(scene)}")
        for scene in SCENES
        if any(s.scene == scene for s in summaries)
    ]


def ratio_table(summaries: Sequence[Summary], split: str, estimator: str) -> Table:
    """Give the L1 of `estimator` over that of each constant baseline, with intervals."""
    metrics = [metric for metric in COLUMNS if metric.startswith("l1_")]
    title = f"{split}: L1 of {estimator} over that of constant lighting"
    table = _table(title, "ratio of the means, 95 % interval over places")
    table.add_column("")
    for metric in metrics:
        table.add_column(COLUMNS[metric], justify="right", no_wrap=True)
    cells = {(s.scene, s.metric): s.ratio for s in summaries if s.estimator == estimator}
    for scene in SCENES:
        for reference in cells.get((scene, metrics[0]), ()):
            row = (_ratio(cells[scene, metric][reference]) for metric in metrics)
            table.add_row(scene, reference, *row)
    return table


def write_results(
    folder: Path, report: Report, summaries: Sequence[Summary], facts: Mapping[str, Any]
) -> None:
    """Write results.json (summaries and `facts`) and results.csv (one row per example).

    Undefined numbers are null in JSON and empty in CSV.

    Raises:
        OSError: the folder cannot be written.
    """
    values = {**facts, "split": report.split, "summary": [s.to_dict() for s in summaries]}
    with replacing(folder / "results.json") as temporary:
        text = json.dumps(_without_nan(values), indent=1, allow_nan=False)
        temporary.write_text(text + "\n", encoding="utf-8")
    with (
        replacing(folder / "results.csv") as temporary,
        temporary.open("w", newline="", encoding="utf-8") as file,
    ):
        _write_rows(csv.writer(file), report)


def _write_rows(writer: Any, report: Report) -> None:
    metrics = list(next(iter(report.scores.values())).metrics())
    shared = ["key", "place", "scene", "diffuse_clipped"]
    writer.writerow(["estimator", *shared, *metrics, "black_pixels"])
    for name, scores in report.scores.items():
        columns = scores.metrics()
        for number, key in enumerate(report.keys):
            clipped = f"{report.diffuse_clipped[number]:.4f}"
            row = [name, key, report.places[number], report.scenes[number], clipped]
            row += [_cell(columns[metric][number]) for metric in metrics]
            writer.writerow([*row, int(scores.black_pixels[number])])


def _scene_table(summaries: Sequence[Summary], title: str) -> Table:
    examples = max(s.examples + s.undefined for s in summaries)
    title = f"{title}: {examples} examples in {summaries[0].places} places"
    table = _table(title, "mean±sd over examples, below it the 95 % interval over places")
    for text in COLUMNS.values():
        table.add_column(text, justify="right", no_wrap=True)
    cells = {(s.estimator, s.metric): s for s in summaries}
    for estimator in dict.fromkeys(s.estimator for s in summaries):
        table.add_row(estimator, *(_mean(cells[estimator, metric]) for metric in COLUMNS))
    return table


def _table(title: str, caption: str) -> Table:
    """Give an empty table that five columns of numbers keep within 80 characters."""
    table = Table(title=title, caption=caption, box=box.SIMPLE_HEAD, padding=0, pad_edge=False)
    table.add_column("", no_wrap=True)
    return table


def _mean(summary: Summary) -> str:
    digits = 1 if summary.metric == "theta_rgb_deg" else 3
    mean = summary.mean
    text = f"{mean.value:.{digits}f}±{summary.sd:.{digits}f}"
    text += f"\n{mean.low:.{digits}f}-{mean.high:.{digits}f}"
    return text + (f"\n{summary.undefined} undef." if summary.undefined else "")


def _ratio(ratio: Interval) -> str:
    return f"{ratio.value:.2f} ({ratio.low:.2f}-{ratio.high:.2f})"


def _title(scene: str) -> str:
    return "indoor and outdoor" if scene == "both" else scene


def _cell(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else ""


def _without_nan(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Mapping):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(item) for item in value]
    return value
