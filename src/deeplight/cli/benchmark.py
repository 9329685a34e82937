"""Time models on this machine, by runtime and threads, next to its matrix-product peak.

deeplight benchmark

deeplight benchmark mine.onnx mine.tflite --threads 1 2 --data data/sim --out out/benchmark

With --data also the L1 of the spheres, with --out also benchmark.json and .csv.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from rich.table import Table

    from deeplight.deploy.benchmark import BenchmarkRow


@dataclass(frozen=True)
class Args:
    """Options of `deeplight benchmark`."""

    models: Annotated[
        tuple[Path, ...],
        tyro.conf.Positional,
        tyro.conf.arg(metavar="MODEL...", help_behavior_hint="(optional)"),
    ] = ()
    """.onnx and .tflite files; left out, the model that comes with deeplight."""
    threads: Annotated[tuple[int, ...], tyro.conf.arg(help_behavior_hint="(optional)")] = ()
    """Numbers of threads to try; left out, 1 and all cores (at most 4)."""
    rounds: int = 50
    """How often each model runs, in turns with the others."""
    without_xnnpack: bool = False
    """Time TFLite files also with LiteRT's plain kernels."""
    data: Path | None = None
    """Data set to measure the L1 of the spheres on."""
    split: str = "val"
    """Its split."""
    examples: int | None = None
    """At most this number of its examples, evenly spread."""
    out: Path | None = None
    """Folder for benchmark.json and benchmark.csv."""


def run(args: Args) -> None:
    """Measure with a progress bar, print the table, write the files."""
    from deeplight.cli.flags import refuse_unused
    from deeplight.cli.screen import print_tables, progress_bar
    from deeplight.deploy.benchmark import measure_speed, write_benchmark
    from deeplight.estimators.onnx import shipped_model

    if args.data is None:
        refuse_unused(args, "without --data", "split", "examples")
    models = args.models or (shipped_model(),)
    with progress_bar("timing") as bar:

        def show(what: str, total: int | None, done: int) -> None:
            bar.name(what)
            bar.reach(done, total)

        errors = _errors(args, models, show)
        rows, machine = measure_speed(
            models, args.threads, args.rounds, args.without_xnnpack, errors, show
        )
    machine["split"] = args.split if args.data else None
    print_tables([_table(rows, machine)])
    if args.out is not None:
        write_benchmark(args.out, rows, machine)


def _errors(
    args: Args, models: "Sequence[Path]", show: "Callable[[str, int | None, int], None]"
) -> dict[Path, dict[str, float]]:
    """Mean L1 of the spheres of each model, if a data set is given."""
    if args.data is None:
        return {}
    from deeplight.dataset import open_dataset
    from deeplight.estimators.open import open_model
    from deeplight.evaluate.models import NamedModel
    from deeplight.evaluate.run import evaluate
    from deeplight.sphere import SPHERES

    data, found = open_dataset(args.data), {}
    for number, model in enumerate(models):
        show(f"L1 of {model.name}", len(models), number)
        named = NamedModel(model.name, open_model(model))
        scores = evaluate([named], data, args.split, args.examples).scores[model.name]
        found[model] = {f"l1_{name}": float(scores.l1[name].mean()) for name in SPHERES}
    return found


def _table(rows: "Sequence[BenchmarkRow]", machine: dict[str, object]) -> "Table":
    """The rows for a person."""
    from rich.table import Table

    peaks = machine["matrix_peak_gflops"]
    assert isinstance(peaks, dict)
    speeds = ", ".join(f"{peak:.0f} GFLOP/s with {count}" for count, peak in peaks.items())
    title = f"{machine['processor']}, {machine['cores']} cores; float32 matrix product: {speeds}"
    shown = Table(title=title, title_justify="left")
    with_l1 = any(row.l1_mirror is not None for row in rows)
    for name in ("model", "runtime", "threads", "MB", "weights, M", "multiply-adds, M"):
        shown.add_column(name)
    for name in ("median, ms", "p10 to p90", "fastest", "of peak"):
        shown.add_column(name, justify="right")
    if with_l1:
        shown.add_column("L1 mirror / silver / diffuse")
    for row in rows:
        shown.add_row(*_cells(row), *([_l1_cell(row)] if with_l1 else []))
    return shown


def _cells(row: "BenchmarkRow") -> list[str]:
    def millions(count: int | None) -> str:
        return "" if count is None else f"{count / 1e6:.1f}"

    return [
        row.model,
        row.runtime,
        str(row.threads),
        f"{row.bytes / 1e6:.1f}",
        millions(row.parameters),
        millions(row.multiply_adds),
        f"{row.median_ms:.1f}",
        f"{row.p10_ms:.1f} to {row.p90_ms:.1f}",
        f"{row.fastest_ms:.1f}",
        "" if row.of_peak is None else f"{row.of_peak:.2f}",
    ]


def _l1_cell(row: "BenchmarkRow") -> str:
    found = (row.l1_mirror, row.l1_matte_silver, row.l1_diffuse)
    return " / ".join("" if value is None else f"{value:.4f}" for value in found)
