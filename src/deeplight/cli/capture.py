"""Turn clips of the filmed rig into a data set: find the spheres, choose frames, cut, report.

deeplight capture clips/ --out data/filmed

Each clip gets reports/<clip>.html to look at and reports/<clip>.json for programs. A clip that
cannot be used is told in one line and recorded. Killed and run again, it goes on where it was;
run with more clips, it adds them.
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from deeplight.capture.choice import ChoiceSettings


@dataclass(frozen=True)
class Args:
    """Options of `deeplight capture`."""

    clips: Annotated[tuple[Path, ...], tyro.conf.Positional, tyro.conf.arg(metavar="CLIP...")]
    """Videos, or folders of videos."""
    out: Path
    """Folder of the data set; one with the same settings is continued."""
    fov: float | None = None
    """Vertical field of view of the upright full frame in degrees. Default: 66; of a clip wider
    than high what makes 66 from left to right, 40.1 for 16:9."""
    table: Annotated[Path | None, tyro.conf.arg(name="clips")] = None
    """CSV with columns clip, place, scene, split (train, val, test, seen) and licence. Without
    it each clip is its own place and its split is drawn from its name."""
    scene: Literal["indoor", "outdoor"] = "indoor"
    """Of clips of which nothing else is told."""
    rig: Path | None = None
    """A rig file: the spheres' places from an earlier run, or beside an AprilTag."""
    save_rig: Path | None = None
    """Write the surest rig found to this file."""
    diameter: float = 0.08
    """Of the spheres, in metres."""
    choice: ChoiceSettings = field(default_factory=ChoiceSettings)
    """Which frames to keep."""
    engine: Literal["local", "ray"] = "local"
    """Processes of this machine, or a Ray cluster that shares the folders."""
    workers: int = 0
    """Clips at once; 0 is one per core."""
    ray_address: str | None = None
    """Of an existing Ray cluster, or auto; left out, one is started here."""


def run(args: Args) -> None:
    from deeplight.cli.capture_progress import capture_with_progress

    capture_with_progress(args)
