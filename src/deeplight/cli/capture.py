"""Turn clips of the filmed rig into a data set: find the spheres, choose frames, cut, report.

deeplight capture clips/ --out data/filmed

Each clip gets reports/<clip>.html to look at and reports/<clip>.json for programs. A clip that
cannot be used is named in one line and recorded. Killed and run again, it goes on where it was;
run with more clips, it adds them.
"""

import math
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from deeplight.capture.choice import ChoiceSettings

if TYPE_CHECKING:
    from deeplight.capture.clip import CaptureSettings
    from deeplight.capture.run import ClipJob

_UNKNOWN_LENGTH = 900  # frames, for the bar only


@dataclass(frozen=True)
class Args:
    """Options of `deeplight capture`."""

    clips: Annotated[
        tuple[Path, ...],
        tyro.conf.Positional,
        tyro.conf.arg(metavar="CLIP...", help_behavior_hint="(one or more)"),
    ]
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
    """Of clips of which nothing else is known."""
    rig: Path | None = None
    """A rig file: the spheres' places from an earlier run, or next to an AprilTag."""
    save_rig: Path | None = None
    """Write the surest rig found to this file."""
    bases: Path | None = None
    """Measured reflectance bases of these spheres (`deeplight reflectance`): they travel with the
    data set, and `deeplight evaluate` uses them."""
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
    """Plan, work, and print what came of it.

    Raises:
        InputError: settings that make no sense, or a clip that could not be used.
        OSError: the data set cannot be written.
    """
    from rich.markup import escape

    from deeplight.capture.catalogue import find_clips
    from deeplight.capture.report import REPORTS
    from deeplight.capture.rig_file import write_rig_file
    from deeplight.capture.run import Outcome, capture, plan, surest_rig
    from deeplight.cli.screen import progress_bar, results_console
    from deeplight.dataset import add_bases
    from deeplight.errors import DataSetError
    from deeplight.io.basis_file import load_bases
    from deeplight.jobs import Engine

    settings = _settings(args)
    if args.bases is not None:
        load_bases(args.bases)  # what is wrong with it is said before hours of work
    engine = Engine(args.engine, args.workers, args.ray_address)
    what = plan(find_clips(args.clips, args.table, args.scene), args.out, settings)
    start, outcomes = time.perf_counter(), list[Outcome]()
    sizes = {job.clip.stem: _frames_claimed(job) for job in what.missing}
    with progress_bar(f"0 of {len(sizes)} clips", sum(sizes.values())) as bar:

        def show(outcome: Outcome) -> None:
            outcomes.append(outcome)
            bar.name(f"{len(outcomes)} of {len(sizes)} clips")
            bar(sizes[outcome.clip.stem])
            if outcome.reason:
                line = f"deeplight capture: {outcome.clip.path.name}: {outcome.reason}"
                bar.console.print(escape(" ".join(line.split())))

        manifest = capture(what, engine, show)
    seconds, read = time.perf_counter() - start, sum(outcome.read for outcome in outcomes)
    console = results_console()
    for split, shards in manifest.splits.items():
        clips = sum(shard.examples > 0 for shard in shards)
        if clips:
            console.print(f"{split}: {manifest.examples(split)} examples from {clips} clips")
    if read:
        console.print(f"{read / seconds:.1f} frames/s")
    if args.bases is not None:
        add_bases(args.out, args.bases)
    if args.save_rig is not None:
        write_rig_file(args.save_rig, surest_rig(what, manifest))
    console.print(escape(f"look at {args.out / REPORTS / 'index.html'}"))
    if manifest.skipped:
        got = f"{len(manifest.skipped)} of {len(what.shards.recipe['clips'])} that cannot be used"
        raise DataSetError("usable clips", got, "the others are done; see the reports")


def _settings(args: Args) -> "CaptureSettings":
    """The settings that the flags name.

    Raises:
        InputError: values that make no sense, or a rig file that is none.
    """
    from deeplight.capture.clip import CaptureSettings
    from deeplight.capture.located import LocateSettings
    from deeplight.capture.rig_file import read_rig_file
    from deeplight.cli.flags import check_fov

    check_fov(args.fov)
    fov_rad = None if args.fov is None else math.radians(args.fov)
    rig = None if args.rig is None else read_rig_file(args.rig)
    locate = LocateSettings(diameter_m=args.diameter, rig=rig)
    return CaptureSettings(locate, args.choice, fov_rad)


def _frames_claimed(job: "ClipJob") -> int:
    from deeplight.errors import InputError
    from deeplight.io.video import facts

    try:
        return facts(job.clip.path).frames or _UNKNOWN_LENGTH
    except (InputError, OSError):
        return 1  # reported when its turn comes
