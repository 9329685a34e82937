"""The files of an evaluation: numbers, figures, and how they came about."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from deeplight.dataset import DataSet
from deeplight.evaluate.figures import percentile_figure
from deeplight.evaluate.run import BatchEstimator, Report
from deeplight.evaluate.summary import RESAMPLES, SEED, Summary
from deeplight.evaluate.tables import write_results
from deeplight.io.image import write_png
from deeplight.io.run_record import write_run_toml


def write_files(
    folder: Path,
    report: Report,
    summaries: Sequence[Summary],
    data: DataSet,
    estimators: Sequence[BatchEstimator],
    model: Mapping[str, str],
) -> None:
    """Write results.json, results.csv, percentiles.png and run.toml to `folder`.

    Args:
        estimators: those of the report; the first ranks the examples of the figure.
        model: what to say of the model: its file, hash and training data.

    Raises:
        OSError: the folder cannot be written.
    """
    facts: dict[str, Any] = {
        "examples": len(report.keys),
        "data_manifest_sha256": data.manifest_sha256,
        **{f"model_{name}": value for name, value in model.items()},
        "bootstrap_seed": SEED,
        "bootstrap_resamples": RESAMPLES,
    }
    write_results(folder, report, summaries, facts)
    figure = percentile_figure(report, data, estimators, ranked_by=estimators[0].name)
    write_png(folder / "percentiles.png", figure)
    settings = {"data": str(data.folder), "split": report.split}
    write_run_toml(folder, {"settings": settings}, facts)
