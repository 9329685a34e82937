"""A split's result as tables in the terminal."""

from collections.abc import Sequence

from rich import box
from rich.table import Table

from deeplight.evaluate.result import SplitResult
from deeplight.evaluate.summary import SCENES, Interval, Summary

COLUMNS = {
    "l1_diffuse": "L1 diffuse",
    "l1_matte_silver": "L1 silver",
    "l1_mirror": "L1 mirror",
    "theta_rgb_deg": "θ rgb °",
    "radiance_absolute": "radiance err",
}
ONE_PLACE = "one place"  # instead of an interval: there is nothing to resample
LIGHT_COLUMNS = {
    "energy_stops_absolute": "energy stops",
    "direction_deg": "direction °",
    "intensity_stops_absolute": "light stops",
    "true_radiance_absolute": "radiance",
    "linear_diffuse": "linear d",
    "mirror_detail": "detail m",
}
_DIGITS = {"theta_rgb_deg": 1, "direction_deg": 0, "energy_stops_absolute": 2}


def all_tables(result: SplitResult) -> list[Table]:
    """Everything that is printed of a split."""
    ratios = [ratio_table(result, name) for name in result.methods]
    return [*terminal_tables(result), *(table for table in ratios if table.row_count)]


def terminal_tables(result: SplitResult) -> list[Table]:
    """Give one table for each kind of scene: mean ± sd over its 95 % interval, by estimator."""
    split = result.report.split
    tables = [
        _scene_table([s for s in result.summaries if s.scene == scene], f"{split}, {_title(scene)}")
        for scene in SCENES
        if any(s.scene == scene for s in result.summaries)
    ]
    return [*tables, light_table(result)] if result.knows_light else tables


def light_table(result: SplitResult) -> Table:
    """Give what only the true light shows: medians over the split, with their intervals."""
    title = f"{result.report.split}: against the true light"
    table = _table(title, "medians, below them the 95 % interval over places")
    for text in LIGHT_COLUMNS.values():
        table.add_column(text, justify="right", no_wrap=True)
    cells = {(s.estimator, s.metric): s for s in result.summaries if s.scene == "both"}
    for name in result.report.scores:
        table.add_row(name, *(_median(cells[name, metric]) for metric in LIGHT_COLUMNS))
    return table


def ratio_table(result: SplitResult, estimator: str) -> Table:
    """Give the L1 of `estimator` over that of each constant baseline, with intervals."""
    metrics = [metric for metric in COLUMNS if metric.startswith("l1_")]
    title = f"{result.report.split}: L1 of {estimator} over that of constant lighting"
    table = _table(title, "ratio of the means, 95 % interval over places")
    table.add_column("")
    for metric in metrics:
        table.add_column(COLUMNS[metric], justify="right", no_wrap=True)
    cells = {(s.scene, s.metric): s.ratio for s in result.summaries if s.estimator == estimator}
    for scene in SCENES:
        for reference in cells.get((scene, metrics[0]), ()):
            row = (_ratio(cells[scene, metric][reference]) for metric in metrics)
            table.add_row(scene, reference, *row)
    return table


def _scene_table(summaries: Sequence[Summary], title: str) -> Table:
    examples = max(s.examples + s.undefined for s in summaries)
    places = summaries[0].places
    title = f"{title}: {examples} examples in {places} place{'s' * (places != 1)}"
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
    digits = _DIGITS.get(summary.metric, 3)
    text = f"{summary.mean.value:.{digits}f}±{summary.sd:.{digits}f}"
    return text + _interval(summary, summary.mean, digits)


def _median(summary: Summary) -> str:
    digits = _DIGITS.get(summary.metric, 2)
    if not summary.examples:
        return f"-\n{summary.undefined} undef."
    return f"{summary.median.value:.{digits}f}" + _interval(summary, summary.median, digits)


def _interval(summary: Summary, interval: Interval, digits: int) -> str:
    text = f"\n{interval.low:.{digits}f}-{interval.high:.{digits}f}"
    if interval.of_one_place:
        text = f"\n{ONE_PLACE}"
    return text + (f"\n{summary.undefined} undef." if summary.undefined else "")


def _ratio(ratio: Interval) -> str:
    if ratio.of_one_place:
        return f"{ratio.value:.2f} ({ONE_PLACE})"
    return f"{ratio.value:.2f} ({ratio.low:.2f}-{ratio.high:.2f})"


def _title(scene: str) -> str:
    return "indoor and outdoor" if scene == "both" else scene
