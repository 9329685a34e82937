"""Time models on this machine, by runtime and threads, beside its matrix-product peak.

deeplight benchmark

deeplight benchmark mine.onnx mine.tflite --threads 1 2 --data data/sim --out out/benchmark

With --data also the L1 of the spheres, with --out also benchmark.json and .csv.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

WIDTH = 130  # columns of text that the table needs; a narrower terminal wraps its lines


@dataclass(frozen=True)
class Args:
    """Options of `deeplight benchmark`."""

    models: Annotated[
        tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="MODEL...")
    ] = ()
    """.onnx and .tflite files; left out, the model that comes with deeplight."""
    threads: tuple[int, ...] = ()
    """Numbers of threads to try; left out, 1 and all cores (at most 4)."""
    rounds: int = 50
    """Each model runs so many times, in turns with the others."""
    without_xnnpack: bool = False
    """Time TFLite files also with LiteRT's plain kernels."""
    data: Path | None = None
    """Data set to measure the L1 of the spheres on."""
    split: str = "val"
    """Its split."""
    examples: int | None = None
    """At most so many examples of it, evenly spread."""
    out: Path | None = None
    """Folder for benchmark.json and benchmark.csv."""


def run(args: Args) -> None:
    """Measure with a progress bar, print the table, write the files."""
    from rich.console import Console
    from rich.progress import Progress

    from deeplight.cli.benchmark_table import checked, measured, table, write

    threads = checked(args)
    with Progress(transient=True, console=Console(stderr=True)) as bar:
        task = bar.add_task("timing", total=None)

        def told(text: str, total: int | None, done: int) -> None:
            bar.update(task, description=text, total=total, completed=done)

        rows, machine = measured(args, threads, told)
    Console(width=max(WIDTH, Console().width)).print(table(rows, machine))
    if args.out is not None:
        write(args.out, rows, machine)
