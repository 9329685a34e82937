"""Fuse a panning clip or several photos of one place into one light, sharp where one looked.

deeplight fuse clip.mp4 --out out

deeplight fuse IMG_1.jpg IMG_2.jpg IMG_3.jpg --poses arkit.json --level --out out

Rotations come from a pose file (ARKit, ARCore, WebXR), from a panorama's own metadata, or from the
pictures: turn slowly, so that neighbouring frames overlap by a third. Killed and run again, it goes
on with the clip where it was.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro
from rich.markup import escape

if TYPE_CHECKING:
    from deeplight.errors import InputError
    from deeplight.fuse.frame import SourceFrame
    from deeplight.fuse.fuse import Fused
    from deeplight.io.kept_folder import KeptFolder


@dataclass(frozen=True)
class Args:
    """Options of `deeplight fuse`."""

    sources: Annotated[
        tuple[Path, ...],
        tyro.conf.Positional,
        tyro.conf.arg(metavar="CLIP|PHOTO", help_behavior_hint="(one or more)"),
    ]
    """One clip, photos in the order they were taken (several exposures are welcome), a folder of
    them, or a phone's panorama with GPano metadata."""
    out: Path
    """Folder for the results; made if it is missing."""
    poses: Path | None = None
    """JSON file of how the camera was turned in each frame: see docs/fuse.md."""
    front: Path | None = None
    """A photo of the front camera, taken together with the first frame: the other half."""
    frame: int | None = None
    """Frame of the clip, or place of the photo, from 0, whose camera and white the light is in.
    Default: the first one that can be placed."""
    level: bool = False
    """Turn the light so that +Y is against gravity, whatever the frame's tilt."""
    fov: float | None = None
    """Vertical field of view of the first upright frame in degrees, and its camera's. Default: each
    photo's own from EXIF data, else found from the pictures."""
    height: int = 512
    """Rows of the environment, 64 to 2048."""
    model: Path | None = None
    """Use this .onnx or .tflite file instead of the model that comes with deeplight."""
    made_for: Annotated[
        Literal["blender", "three", "mitsuba", "unity", "unreal"] | None,
        tyro.conf.arg(name="for"),
    ] = None
    """Turn the environment for this tool."""
    hdr: bool = False
    """Also write <stem>.hdr (Radiance RGBE)."""
    session: Path | None = None
    """Also save the state (.npz), to go on with in Python: `Session.load`."""
    workers: int = 1
    """Processes that look through a clip; 0 is one per core. The files are the same."""


def run(args: Args) -> None:
    """Fuse; print what was made and what had to be left out."""
    from deeplight.cli.flags import refuse_unused
    from deeplight.cli.main import complaint
    from deeplight.cli.screen import notes_console, results_console
    from deeplight.errors import ImageFileError
    from deeplight.fuse.results import seen_share
    from deeplight.io.atomic import results_folder
    from deeplight.io.photos import photo_paths
    from deeplight.io.video import is_video

    _check(args)
    paths = [p for s in args.sources for p in ([s] if is_video(s) else photo_paths([s]))]
    if args.poses is not None or not any(is_video(path) for path in paths):
        refuse_unused(args, "without a clip to look through", "workers")
    failures: list[InputError | OSError] = []

    def complain(error: "InputError | OSError") -> None:
        failures.append(error)
        notes_console().print(escape(complaint("deeplight fuse", error)))

    with results_folder(args.out), _kept(paths, args) as kept:
        fused, files, notes = _fused(paths, args, kept, complain)
    console = results_console()
    made = ", ".join([str(files[0]), *(file.name for file in files[1:])])
    console.print(escape(f"{_named(paths)} -> {made}"))
    count = len(fused.placed)
    used = f"{count} frame{'s' * (count > 1)}"
    if fused.front is not None:
        used += f" and the front photo {fused.front.name}"
    seen = f"{used}, {seen_share(fused.environment):.0%} of the sphere seen"
    dropped = [f"could not be placed: {', '.join(f.name for f in fused.dropped)}"]
    for note in (seen, *(dropped if fused.dropped else ()), *notes, *fused.notes):
        console.print(f"  [dim]{escape(note)}[/dim]")
    if failures:
        got = f"{len(failures)} of {len(paths)} that cannot be used, named above"
        raise ImageFileError("usable photos", got, "the light is that of the others")


@contextmanager
def _kept(paths: list[Path], args: Args) -> Iterator["KeptFolder | None"]:
    """Where a clip's frames wait until all is written; a kill leaves it, an error does not."""
    from deeplight.estimators.onnx import shipped_model
    from deeplight.io.atomic import fitted, only_run
    from deeplight.io.kept_folder import KeptFolder, made_of
    from deeplight.io.video import is_video

    if len(paths) != 1 or not is_video(paths[0]) or args.poses is not None:
        yield None
        return
    files = [paths[0], args.model or shipped_model(), *([args.front] if args.front else [])]
    key = made_of(files, args.fov)
    folder = args.out / f".{fitted(paths[0].stem)}.fusing"
    with only_run(folder):  # before a look inside: another run's parts are not this one's to take
        kept = KeptFolder(folder, key)
        try:
            yield kept
            kept.remove()
        except Exception:
            kept.remove()
            raise


