"""Estimate the light of photos: an EXR environment, a JSON description and a preview for each.

deeplight estimate photo.jpg

deeplight estimate photos/ clip.mp4 --out light --for blender

Where the camera looked, the environment is the photo itself; elsewhere it is the network's
estimate, and what stands out of that becomes compact lamps, listed in the JSON.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro
from rich.markup import escape

if TYPE_CHECKING:
    from deeplight.estimators.batch import SourceDone
    from deeplight.estimators.sun import SunHint


MOST_NAMED = 4
"""Photos that a note of several names; of more it says how many."""
_NUMBER = re.compile(r"\d+(?:\.\d+)?")


@dataclass(frozen=True)
class Args:
    """Options of `deeplight estimate`."""

    photos: Annotated[
        tuple[Path, ...],
        tyro.conf.Positional,
        tyro.conf.arg(metavar="PHOTO...", help_behavior_hint="(one or more)"),
    ]
    """Photos, folders of photos, videos (one result per frame)."""
    out: Path = Path("out")
    """Folder for the results; made if it is missing."""
    fov: float | None = None
    """Vertical field of view of the upright photo in degrees. Default: from EXIF, else 66 degrees
    along the long side."""
    height: int = 256
    """Rows of the environment, 64 to 2048."""
    model: str | None = None
    """A .onnx or .tflite file, package.module:Class or the name of an entry point (docs/extend.md);
    left out, the model that comes with deeplight."""
    calibrated: Literal["matching", "always", "never"] = "matching"
    """With a model of `deeplight calibrate`: whose photos get its light; matching are those of its
    camera and those that name none."""
    made_for: Annotated[
        Literal["blender", "three", "mitsuba", "unity", "unreal", "usd", "webxr"] | None,
        tyro.conf.arg(name="for"),
    ] = None
    """Turn the environment for this tool; webxr adds <stem>.webxr.json instead."""
    light_only: bool = False
    """Write what the network estimates alone: no photo in it, no lamps."""
    lamps_apart: bool = False
    """Leave the lamps out of the environment, for who adds them as lights from the JSON."""
    fill: Literal["auto", "photo", "any", "indoor", "outdoor", "none"] = "auto"
    """What reflections show where the photo does not look: the photo's own rows going on, over them
    detail of a real place of that kind (auto: of the kind that the network is sure of), or none of
    both; the power of the light stays the same."""
    seen: bool = False
    """Write what the photo shows, 0 to 1, as a further channel `seen` of the .exr."""
    hdr: bool = False
    """Also write <stem>.hdr (Radiance RGBE)."""
    sun: tuple[float, float] | None = None
    """The sun's azimuth (0 is the view, positive to the right) and elevation in the picture,
    degrees. Default: by the photo's GPS data, where it has them."""
    sun_at: tuple[float, float] | None = None
    """The pixel x y where the sun is; it may lie outside the photo."""
    shadow: tuple[float, float, float, float] | None = None
    """Pixels x y of the foot of something upright and x y of the tip of its shadow."""
    shadow_top: tuple[float, float] | None = None
    """With --shadow: pixel x y of its upper end. Default: the sun is as high as estimated."""
    pitch: float | None = None
    """Degrees the camera looks up. Default: EXIF's, else by upright edges and the network."""
    roll: float | None = None
    """Degrees the camera is turned counter-clockwise. Default: from EXIF, else 0."""


def run(args: Args) -> None:
    """Estimate all that can be; of the rest say why not, one line each."""
    from deeplight.cli.main import complaint
    from deeplight.cli.screen import progress_bar, results_console
    from deeplight.errors import ConfigError, InputError
    from deeplight.estimators.batch import BatchSettings, SourceDone, estimate_batch
    from deeplight.estimators.open import open_model
    from deeplight.estimators.sources import Source

    if not args.photos:
        raise ConfigError("at least one photo, folder or video", "none", "name one")
    settings = BatchSettings(
        fov_deg=args.fov,
        height=args.height,
        light_only=args.light_only,
        lamps_apart=args.lamps_apart,
        made_for=args.made_for,
        hdr=args.hdr,
        seen_channel=args.seen,
        sun=_sun_hint(args),
        fill=None if args.fill == "none" else args.fill,
        pitch_deg=args.pitch,
        roll_deg=args.roll,
    )
    estimator = open_model(args.model)
    if args.calibrated != "matching" and estimator.calibration is None:
        got = f"--calibrated {args.calibrated} without one"
        raise ConfigError("a model of `deeplight calibrate`", got, "leave it out or give --model")
    estimator.calibrated = args.calibrated
    done: list[SourceDone] = []
    single = len(args.photos) == 1 and not args.photos[0].is_dir()
    try:
        with progress_bar("estimating", quiet=single) as bar:

            def start(source: Source, number: int, total: int) -> None:
                bar.expect(total)
                bar.name(source.path.name)
                bar(int(number > 1))

            def complain(error: InputError | OSError) -> None:
                bar.console.print(escape(complaint("deeplight estimate", error)))

            estimate_batch(
                estimator,
                args.photos,
                args.out,
                settings,
                on_done=done.append,
                on_failure=complain,
                on_start=start,
            )
    finally:
        console = results_console()
        for line in _lines(done):  # after the bar, so that neither is drawn over the other
            console.print(line)


def _sun_hint(args: Args) -> "SunHint | None":
    from deeplight.estimators.sun import SunHint

    hints = (args.sun, args.sun_at, args.shadow, args.shadow_top)
    return None if all(hint is None for hint in hints) else SunHint(*hints)


def _lines(done: Sequence["SourceDone"]) -> list[str]:
    """A line for each photo or video, then what the user should know, once for all of them."""
    lines = []
    noted: dict[str, dict[str, str]] = {}  # the same note but for its numbers, by photo
    for one in done:
        if one.count > 1:
            made = f"{one.count} frames: {one.first[0]} to {one.last[0].name}"
        else:
            made = ", ".join([str(one.first[0]), *(file.name for file in one.first[1:])])
        lines.append(f"{escape(str(one.source.path))} -> {escape(made)}")
        for note in one.notes:
            noted.setdefault(_NUMBER.sub("#", note), {})[one.source.stem] = note
    for notes in noted.values():
        whose = f"{_named(list(notes), len(done))}: " if len(done) > 1 else ""
        lines.append(f"  [dim]{escape(whose + _ranged(list(notes.values())))}[/dim]")
    return lines


def _named(names: Sequence[str], of: int) -> str:
    """Whose a note is: the first few by name."""
    if len(names) == of:
        return f"all {of}"
    first, more = ", ".join(names[:MOST_NAMED]), len(names) - MOST_NAMED
    return first if more <= 0 else f"{first} and {more} more"


def _ranged(notes: Sequence[str]) -> str:
    """Notes that differ by their numbers alone as one: "79 to 84%"."""
    numbers = zip(*(_NUMBER.findall(note) for note in notes), strict=True)
    ranges = iter(
        some[0] if len(set(some)) == 1 else f"{min(some, key=float)} to {max(some, key=float)}"
        for some in numbers
    )
    return _NUMBER.sub(lambda match: next(ranges), notes[0])
