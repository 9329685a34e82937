"""Measure models and other methods on a data set, next to trivial baselines, in one run.

deeplight evaluate --data data/sim --split val --out results

Prints the tables; with --out also report.html (look at it), results.json, results.csv, run.toml.
"""

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

import rich

from deeplight.cli.flags import Repeated, flat, refuse_unused


@dataclass(frozen=True)
class Args:
    """Options of `deeplight evaluate`."""

    data: str
    """Folder or address (s3://, ...) of the data set; with --benchmark the folder to make it in."""
    split: tuple[str, ...] = ("val",)
    """val, test, seen, or splits of the data set; several make one report."""
    model: Repeated = ()
    """FILE.onnx, NAME=FILE.onnx or a folder of training runs; left out, deeplight's own model."""
    panoramas: Repeated = ()
    """Other methods: NAME=FOLDER of HDR panoramas named by key, or NAME=FOLDER,ELEVATION_DEG."""
    truth: str = ""
    """FOLDER of measured light named by key (`deeplight probe`), instead of what examples carry."""
    bases: Path | None = None
    """Measured reflectance bases of the spheres; left out, the data set's bases.npz or analytic."""
    out: Path | None = None
    """Folder for the report and all files."""
    leaderboard: Path | None = None
    """File to append the models' results to; those in it already are verified."""
    examples: int | None = None
    """Measure only this number of examples of each split, evenly spread."""
    three_spheres: bool = False
    """Compute the protocol of StyleLight and DiffusionLight too, under its own name."""
    with_photo: bool = True
    """Add the first model's whole environment, photo and lamps in it."""
    benchmark: str | None = None
    """Make and check the published benchmark of that name (v1, v2)."""
    hdri: Path | None = None
    """Folder of the benchmark's panoramas, to make it."""


def run(args: Args) -> None:
    from deeplight.cli.screen import print_tables, progress_bar
    from deeplight.evaluate.command import Wanted, evaluation, opened
    from deeplight.evaluate.files import check_can_write, write_files
    from deeplight.evaluate.tables import all_tables
    from deeplight.io.atomic import results_folder

    if args.benchmark is None:
        refuse_unused(args, "without --benchmark", "hdri")
    data = opened(args.data, args.benchmark, args.hdri, args.bases)
    methods = flat(args.model), flat(args.panoramas)
    wanted = Wanted(
        data,
        args.split,
        *methods,
        args.examples,
        args.three_spheres,
        args.with_photo,
        args.truth,
    )
    with results_folder(args.out) if args.out else nullcontext():  # refused before any work
        check_can_write(args.out)
        with progress_bar("evaluating") as bar:
            found = evaluation(wanted, bar.begin, bar)
        print_tables([table for result in found.results for table in all_tables(result)])
        if args.leaderboard is not None:
            from deeplight.evaluate.leaderboard import update_leaderboard

            both = update_leaderboard(args.leaderboard, found.results, data, found.models)
            rich.print("{}: {} verified, {} added".format(args.leaderboard, *map(len, both)))
        if args.out is not None:
            write_files(args.out, found.results, data, found.models)
            rich.print(f"look at {args.out / 'report.html'}")
