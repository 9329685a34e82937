"""What `deeplight capture` does and shows: a bar over frames, a line for each clip that failed."""

import math
import time
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from deeplight.capture.catalogue import find_clips
from deeplight.capture.clip import CaptureSettings
from deeplight.capture.located import LocateSettings
from deeplight.capture.report import REPORTS, report_path
from deeplight.capture.rig_file import read_rig_file, write_rig_file
from deeplight.capture.run import Capture, ClipJob, Outcome, capture, plan
from deeplight.dataset import Manifest
from deeplight.dataset.manifest import read_json
from deeplight.errors import ConfigError, InputError
from deeplight.io.video import facts
from deeplight.jobs import Engine
from deeplight.sphere import Rig

if TYPE_CHECKING:
    from deeplight.cli.capture import Args

_UNKNOWN_LENGTH = 900  # frames, for the bar only


def capture_with_progress(args: "Args") -> None:
    """Plan, work, and tell what came of it.

    Raises:
        InputError: settings that make no sense, or no clip that could be used.
        OSError: the data set cannot be written.
    """
    console = Console(highlight=False, soft_wrap=True)
    errors = Console(stderr=True, highlight=False, soft_wrap=True)
    settings = settings_of(args)
    engine = Engine(args.engine, args.workers, args.ray_address)
    what = plan(find_clips(args.clips, args.table, args.scene), args.out, settings)
    start, read = time.perf_counter(), 0
    columns = (TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:.0f} %"))
    with Progress(*columns, TimeRemainingColumn(), console=errors, transient=True) as bar:
        sizes = {job.clip.stem: _frames_claimed(job) for job in what.missing}
        task = bar.add_task(_standing(0, what), total=sum(sizes.values()))
        done = 0

        def show(outcome: Outcome) -> None:
            nonlocal done, read
            done, read = done + 1, read + outcome.read
            stem = outcome.clip.stem
            bar.update(task, advance=sizes[stem], description=_standing(done, what))
            if outcome.reason:
                line = f"deeplight capture: {outcome.clip.path.name}: {outcome.reason}"
                errors.print(escape(" ".join(line.split())))

        manifest = capture(what, engine, show)
    seconds = time.perf_counter() - start
    for split, shards in manifest.splits.items():
        clips = sum(shard.examples > 0 for shard in shards)
        if clips:
            console.print(f"{split}: {manifest.examples(split)} examples from {clips} clips")
    if read:
        console.print(f"{read / seconds:.1f} frames/s")
    if args.save_rig is not None:
        write_rig_file(args.save_rig, _surest_rig(what, manifest))
    console.print(escape(f"look at {args.out / REPORTS / 'index.html'}"))


def settings_of(args: "Args") -> CaptureSettings:
    """The settings that the flags name.

    Raises:
        InputError: values that make no sense, or a rig file that is none.
    """
    if args.fov is not None and not 0 < args.fov < 180:
        raise ConfigError("--fov between 0 and 180 degrees", f"{args.fov:g}", "correct it")
    fov_rad = None if args.fov is None else math.radians(args.fov)
    rig = None if args.rig is None else read_rig_file(args.rig)
    locate = LocateSettings(diameter_m=args.diameter, rig=rig)
    return CaptureSettings(locate, args.choice, fov_rad)


def _standing(done: int, what: Capture) -> str:
    return f"{done} of {len(what.missing)} clips"


def _frames_claimed(job: ClipJob) -> int:
    try:
        return facts(job.clip.path).frames or _UNKNOWN_LENGTH
    except (InputError, OSError):
        return 1  # told when its turn comes


def _surest_rig(what: Capture, manifest: Manifest) -> Rig:
    """The rig of the clip whose least sure sphere is surest."""
    surety = {}
    for stem in what.shards.recipe["clips"]:
        report = read_json(report_path(what.shards.folder, stem))
        if report["status"] == "ok":
            sure = [sphere["confidence"] for sphere in report["spheres"].values()]
            surety[report["rig"]] = min(sure)
    best = max(surety, key=lambda name: surety[name])
    return Rig.from_dict(dict(manifest.rigs[best]))
