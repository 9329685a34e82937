"""How long networks take on this machine, and how near that is to what its cores can do.

Every round runs each network once, so other work slows all alike; compare within one table.
"""

import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from deeplight.errors import ModelError
from deeplight.estimators.network import NetworkEstimator
from deeplight.estimators.open import LITERT, open_model

WARM_UP = 3
MATRIX = 512
_PEAK = f"""
import time, numpy as np
a = np.random.default_rng(0).random(({MATRIX}, {MATRIX}), np.float32)
best = 1e9
for _ in range(60):
    started = time.perf_counter(); a @ a; best = min(best, time.perf_counter() - started)
print(2 * {MATRIX}**3 / best / 1e9)
"""


@dataclass(frozen=True)
class Runner:
    """A network, opened to be timed."""

    model: Path
    runtime: str
    threads: int
    network: NetworkEstimator


@dataclass(frozen=True)
class Timing:
    """Milliseconds of one photo, the picture being prepared already."""

    median_ms: float
    p10_ms: float
    p90_ms: float
    fastest_ms: float


def runners(model: Path, threads: Sequence[int], without_xnnpack: bool = False) -> list[Runner]:
    """Open a model once for each number of threads, and for each way to run it.

    Args:
        without_xnnpack: also run TFLite files with LiteRT's plain kernels.

    Raises:
        InputError: the model cannot be used here.
    """
    litert = model.suffix.lower() == LITERT
    name = "LiteRT" if litert else "onnxruntime"
    found = [Runner(model, name, count, open_model(model, count)) for count in threads]
    if litert and without_xnnpack:
        from deeplight.estimators.litert import LiteRTEstimator

        found += [
            Runner(model, "LiteRT without XNNPACK", n, LiteRTEstimator(model, n, xnnpack=False))
            for n in threads
        ]
    return found


def time_all(
    every: Sequence[Runner], rounds: int, progress: Callable[[int], None] = lambda done: None
) -> list[Timing]:
    """Time each runner `rounds` times, in turns.

    Raises:
        ModelError: a network fails on its own input.
    """
    random = np.random.default_rng(0)
    inputs = [
        random.uniform(c.input_low, c.input_high, (1, 3, c.height, c.width)).astype(np.float32)
        for c in (runner.network.contract for runner in every)
    ]
    times: list[list[float]] = [[] for _ in every]
    for number in range(-WARM_UP, rounds):
        for runner, photo, found in zip(every, inputs, times, strict=True):
            started = time.perf_counter()
            try:
                runner.network.run(photo)
            except (RuntimeError, ValueError) as error:
                do = "export it again"
                raise ModelError("a model that runs", f"{runner.model}: {error}", do) from error
            if number >= 0:
                found.append((time.perf_counter() - started) * 1e3)
        progress(number + WARM_UP + 1)
    return [_timing(found) for found in times]


def _timing(found: Sequence[float]) -> Timing:
    low, middle, high = (float(value) for value in np.percentile(found, (10, 50, 90)))
    return Timing(median_ms=middle, p10_ms=low, p90_ms=high, fastest_ms=min(found))


def matrix_peak_gflops(threads: int) -> float:
    """The fastest of sixty float32 products of 512 x 512 matrices, by numpy's BLAS.

    In a process of its own, since a BLAS reads its number of threads when it is loaded.
    """
    limits = ("OPENBLAS", "OMP", "MKL", "VECLIB_MAXIMUM", "BLIS")
    environment = {**os.environ, **{f"{name}_NUM_THREADS": str(threads) for name in limits}}
    # Where set, this makes OpenBLAS use the kernels of another processor.
    environment.pop("OPENBLAS_CORETYPE", None)
    environment.pop("OPENBLAS_L2_SIZE", None)
    done = subprocess.run(
        [sys.executable, "-c", _PEAK], env=environment, capture_output=True, text=True, check=True
    )
    return float(done.stdout)