def _fused(
    paths: list[Path],
    args: Args,
    kept: "KeptFolder | None",
    complain: Callable[["InputError | OSError"], None],
) -> tuple["Fused", list[Path], list[str]]:
    """The light, its files, and what was left out."""
    from deeplight.cli.flags import refuse_unused
    from deeplight.estimators.open import open_model
    from deeplight.fuse.frame import frame_of, with_fields_of_view
    from deeplight.fuse.fuse import FuseSettings, fuse_frames
    from deeplight.fuse.motion import checked, with_motion
    from deeplight.fuse.poses import read_poses
    from deeplight.fuse.results import write_fused
    from deeplight.fuse.sources import read_frames
    from deeplight.io.atomic import fitted
    from deeplight.io.orientation import TOOLS
    from deeplight.io.photos import read_photo
    from deeplight.io.video import is_video

    poses = None if args.poses is None else read_poses(args.poses, _upright(paths[0]))
    estimator = open_model(args.model)
    frames = read_frames(paths, poses, kept, args.workers, complain)
    frames = with_fields_of_view(frames, args.fov and math.radians(args.fov))
    notes: list[str] = []
    if poses is not None:
        posed = [replace(f, world_from_camera=poses.at(f.number, f.time_s)) for f in frames]
        frames = [frame for frame in posed if frame.world_from_camera is not None]
        if not is_video(paths[0]):
            notes += poses.unused(len(posed))
        if len(frames) < len(posed):
            notes.append(f"{len(posed) - len(frames)} without a pose left out")
        frames, found = checked(frames)
        notes += found
    elif is_video(paths[0]):
        frames, found = with_motion(frames, paths[0], args.fov and math.radians(args.fov))
        notes += found
    elif all(frame.world_from_camera is not None for frame in frames):
        refuse_unused(args, "with panoramas, which say it themselves", "fov")
    front = None if args.front is None else frame_of(read_photo(args.front), args.front.name, -1)
    asked = _place(frames, args.frame, is_video(paths[0]), posed=poses is not None)
    settings = FuseSettings(None, asked, args.level, args.height)
    fused = fuse_frames(frames, estimator, settings, front, kept)
    tool = TOOLS.get(args.made_for or "")
    turn = tool.turn if tool else None
    files = write_fused(fused, estimator, args.out, fitted(paths[0].stem), turn, args.hdr)
    if args.session is not None:
        fused.session.save(args.session)
    return fused, files, notes


def _check(args: Args) -> None:
    from deeplight.cli.flags import check_fov
    from deeplight.errors import ConfigError

    if not args.sources:
        raise ConfigError("a clip or photos", "none", "name them")
    check_fov(args.fov)
    if not 64 <= args.height <= 2048:
        raise ConfigError("--height from 64 to 2048", f"{args.height}", "correct it")
    if args.workers < 0:
        raise ConfigError("at least 0 workers", f"{args.workers}", "correct it")
    if args.session is not None and args.session.suffix != ".npz":
        raise ConfigError("--session FILE.npz", f"{args.session}", "rename it")


def _upright(path: Path) -> bool:
    """Whether the first picture is taller than wide: how the phone was held."""
    from deeplight.io.photos import read_photo
    from deeplight.io.video import facts, is_video

    if is_video(path):
        known = facts(path)
        return known.height > known.width
    height, width, _ = read_photo(path).pixels.shape
    return height > width


def _place(
    frames: Sequence["SourceFrame"], number: int | None, is_clip: bool, posed: bool
) -> int | None:
    """The place of a photo among those used; of a clip's frame, that of the nearest one."""
    from deeplight.errors import ConfigError, ImageFileError

    if not frames and not posed:
        raise ImageFileError("usable photos", "none", "give others")
    if not frames:
        raise ImageFileError("frames with a pose", "none", "check the pose file's times or numbers")
    if number is None:
        return None
    numbers = [frame.number for frame in frames]
    step = max((b - a for a, b in pairwise(numbers)), default=1)  # of a clip not all are used
    if not 0 <= number < numbers[-1] + step:
        raise ConfigError(f"--frame from 0 to {numbers[-1]}", f"{number}", "name one of them")
    if not is_clip and number not in numbers:
        raise ConfigError("--frame of a photo that is used", f"{number}", "name another")
    return min(range(len(frames)), key=lambda k: abs(frames[k].number - number))


def _named(paths: list[Path]) -> str:
    return str(paths[0]) if len(paths) == 1 else f"{paths[0]} and {len(paths) - 1} more"
