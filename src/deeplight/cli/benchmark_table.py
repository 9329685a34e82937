"""What `deeplight benchmark` measures, and its table."""

import csv
import json
import platform
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING

from rich.table import Table

from deeplight.deploy.timing import matrix_peak_gflops, runners, time_all
from deeplight.errors import ConfigError
from deeplight.estimators.network import MAX_THREADS, cores
from deeplight.estimators.onnx import shipped_model
from deeplight.io.atomic import replacing, results_folder
from deeplight.sphere import SPHERES

if TYPE_CHECKING:
    from deeplight.cli.benchmark import Args
    from deeplight.deploy.counting import NetworkSize

Told = Callable[[str, int | None, int], None]
"""What is being done, of how many, how many are done."""


@dataclass(frozen=True)
class Row:
    """One model in one runtime with one number of threads; None where it was not measured."""

    model: str
    runtime: str
    threads: int
    bytes: int
    parameters: int | None
    multiply_adds: int | None
    median_ms: float
    p10_ms: float
    p90_ms: float
    fastest_ms: float
    of_peak: float | None
    """Multiply-adds a second, each two operations, of the fastest run, over the matrix peak."""
    l1_mirror: float | None = None
    l1_matte_silver: float | None = None
    l1_diffuse: float | None = None


def checked(args: "Args") -> tuple[int, ...]:
    """The numbers of threads to try.

    Raises:
        ConfigError: one is below 1, or there are no rounds.
    """
    threads = args.threads or tuple(sorted({1, min(MAX_THREADS, cores())}))
    if min(threads) < 1 or args.rounds < 1:
        raise ConfigError("--threads and --rounds of at least 1", "less", "ask for more")
    return tuple(dict.fromkeys(threads))


def measured(
    args: "Args", threads: Sequence[int], told: Told
) -> tuple[list[Row], dict[str, object]]:
    """Time all, and say on what machine.

    Raises:
        InputError: a model or the data set cannot be used.
    """
    models = args.models or (shipped_model(),)
    every = [r for model in models for r in runners(model, threads, args.without_xnnpack)]
    errors = _l1(args, models, told)
    sizes = {model: _size(model) for model in models}
    told("matrix products", None, 0)
    peaks = {count: matrix_peak_gflops(count) for count in threads}
    timings = time_all(every, args.rounds, lambda done: told("timing", args.rounds + 3, done))
    peaks = {count: max(peak, matrix_peak_gflops(count)) for count, peak in peaks.items()}
    rows = []
    for runner, timing in zip(every, timings, strict=True):
        size = sizes[runner.model]
        work = None if size is None else 2e-6 * size.multiply_adds / timing.fastest_ms
        rows.append(
            Row(
                model=runner.model.name,
                runtime=runner.runtime,
                threads=runner.threads,
                bytes=runner.model.stat().st_size,
                parameters=None if size is None else size.parameters,
                multiply_adds=None if size is None else size.multiply_adds,
                **asdict(timing),
                of_peak=None if work is None else work / peaks[runner.threads],
                **errors.get(runner.model, {}),
            )
        )
    return rows, _machine(args, peaks)


def _l1(args: "Args", models: Sequence[Path], told: Told) -> dict[Path, dict[str, float]]:
    """Mean L1 of the spheres of each model, if a data set is given."""
    if args.data is None:
        return {}
    from deeplight.dataset import open_dataset
    from deeplight.estimators.open import open_model
    from deeplight.evaluate.models import NamedModel
    from deeplight.evaluate.run import evaluate

    data, found = open_dataset(args.data), {}
    for number, model in enumerate(models):
        told(f"L1 of {model.name}", len(models), number)
        named = NamedModel(model.name, open_model(model))
        scores = evaluate([named], data, args.split, args.examples).scores[model.name]
        found[model] = {f"l1_{name}": float(scores.l1[name].mean()) for name in SPHERES}
    return found


def _size(model: Path) -> "NetworkSize | None":
    from deeplight.deploy.counting import network_size

    try:
        return network_size(model)
    except ModuleNotFoundError:  # onnx is not part of the base install
        return None


def _machine(args: "Args", peaks: dict[int, float]) -> dict[str, object]:
    versions = {}
    for name in ("deeplight", "onnxruntime", "ai-edge-litert", "numpy"):
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            continue
    return {
        "processor": _processor(),
        "cores": cores(),
        "matrix_peak_gflops": {str(count): peak for count, peak in peaks.items()},
        "rounds": args.rounds,
        "split": args.split if args.data else None,
        "versions": versions,
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.processor() or platform.machine()


def table(rows: Sequence[Row], machine: dict[str, object]) -> Table:
    """The rows for a person."""
    peaks = machine["matrix_peak_gflops"]
    assert isinstance(peaks, dict)
    told = ", ".join(f"{peak:.0f} GFLOP/s with {count}" for count, peak in peaks.items())
    title = f"{machine['processor']}, {machine['cores']} cores; float32 matrix product: {told}"
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


def _cells(row: Row) -> list[str]:
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


def _l1_cell(row: Row) -> str:
    found = (row.l1_mirror, row.l1_matte_silver, row.l1_diffuse)
    return " / ".join("" if value is None else f"{value:.4f}" for value in found)


def write(folder: Path, rows: Sequence[Row], machine: dict[str, object]) -> None:
    """benchmark.json and benchmark.csv."""
    flat = [asdict(row) for row in rows]
    with results_folder(folder):
        with replacing(folder / "benchmark.json") as temporary:
            text = json.dumps({"machine": machine, "rows": flat}, indent=1)
            temporary.write_text(text + "\n", encoding="utf-8")
        with (
            replacing(folder / "benchmark.csv") as temporary,
            temporary.open("w", newline="", encoding="utf-8") as file,
        ):
            writer = csv.DictWriter(file, flat[0])
            writer.writeheader()
            writer.writerows(flat)
