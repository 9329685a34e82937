"""From the words of `deeplight compose` to a picture: the light, the camera, the objects."""

from collections.abc import Sequence
from math import radians
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.progress import Progress

from deeplight.camera import PinholeCamera
from deeplight.cli.compose import Args
from deeplight.compose.compose import Composed, Item, Settings, compose
from deeplight.compose.composite import write_layers
from deeplight.compose.gravity import tilt_of
from deeplight.compose.ground import DEFAULT_PITCH_RAD, Viewpoint
from deeplight.compose.mesh import load
from deeplight.compose.trace import FINAL, LIGHT_HEIGHT, PREVIEW
from deeplight.errors import ConfigError
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.io.atomic import replacing
from deeplight.io.environment_file import read_environment
from deeplight.io.photos import Photo, encode_jpeg, encode_png, read_photo
from deeplight.io.video import is_video
from deeplight.preprocess import Framing

PICTURES = (".png", ".jpg", ".jpeg")


def run_compose(args: Args) -> None:
    """Compose one photo or video, with a progress bar; print what was assumed.

    Raises:
        InputError: an option, the photo, the light or an object cannot be used.
        OSError: a file cannot be read or written.
    """
    items, video = items_of(args), is_video(args.photo)
    _check_names(args, video)
    for item in items:
        load(item.object, item.up)  # a bad mesh is told before anything takes time
    if video:
        from deeplight.cli.compose_video import run_video

        run_video(args, items)
        return
    photo, light, framing, notes = _lit(args)
    viewpoint, assumed = viewpoint_of(args, photo, framing)
    kept = framing.bottom
    with bar() as progress:
        task = progress.add_task("rendering", total=None)
        composed = compose(
            photo.pixels,
            light,
            viewpoint,
            items,
            settings_of(args),
            kept,
            lambda done, total: progress.update(task, completed=done, total=total),
        )
    _write(args, composed)
    console = Console(highlight=False, soft_wrap=True)
    made = f"{args.out}" + (f", {args.layers}" if args.layers else "")
    console.print(escape(f"{args.photo} -> {made}"))
    for note in (*notes, *assumed, *composed.notes):
        console.print(f"  [dim]{escape(note)}[/dim]")


def bar() -> Progress:
    """Give a progress bar on stderr that leaves nothing behind; none where nobody watches."""
    console = Console(stderr=True, highlight=False)
    return Progress(console=console, transient=True, disable=not console.is_terminal)


def items_of(args: Args) -> list[Item]:
    """Give the objects; an option given once counts for all of them.

    Raises:
        ConfigError: an option given neither once nor for each object, or a wrong value.
    """
    objects = args.object or ("bunny",)
    count = len(objects)
    at: Sequence[Any] = args.at or (None,) * count
    if len(at) != count:
        got = f"{len(at)} for {count} objects"
        raise ConfigError("one --at for each --object", got, "repeat it for each")
    return [
        Item(*values, up=args.up)
        for values in zip(
            objects,
            _each("--material", args.material, None, count),
            at,
            _each("--size", args.size, None, count),
            _each("--turn", args.turn, 0.0, count),
            strict=True,
        )
    ]


def settings_of(args: Args) -> Settings:
    """Give the rendering's settings."""
    quality = FINAL if args.quality == "final" else PREVIEW
    below, texture = args.below == "estimate", args.surface == "photo"
    return Settings(quality, args.engine, light_from_below=below, texture=texture)


def viewpoint_of(args: Args, photo: Photo, framing: Framing) -> tuple[Viewpoint, list[str]]:
    """Give the camera above the surface, and what had to be assumed."""
    tilt, notes = tilt_of(photo.source), []
    pitch, roll = DEFAULT_PITCH_RAD, 0.0
    if tilt is not None:
        pitch, roll = tilt.pitch_rad, tilt.roll_rad
        notes.append(f"camera pitch from {tilt.source}: {np.degrees(pitch):.0f} degrees")
    elif args.pitch is None:
        notes.append(f"camera tilt unknown, assumed {np.degrees(pitch):.0f} degrees: give --pitch")
    pitch = pitch if args.pitch is None else radians(args.pitch)
    roll = roll if args.roll is None else radians(args.roll)
    camera = PinholeCamera(framing.photo_width, framing.photo_height, framing.vertical_fov_rad)
    return Viewpoint(camera, args.camera_height, pitch, roll), notes


def _each(name: str, values: Sequence[Any], default: Any, count: int) -> Sequence[Any]:
    if len(values) not in (0, 1, count):
        got = f"{len(values)} for {count} objects"
        raise ConfigError(f"{name} once, or once for each --object", got, "repeat it for each")
    return values if len(values) == count else (values[0] if values else default,) * count


def _lit(args: Args) -> tuple[Photo, np.ndarray, Framing, tuple[str, ...]]:
    """The photo, its light (latlong), its framing and what reading had to decide."""
    photo, estimator = read_photo(args.photo), OnnxEstimator()
    if args.light is None:
        estimate = estimator.explain(photo, args.fov)
        return photo, gained(args, estimate.lighting.latlong()), estimate.framing, estimate.notes
    framing = estimator.frame(photo, args.fov)
    return photo, gained(args, light_of_file(args.light)), framing, photo.notes


def light_of_file(path: Path) -> np.ndarray:
    """Read the light to render with, as a latlong whose centre is the photo's view."""
    return read_environment(path, max_height=LIGHT_HEIGHT).radiance


def gained(args: Args, light: np.ndarray) -> np.ndarray:
    """Give the light made brighter by --stops."""
    return light * np.float32(2.0**args.stops)


def _check_names(args: Args, video: bool) -> None:
    allowed = (".mp4",) if video else PICTURES
    if args.out.suffix.lower() not in allowed:
        raise ConfigError(f"--out ending in {', '.join(allowed)}", f"{args.out}", "rename it")
    if args.out.exists() and args.photo.exists() and args.out.samefile(args.photo):
        raise ConfigError("another file as --out", "the photo itself", "rename it")
    if args.layers is not None and (video or args.layers.suffix.lower() != ".exr"):
        got = f"{args.layers}" + (" for a video" if video else "")
        raise ConfigError("--layers FILE.exr for a photo", got, "rename it or leave it out")


def _write(args: Args, composed: Composed) -> None:
    pixels = composed.composite.pixels
    encode = encode_png if args.out.suffix.lower() == ".png" else encode_jpeg
    with replacing(args.out) as temporary:
        temporary.write_bytes(encode(pixels))
    if args.layers is not None:
        write_layers(args.layers, composed.composite.layers, *pixels.shape[:2])
