"""Put objects into a photo: lit by its own light, with their shadow on its own surface.

deeplight compose photo.jpg --object chair.glb --at 420 610 --size 0.9 --pitch -20 --out a.png
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro import conf

if TYPE_CHECKING:
    from deeplight.compose.compose import ComposeSettings, Item
    from deeplight.compose.gravity import CameraPlacement
    from deeplight.environment import Environment

PICTURES = (".png", ".jpg", ".jpeg")


@dataclass(frozen=True)
class Args:
    """Options of `deeplight compose`. Those of an object are repeated for several objects."""

    photo: Annotated[Path, conf.Positional, conf.arg(metavar="PHOTO")]
    """The photo or video to put them into; nothing may stand in the way."""
    out: Path
    """The picture to write: .png or .jpg; .mp4 for a video."""
    object: Annotated[tuple[str, ...], conf.UseAppendAction] = ()
    """bunny (the default), sphere, pot, or a .glb, .gltf, .obj or .ply file."""
    material: Annotated[tuple[str, ...], conf.UseAppendAction] = ()
    """diffuse (grey, 34.5 %), silver (matte, 49.9 %), mirror, plastic, file (the file's own)."""
    at: Annotated[tuple[tuple[float, float], ...], conf.UseAppendAction] = ()
    """Pixel x y where it stands. Default: the freest patch of floor."""
    size: Annotated[tuple[float, ...], conf.UseAppendAction] = ()
    """Longest side in metres. Default: 30 % of the photo's shorter side, whatever that is."""
    turn: Annotated[tuple[float, ...], conf.UseAppendAction] = ()
    """Degrees anticlockwise from above."""
    up: Literal["y", "z"] = "y"
    """The axis that points up in mesh files."""
    light: Path | None = None
    """Use this light (.json of deeplight, or an .exr or .hdr panorama), not the estimate."""
    sun: tuple[float, float] | None = None
    """The sun's azimuth (0 is the view, positive to the right) and elevation in the picture,
    degrees. Default: by the photo's GPS data, where it has them, else as estimated."""
    fill: Literal["auto", "photo", "any", "indoor", "outdoor", "none"] = "auto"
    """What reflections show where the photo does not look: the photo's own rows going on, over them
    detail of a real place of that kind (auto: of the kind that the network is sure of), or none of
    both; the power of the light stays the same."""
    stops: float = 0.0
    """Make the light brighter by this number of stops."""
    camera_height: float = 1.4
    """Metres from the surface up to the camera."""
    pitch: float | None = None
    """Degrees the camera looks up. Default: from EXIF, else as the network and upright edges in the
    photo say, else -15."""
    roll: float | None = None
    """Degrees the camera is turned counter-clockwise. Default: from EXIF, else as upright edges
    say, else 0."""
    fov: float | None = None
    """Vertical field of view in degrees. Default: from EXIF, else 66 along the long side."""
    below: Literal["surface", "estimate"] = "surface"
    """What lights objects from below: the surface they stand on, or the estimated light."""
    surface: Literal["photo", "plain"] = "photo"
    """What objects see of that surface: the photo's own pixels, or their mean colour."""
    quality: Literal["preview", "final"] = "preview"
    """How many rays: seconds, or minutes."""
    layers: Path | None = None
    """Also write objects, shadow and mask as a layered EXR."""
    engine: Literal["auto", "llvm", "scalar"] = "auto"
    """Mitsuba's variant; llvm needs LLVM 16 or newer and pays for final quality."""


def run(args: Args) -> None:
    """Compose one photo or video, with a progress bar; print what was assumed.

    Raises:
        InputError: an option, the photo, the light or an object cannot be used.
        OSError: a file cannot be read or written.
    """
    from rich.markup import escape

    from deeplight.cli.screen import results_console
    from deeplight.compose.compose import WARNING
    from deeplight.compose.mesh import load
    from deeplight.io.video import is_video

    items, video = _items(args), is_video(args.photo)
    _check_names(args, video)
    for item in items:
        load(item.object, item.up)  # a bad mesh is refused before anything takes time
    notes = _compose_video(args, items) if video else _compose_photo(args, items)
    console = results_console()
    made = f"{args.out}" + (f", {args.layers}" if args.layers else "")
    console.print(escape(f"{args.photo} -> {made}"))
    for note in sorted(notes, key=lambda note: not note.startswith(WARNING)):
        console.print(f"  {escape(note)}", style="yellow" if note.startswith(WARNING) else "dim")


def _compose_photo(args: Args, items: "Sequence[Item]") -> tuple[str, ...]:
    from deeplight.cli.screen import progress_bar
    from deeplight.compose.composite import write_layers
    from deeplight.compose.photo import compose_photo
    from deeplight.estimators.sun import SunHint
    from deeplight.io.atomic import replacing
    from deeplight.io.photos import encode_jpeg, encode_png

    with progress_bar("rendering") as bar:
        composed = compose_photo(
            args.photo,
            items,
            _light(args),
            placement=_placement(args),
            settings=_settings(args),
            stops=args.stops,
            sun=None if args.sun is None else SunHint(angles_deg=args.sun),
            fill=None if args.fill == "none" else args.fill,
            progress=bar.reach,
        )
    pixels = composed.composite.pixels
    encode = encode_png if args.out.suffix.lower() == ".png" else encode_jpeg
    with replacing(args.out) as temporary:
        temporary.write_bytes(encode(pixels))
    if args.layers is not None:
        write_layers(args.layers, composed.composite.layers, *pixels.shape[:2])
    return composed.notes


def _compose_video(args: Args, items: "Sequence[Item]") -> tuple[str, ...]:
    from dataclasses import replace

    from deeplight.cli.screen import progress_bar
    from deeplight.compose.video import FRAME, compose_video

    settings, light = _settings(args), _light(args)
    if args.quality == "preview":
        settings = replace(settings, quality=FRAME)
    with progress_bar("composing") as bar:
        return compose_video(
            args.photo,
            args.out,
            items,
            settings,
            _placement(args),
            None if light is None else light.radiance,
            2.0**args.stops,
            bar.reach,
        )


def _items(args: Args) -> "list[Item]":
    """The objects; an option given once counts for all of them.

    Raises:
        ConfigError: an option given neither once nor for each object, or a wrong value.
    """
    from deeplight.compose.compose import Item
    from deeplight.errors import ConfigError

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


def _each(name: str, values: Sequence[Any], default: Any, count: int) -> Sequence[Any]:
    from deeplight.errors import ConfigError

    if len(values) not in (0, 1, count):
        got = f"{len(values)} for {count} objects"
        raise ConfigError(f"{name} once, or once for each --object", got, "repeat it for each")
    return values if len(values) == count else (values[0] if values else default,) * count


def _settings(args: Args) -> "ComposeSettings":
    from deeplight.compose.compose import ComposeSettings
    from deeplight.compose.trace import FINAL, PREVIEW

    quality = FINAL if args.quality == "final" else PREVIEW
    below, texture = args.below == "estimate", args.surface == "photo"
    return ComposeSettings(quality, args.engine, light_from_below=below, texture=texture)


def _placement(args: Args) -> "CameraPlacement":
    from deeplight.compose.gravity import CameraPlacement

    return CameraPlacement(args.camera_height, args.pitch, args.roll, args.fov)


def _light(args: Args) -> "Environment | None":
    """The given light, whose centre is the photo's view; None to estimate it."""
    from deeplight.compose.trace import LIGHT_HEIGHT
    from deeplight.io.environment_file import read_environment

    if args.light is None:
        return None
    return read_environment(args.light, max_height=LIGHT_HEIGHT)


def _check_names(args: Args, video: bool) -> None:
    from deeplight.errors import ConfigError

    allowed = (".mp4",) if video else PICTURES
    if args.out.suffix.lower() not in allowed:
        raise ConfigError(f"--out ending in {', '.join(allowed)}", f"{args.out}", "rename it")
    if args.out.exists() and args.photo.exists() and args.out.samefile(args.photo):
        raise ConfigError("another file as --out", "the photo itself", "rename it")
    if (args.sun or args.fill != "auto") and (video or args.light is not None):
        got = "a video" if video else "--light, which has its own"
        raise ConfigError("--sun and --fill for a photo whose light is estimated", got, "drop them")
    if args.layers is not None and (video or args.layers.suffix.lower() != ".exr"):
        got = f"{args.layers}" + (" for a video" if video else "")
        raise ConfigError("--layers FILE.exr for a photo", got, "rename it or leave it out")
