"""How fast models run here and how well, as rows: the measurement of `deeplight benchmark`."""

import csv
import json
import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING

from deeplight.deploy.timing import matrix_peak_gflops, runners, time_all
from deeplight.errors import ConfigError
from deeplight.estimators.network import MAX_THREADS, cores
from deeplight.io.atomic import replacing, results_folder

if TYPE_CHECKING:
    from deeplight.deploy.counting import NetworkSize

Progress = Callable[[str, int | None, int], None]
"""What is being done, of how many, how many are done."""


@dataclass(frozen=True)
class BenchmarkRow:
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


def measure_speed(
    models: Sequence[Path],
    threads: Sequence[int] = (),
    rounds: int = 50,
    without_xnnpack: bool = False,
    errors: Mapping[Path, Mapping[str, float]] = MappingProxyType({}),
    progress: Progress = lambda what, total, done: None,
) -> tuple[list[BenchmarkRow], dict[str, object]]:
    """Time models in turns, and say on what machine.

    Args:
        models: .onnx and .tflite files.
        threads: numbers of threads to try; none: 1 and all cores (at most 4).
        rounds: how often each model runs.
        without_xnnpack: time TFLite files also with LiteRT's plain kernels.
        errors: `l1_<sphere>` of each model, where it was measured.
        progress: called with what is being done, of how many, how many are done.

    Raises:
        InputError: a model cannot be used, or a number is below 1.
    """
    threads = tuple(dict.fromkeys(threads or sorted({1, min(MAX_THREADS, cores())})))
    if min(threads) < 1 or rounds < 1:
        raise ConfigError("--threads and --rounds of at least 1", "less", "ask for more")
    every = [r for model in models for r in runners(model, threads, without_xnnpack)]
    sizes = {model: _size(model) for model in models}
    progress("matrix products", None, 0)
    peaks = {count: matrix_peak_gflops(count) for count in threads}
    timings = time_all(every, rounds, lambda done: progress("timing", rounds + 3, done))
    peaks = {count: max(peak, matrix_peak_gflops(count)) for count, peak in peaks.items()}
    rows = []
    for runner, timing in zip(every, timings, strict=True):
        size = sizes[runner.model]
        work = None if size is None else 2e-6 * size.multiply_adds / timing.fastest_ms
        rows.append(
            BenchmarkRow(
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
    return rows, _machine(peaks, rounds)


def _size(model: Path) -> "NetworkSize | None":
    from deeplight.deploy.counting import network_size

    try:
        return network_size(model)
    except ModuleNotFoundError:  # onnx is not part of the base install
        return None


def _machine(peaks: dict[int, float], rounds: int) -> dict[str, object]:
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
        "rounds": rounds,
        "versions": versions,
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return named[0] if named else platform.processor() or platform.machine()


def write_benchmark(folder: Path, rows: Sequence[BenchmarkRow], machine: dict[str, object]) -> None:
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
