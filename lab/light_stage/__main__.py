"""Photograph the spheres under single lights, for `deeplight reflectance`.

python -m lab.light_stage --out data/stage
"""

import sys
from dataclasses import dataclass, field
from pathlib import Path

from rich.console import Console
from rich.markup import escape

from deeplight.cli.main import run_command
from deeplight.cli.screen import progress_bar
from lab.light_stage.run import LightStage, photographs_of, write_light_stage


@dataclass(frozen=True)
class Args:
    """Settings of `python -m lab.light_stage`."""

    out: Path
    """Folder of the photographs; an unfinished one with the same settings is continued."""
    stage: LightStage = field(default_factory=LightStage)
    """What the stage is."""


def run(args: Args) -> None:
    """Photograph what is missing."""
    with progress_bar("photographing", photographs_of(args.stage)) as advance:
        lights = write_light_stage(args.out, args.stage, advance)
    spheres = ", ".join(args.stage.materials)
    line = f"{spheres} under {len(lights.files)} lights in {args.out}"
    Console().print(escape(line), soft_wrap=True)


if __name__ == "__main__":
    sys.exit(run_command("python -m lab.light_stage", sys.modules[__name__], sys.argv[1:]))
