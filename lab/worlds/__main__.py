"""Make rooms, and open ground under physical skies, as HDR panoramas to film in.

python -m lab.worlds --rooms 20 --skies 10 --out data/worlds
"""

import sys
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from deeplight.cli.main import run_command
from deeplight.cli.screen import progress_bar
from lab.worlds.settings import Worlds


@dataclass(frozen=True)
class Args:
    """Settings of `python -m lab.worlds`."""

    out: Path
    """Folder of the panoramas; an unfinished one with the same settings is continued."""
    rooms: int = 0
    """Number of rooms to make."""
    skies: int = 0
    """Number of landscapes under physical skies to make."""
    worlds: Worlds = field(default_factory=Worlds)
    """How these are made."""


def run(args: Args) -> None:
    """Make what is missing."""
    from lab.worlds.run import make_worlds

    with progress_bar("making places", args.rooms + args.skies) as advance:
        count = make_worlds(args.out, args.rooms, args.skies, args.worlds, advance)
    line = f"{count} panoramas in {args.out}; film in them with --hdri {args.out}"
    Console().print(escape(line))


if __name__ == "__main__":
    sys.exit(run_command("python -m lab.worlds", sys.modules[__name__], sys.argv[1:]))
