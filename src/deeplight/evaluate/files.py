"""The files of an evaluation: numbers, pictures, the report, and how they came about."""

import csv
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from deeplight.dataset import DataSet
from deeplight.evaluate.bootstrap import RESAMPLES, SEED
from deeplight.evaluate.models import NamedModel
from deeplight.evaluate.protocols.stylelight_2022 import summed_up
from deeplight.evaluate.report import Pictures, drawn, report_page
from deeplight.evaluate.result import SplitResult
from deeplight.evaluate.scores import Report
from deeplight.io.atomic import replacing
from deeplight.io.photos import write_png
from deeplight.report.page import Page
from deeplight.report.run_record import write_run_toml

VERSION = 2  # of results.json: 1 had one split and no medians


def check_can_write(folder: Path | None) -> None:
    """Refuse a missing template engine before hours of work, if files are wanted at all.

    Raises:
        MissingExtraError: it is not installed.
    """
    if folder is not None:
        Page("").html()


def write_files(
    folder: Path, results: Sequence[SplitResult], data: DataSet, models: Sequence[NamedModel]
) -> None:
    """Write report.html, results.json, results.csv, pictures/*.png and run.toml to `folder`.

    Raises:
        MissingExtraError: the report's template engine is not installed.
        OSError: the folder cannot be written.
    """
    facts = _facts(results, data, models)
    write_results(folder, results, facts)
    pictures = [drawn(result, data) for result in results]
    for result, shown in zip(results, pictures, strict=True):
        _write_pictures(folder / "pictures", result.report.split, shown)
    report_page(results, pictures, facts).write(folder / "report.html")
    splits = [result.report.split for result in results]
    settings = {"data": str(data.folder), "split": splits[0], "splits": splits}
    plain = {name: value for name, value in facts.items() if not isinstance(value, Mapping)}
    plain |= {f"model_{name}": value for name, value in facts["models"][models[0].name].items()}
    write_run_toml(folder, {"settings": settings, **_sections(facts)}, plain)


def write_results(folder: Path, results: Sequence[SplitResult], facts: Mapping[str, Any]) -> None:
    """Write results.json (summaries and `facts`) and results.csv (one row per example).

    Undefined numbers are null in JSON and empty in CSV.

    Raises:
        OSError: the folder cannot be written.
    """
    values = {
        "version": VERSION,
        **facts,
        "split": results[0].report.split,
        "summary": [s.to_dict() for result in results for s in result.summaries],
        "flicker": {r.report.split: [f.to_dict() for f in r.flicker] for r in results},
        "calibration": {r.report.split: [asdict(c) for c in r.calibration] for r in results},
        "three_spheres": {r.report.split: _protocols(r) for r in results if r.protocols},
    }
    with replacing(folder / "results.json") as temporary:
        text = json.dumps(_without_nan(values), indent=1, allow_nan=False)
        temporary.write_text(text + "\n", encoding="utf-8")
    with (
        replacing(folder / "results.csv") as temporary,
        temporary.open("w", newline="", encoding="utf-8") as file,
    ):
        _write_rows(csv.writer(file), [result.report for result in results])


def _facts(
    results: Sequence[SplitResult], data: DataSet, models: Sequence[NamedModel]
) -> dict[str, Any]:
    reports = [result.report for result in results]
    return {
        "examples": len(reports[0].keys),
        "data_manifest_sha256": data.manifest_sha256,
        "reflectance_bases": data.bases_sha256,
        "bootstrap_seed": SEED,
        "bootstrap_resamples": RESAMPLES,
        "models": {model.name: model.facts for model in models},
        "splits": {
            report.split: {"examples": len(report.keys), "places": len(set(report.places))}
            for report in reports
        },
    }


def _sections(facts: Mapping[str, Any]) -> dict[str, dict[str, str]]:
    """One section of run.toml for each model."""
    return {f'model."{name}"': about for name, about in facts["models"].items()}


def _protocols(result: SplitResult) -> dict[str, list[dict[str, Any]]]:
    names = ("estimator", "metric", "mean", "undefined")
    return {
        form: [dict(zip(names, row, strict=True)) for row in summed_up(found)]
        for form, found in result.protocols.items()
    }


def _write_pictures(folder: Path, split: str, shown: Pictures) -> None:
    for name, picture in shown.by_name().items():
        write_png(folder / f"{name}_{split}.png", picture)


def _write_rows(writer: Any, reports: Sequence[Report]) -> None:
    metrics: dict[str, None] = {}
    for report in reports:
        for scores in report.scores.values():
            metrics |= dict.fromkeys(scores.metrics())
    shared = ["split", "key", "place", "scene", "diffuse_clipped"]
    writer.writerow(["estimator", *shared, *metrics, "black_pixels"])
    for report in reports:
        for name, scores in report.scores.items():
            columns = scores.metrics()
            for number, key in enumerate(report.keys):
                clipped = f"{report.diffuse_clipped[number]:.4f}"
                row = [
                    name,
                    report.split,
                    key,
                    report.places[number],
                    report.scenes[number],
                    clipped,
                ]
                row += [_cell(columns[m][number]) if m in columns else "" for m in metrics]
                writer.writerow([*row, int(scores.black_pixels[number])])


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
