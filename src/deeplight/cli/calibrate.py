"""Bring the shipped model to your own phone with clips of the three spheres filmed with it.

deeplight calibrate clips/ --out mine.onnx

Three places or more, a clip each. Nothing is written unless the light becomes better in places
that are left out in turn. Then `deeplight estimate photo.jpg --model mine.onnx`.
"""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class Args:
    """Options of `deeplight calibrate`."""

    clips: Annotated[
        tuple[Path, ...],
        tyro.conf.Positional,
        tyro.conf.arg(metavar="CLIP...", help_behavior_hint="(one or more)"),
    ]
    """Videos of the filmed spheres, folders of videos, or data sets of `deeplight capture`."""
    out: Path
    """The .onnx to write."""
    weights: Path | None = None
    """The exported model to start from; left out, the shipped one."""
    captured: Path | None = None
    """Where the videos' examples and reports go; left out, next to --out. A second run goes on."""
    camera: str | None = None
    """Make and model of the phone, as EXIF of its photos has them, or one of its photos: photos of
    other cameras keep the light they had. Default: what the clips say. any: all get the new one."""
    fov: float | None = None
    """As for `deeplight capture`: vertical field of view of the upright full frame, in degrees."""


def run(args: Args) -> None:
    """Capture what is video, find the gains, write the model, print what it does.

    Raises:
        InputError: no usable clip, too few places, or no better model.
        OSError: a file cannot be written.
    """
    from deeplight.errors import ConfigError
    from deeplight.io.atomic import check_writable, results_folder

    if args.out.suffix.lower() != ".onnx":
        raise ConfigError("--out FILE.onnx", f"{args.out}", "correct it")
    if not args.clips:
        raise ConfigError("clips of the spheres, or data sets of them", "none", "name them")
    with results_folder(args.out.parent):
        check_writable(args.out)
        _calibrate(args)


def _calibrate(args: Args) -> None:
    from rich.markup import escape

    from deeplight.calibrate.gains import words
    from deeplight.calibrate.run import calibrate_model
    from deeplight.cli.flags import refuse_unused
    from deeplight.cli.screen import progress_bar, results_console
    from deeplight.dataset.manifest import MANIFEST

    data = [path for path in args.clips if (path / MANIFEST).is_file()]
    videos = [path for path in args.clips if path not in data]
    if videos:
        data.append(_captured(args, videos))
    else:
        refuse_unused(args, "with data sets, which are captured already", "captured", "fov")
    camera = _camera_named(args.camera)
    with progress_bar("looking at examples", None) as advance:
        found = calibrate_model(data, args.out, args.weights, advance, camera)
    red, green, blue = (math.exp(value) for value in found.log_gains)
    console = results_console()
    console.print(f"{found.places} places, left out in turn: {words(found.before, found.after)}")
    console.print(escape(f"{args.out}: light times {red:.2f} {green:.2f} {blue:.2f} (R G B)"))
    of_all = "of all cameras: the clips do not say which filmed them, --camera does"
    console.print(escape(f"for photos {f'of {found.camera}' if found.camera else of_all}"))


def _camera_named(text: str | None) -> str | None:
    """The camera that --camera means: of a photo's file its own; empty for "any"."""
    from deeplight.errors import ConfigError
    from deeplight.io.exif import MAKE, MODEL, camera_name, exif_directories

    if text is None or text.casefold() == "any":
        return None if text is None else ""
    if not Path(text).is_file():
        return camera_name("", text)
    named = exif_directories(Path(text)).main
    camera = camera_name(named.get(MAKE), named.get(MODEL))
    if not camera:
        raise ConfigError("a photo that names its camera as --camera", text, "give make and model")
    return camera


def _captured(args: Args, videos: list[Path]) -> Path:
    """The data set that the videos become."""
    from rich.markup import escape

    from deeplight.capture.catalogue import find_clips
    from deeplight.capture.clip import CaptureSettings
    from deeplight.capture.run import Outcome, capture, plan
    from deeplight.cli.flags import check_fov
    from deeplight.cli.screen import progress_bar

    check_fov(args.fov)
    fov_rad = None if args.fov is None else math.radians(args.fov)
    folder = args.captured or args.out.with_name(f"{args.out.stem}-clips")
    what = plan(find_clips(videos), folder, CaptureSettings(vertical_fov_rad=fov_rad))
    with progress_bar("capturing clips", len(what.missing)) as bar:

        def show(outcome: Outcome) -> None:
            bar(1)
            if outcome.reason:
                line = f"{outcome.clip.path.name}: {outcome.reason}"
                bar.console.print(escape(" ".join(line.split())))

        capture(what, progress=show)
    return folder
