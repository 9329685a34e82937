"""Film the three reference spheres in HDR panoramas with a simulated phone.

deeplight simulate --hdri my_panoramas --out data/sim

Makes a data set to train on (--recipe.*). With --video: clips as a phone records them, for
`deeplight capture`, with what is true of them (--film.*). With --light-stage: photographs of the
spheres under single lights, for `deeplight reflectance` (--stage.*), without panoramas. With
--rooms N or --skies N: made-up panoramas to film in (--worlds.*). Any folder of .hdr or .exr
panoramas works; a manifest.csv in it (file, split, place, scene, licence, synthetic_ground)
decides splits by place. Killed and run again, all go on where they were.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from deeplight.simulate.film.recipe import FilmRecipe
from deeplight.simulate.light_stage import LightStage
from deeplight.simulate.run import Recipe
from deeplight.simulate.worlds.settings import Worlds


@dataclass(frozen=True)
class Args:
    """Settings of `deeplight simulate`."""

    out: Path
    """Folder of the result; an unfinished one with the same settings is continued."""
    hdri: Path | None = None
    """Folder of HDR panoramas; a light stage needs none."""
    recipe: Recipe = field(default_factory=Recipe)
    """What a data set holds."""
    workers: int = 0
    """Jobs at once for a data set; 0 is one per core."""
    engine: Literal["local", "ray"] = "local"
    """Processes of this machine, or a Ray cluster that shares the folders."""
    ray_address: str | None = None
    """Of an existing Ray cluster, or auto; left out, one is started here."""
    video: bool = False
    """Make video clips with their ground truth instead of a data set."""
    film: FilmRecipe = field(default_factory=FilmRecipe)
    """What the clips are, with --video."""
    light_stage: bool = False
    """Photograph spheres in a virtual light stage instead."""
    stage: LightStage = field(default_factory=LightStage)
    """What the stage is, with --light-stage."""
    rooms: int = 0
    """Make so many rooms to film in instead of a data set."""
    skies: int = 0
    """The same for open ground under physical skies."""
    worlds: Worlds = field(default_factory=Worlds)
    """How these are made."""


def run(args: Args) -> None:
    from deeplight.cli.simulate_modes import make

    make(args)
