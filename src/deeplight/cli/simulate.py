"""Film the three reference spheres in HDR panoramas with a simulated phone: a data set.

deeplight simulate --hdri my_panoramas --out data/sim

Any folder of .hdr or .exr panoramas works; a manifest.csv in it (file, split, place, scene,
licence, synthetic_ground) decides splits by place. Killed and run again, it goes on where it was.
"""

import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from deeplight.simulate.run import Recipe


@dataclass(frozen=True)
class Args:
    """Settings of `deeplight simulate`."""

    hdri: Path
    """Folder of HDR panoramas."""
    out: Path
    """Folder of the result; an unfinished one with the same settings is continued."""
    recipe: Recipe = field(default_factory=Recipe)
    """What a data set holds."""
    workers: int = 0
    """Jobs at once; 0 is one per core."""
    engine: Literal["local", "ray"] = "local"
    """Processes of this machine, or a Ray cluster that shares the folders."""
    ray_address: str | None = None
    """Of an existing Ray cluster, or auto; left out, one is started here."""


def run(args: Args) -> None:
    """Film a data set and its contact sheet."""
    from rich.markup import escape

    from deeplight.cli.screen import progress_bar, results_console
    from deeplight.dataset import open_dataset
    from deeplight.dataset.contact_sheet import write_contact_sheet
    from deeplight.errors import DataSetError
    from deeplight.jobs import Engine
    from deeplight.simulate.run import MADE_UP_GROUND, plan, simulate

    engine = Engine(args.engine, args.workers, args.ray_address)
    shards, simulation = plan(args.hdri, args.out, args.recipe)
    missing = sum(job.count for job in shards.missing())
    start = time.perf_counter()
    with progress_bar("filming", missing) as advance:
        manifest = simulate(shards, simulation, engine, advance)
    seconds = time.perf_counter() - start
    sheet = write_contact_sheet(open_dataset(args.out), args.out / "contact_sheet.png")
    console = results_console()
    for split in manifest.splits:
        places = len(manifest.places(split))
        plural = "s" * (places != 1)
        console.print(f"{split}: {manifest.examples(split)} in {places} place{plural}")
    for item in manifest.skipped:
        console.print(escape(f"skipped {item.file}: {item.reason}"), style="yellow")
    console.print(f"{missing / seconds:.0f} images/s; look at {sheet}")
    unusable = [item for item in manifest.skipped if item.reason != MADE_UP_GROUND]
    if unusable:
        got = f"{len(unusable)} that cannot be used, named above"
        raise DataSetError("usable panoramas", got, "the others are done")
