"""Fetch CC0 panoramas from Poly Haven, to film in with `deeplight simulate`.

deeplight fetch abandoned_bakery brown_photostudio_02 --out hdri

deeplight fetch --manifest wanted.csv --out hdri

Writes the panoramas and manifest.csv (which splits them by place). Cut short and run again, it goes
on where it was. Every file is checked against the checksum that the server announces.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import rich
import tyro
from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TransferSpeedColumn


@dataclass(frozen=True)
class Args:
    """Options of `deeplight fetch`."""

    slugs: Annotated[
        tuple[str, ...],
        tyro.conf.Positional,
        tyro.conf.arg(metavar="NAME...", help_behavior_hint="(optional)"),
    ] = ()
    """Names as in polyhaven.com/a/NAME."""
    out: Path = field(default_factory=lambda: Path("hdri"))
    """Folder of the panoramas."""
    manifest: Path | None = None
    """A CSV with a column slug; its columns split, place, scene ... are kept."""
    resolution: str = "1k"
    """1k is 1024 x 512, as much as the simulation sees."""
    format: str = "hdr"
    """hdr or exr."""
    api: str = "https://api.polyhaven.com"
    """Base address of the API."""
    timeout: float = 30.0
    """Seconds without a byte after which an attempt has failed."""


def run(args: Args) -> None:
    from deeplight.errors import ConfigError
    from deeplight.io.atomic import results_folder
    from deeplight.simulate.poly_haven import CREDIT, Server, fetch_panoramas, rows_in, rows_of

    rows = [*rows_of(args.slugs), *(rows_in(args.manifest) if args.manifest else [])]
    if not rows:
        raise ConfigError("names of panoramas or --manifest", "neither", "give one of them")
    server = Server(args.api, args.timeout)
    columns = (TextColumn("{task.description}"), BarColumn(), DownloadColumn())
    bars = Progress(*columns, TransferSpeedColumn(), transient=True)
    with results_folder(args.out), bars as bar:
        tasks = {row.slug: bar.add_task(row.slug, total=None, visible=False) for row in rows}

        def more(slug: str, size: int, piece: int) -> None:
            bar.update(tasks[slug], total=size, advance=piece, visible=True)

        manifest = fetch_panoramas(rows, args.out, server, args.resolution, args.format, more)
    rich.print(f"{len(rows)} panoramas in {args.out}, listed in {manifest}. {CREDIT}.")
