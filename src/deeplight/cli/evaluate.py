"""Measure models and other methods on a data set, beside trivial baselines, in one run.

deeplight evaluate --data data/sim --split val --out results

Prints masked L1 of the spheres, colour angle and relative radiance error of the diffuse one, and
errors against the true light where it is known. With --out it also writes report.html (look at
it), results.json, results.csv (every example), pictures and run.toml.
"""

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

import rich
from rich.progress import Progress


@dataclass(frozen=True)
class Args:
    """Options of `deeplight evaluate`."""

    data: Path
    """Folder of the data set; with --benchmark it is made there if it is not yet."""
    split: tuple[str, ...] = ("val",)
    """val, test, seen, or splits of the data set; several make one report."""
    model: tuple[str, ...] = ()
    """Exported models: FILE.onnx, NAME=FILE.onnx or a folder of training runs, one or more; left
    out, the model that comes with deeplight."""
    panoramas: tuple[str, ...] = ()
    """Other methods: NAME=FOLDER of HDR panoramas named by the examples' keys, or
    NAME=FOLDER,ELEVATION_DEG where they are upright and the camera is tilted."""
    out: Path | None = None
    """Folder for the report and the results as files."""
    examples: int | None = None
    """Measure only so many examples of each split, evenly spread."""
    three_spheres: bool = False
    """Compute the protocol of StyleLight and DiffusionLight too, under its own name."""
    benchmark: str | None = None
    """Make and check the published benchmark of that name, as v1; needs --hdri."""
    hdri: Path | None = None
    """Folder of the benchmark's panoramas."""


def run(args: Args) -> None:
    """Evaluate with a progress bar, print the tables, write the files."""
    from deeplight.dataset import open_dataset
    from deeplight.evaluate.benchmark import benchmark_data
    from deeplight.evaluate.command import Wanted, evaluation
    from deeplight.evaluate.files import check_can_write, write_files
    from deeplight.evaluate.tables import all_tables
    from deeplight.io.atomic import results_folder

    made = benchmark_data(args.benchmark, args.hdri, args.data) if args.benchmark else None
    data = made or open_dataset(args.data)
    wanted = Wanted(data, args.split, args.model, args.panoramas, args.examples, args.three_spheres)
    with results_folder(args.out) if args.out else nullcontext():  # told before any work
        if args.out:
            check_can_write()
        with Progress(transient=True) as bar:
            task = bar.add_task("", total=None)
            found = evaluation(
                wanted,
                lambda text, total: bar.reset(task, description=text, total=total),
                lambda examples: bar.advance(task, examples),
            )
        rich.print(*(table for result in found.results for table in all_tables(result)))
        if args.out is not None:
            write_files(args.out, found.results, data, found.models)
            rich.print(f"look at {args.out / 'report.html'}")
