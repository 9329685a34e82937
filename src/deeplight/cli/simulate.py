"""Film the three reference spheres in HDR panoramas with a simulated phone.

deeplight simulate --hdri my_panoramas --out data/sim
deeplight simulate --hdri my_panoramas --out data/films --video --film.troubles all

The first makes a data set to train on, with a contact sheet beside its shards; --recipe.* are
its settings. With --video it makes clips as a phone records them, for `deeplight capture`, with
what is true of them beside each; --film.* are its settings. Any folder of .hdr or .exr
panoramas works; a manifest.csv in it (file, split, place, scene, licence, synthetic_ground)
decides splits by place. Killed and run again, both go on where they were.
"""

from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console

from deeplight.simulate.film.recipe import FilmRecipe
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
    """Processes for a data set; 0 is one per core."""
    video: bool = False
    """Make video clips with their ground truth instead of a data set."""
    film: FilmRecipe = field(default_factory=FilmRecipe)
    """What the clips are, with --video."""


def run(args: Args) -> None:
    from deeplight.cli.simulate_modes import data_set, films

    console = Console()
    if args.video:
        films(args.hdri, args.out, args.film, console)
    else:
        data_set(args.hdri, args.out, args.recipe, args.workers, console)
