"""Film clips of the three spheres as a phone records them, with what is true of them.

python -m lab.film --hdri my_panoramas --out data/films

For `deeplight capture` to work on. Killed and run again, it goes on where it was.
"""

import sys
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from deeplight.cli.main import run_command
from deeplight.cli.screen import progress_bar
from lab.film.recipe import FilmRecipe


@dataclass(frozen=True)
class Args:
    """Settings of `python -m lab.film`."""

    hdri: Path
    """Folder of HDR panoramas."""
    out: Path
    """Folder of the clips; an unfinished one with the same settings is continued."""
    film: FilmRecipe = field(default_factory=FilmRecipe)
    """What the clips are."""


def run(args: Args) -> None:
    """Film what is missing; name the panoramas that were skipped."""
    from lab.film.run import film_all, plan_films

    console = Console()
    plan = plan_films(args.hdri, args.out, args.film)
    with progress_bar("filming", len(plan.missing()) * args.film.frames) as advance:
        skipped = film_all(plan, advance)
    for item in skipped:
        console.print(escape(f"skipped {item.file}: {item.reason}"), style="yellow")
    made = len(plan.jobs) - len(plan.missing())
    console.print(escape(f"{made} clips and their truth in {args.out / 'clips'}"))


if __name__ == "__main__":
    sys.exit(run_command("python -m lab.film", sys.modules[__name__], sys.argv[1:]))
