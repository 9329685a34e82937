"""Film the three reference spheres in HDR panoramas with a simulated phone: a data set.

deeplight simulate --hdri my_panoramas --out data/sim

Any folder of .hdr or .exr panoramas works; a manifest.csv in it (file, split, place, scene,
licence, synthetic_ground) decides splits by place. Killed and run again, it goes on where it
was. A contact sheet of the result lies beside the shards.
"""

import time
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from deeplight.simulate.run import Recipe


@dataclass(frozen=True)
class Args:
    """Settings of `deeplight simulate`."""

    hdri: Path
    """Folder of HDR panoramas."""
    out: Path
    """Folder of the data set; an unfinished one with the same settings is continued."""
    recipe: Recipe = field(default_factory=Recipe)
    """What to film."""
    workers: int = 0
    """Processes; 0 is one per core."""


def run(args: Args) -> None:
    from deeplight.dataset import open_dataset
    from deeplight.dataset.contact_sheet import write_contact_sheet
    from deeplight.simulate.run import plan, simulate

    console = Console()
    shards, simulation = plan(args.hdri, args.out, args.recipe)
    missing = sum(job.count for job in shards.missing())
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    start = time.perf_counter()
    with Progress(*columns, TimeRemainingColumn(), console=console) as bar:
        task = bar.add_task("filming", total=missing)
        manifest = simulate(shards, simulation, args.workers, lambda n: bar.advance(task, n))
    seconds = time.perf_counter() - start
    sheet = write_contact_sheet(open_dataset(args.out), args.out / "contact_sheet.png")
    for split in manifest.splits:
        console.print(
            f"{split}: {manifest.examples(split)} in {len(manifest.places(split))} places"
        )
    for item in manifest.skipped:
        console.print(escape(f"skipped {item.file}: {item.reason}"), style="yellow")
    console.print(f"{missing / seconds:.0f} images/s; look at {sheet}")
