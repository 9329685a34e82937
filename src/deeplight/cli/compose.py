"""Put objects into a photo: lit by its own light, with their shadow on its own surface.

deeplight compose photo.jpg --object chair.glb --at 420 610 --size 0.9 --pitch -20 --out a.png
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from tyro import conf


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
    """Pixel x y where it stands. Default: the lower middle."""
    size: Annotated[tuple[float, ...], conf.UseAppendAction] = ()
    """Longest side in metres. Default: 30 % of the photo's shorter side, whatever that is."""
    turn: Annotated[tuple[float, ...], conf.UseAppendAction] = ()
    """Degrees anticlockwise from above."""
    up: Literal["y", "z"] = "y"
    """The axis that points up in mesh files."""
    light: Path | None = None
    """Use this light (.json of deeplight, or an .exr or .hdr panorama), not the estimate."""
    stops: float = 0.0
    """Make the light brighter by so many stops."""
    camera_height: float = 1.4
    """Metres from the surface up to the camera."""
    pitch: float | None = None
    """Degrees the camera looks up. Default: from EXIF, else -15."""
    roll: float | None = None
    """Degrees the camera is turned counter-clockwise. Default: from EXIF, else 0."""
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
    from deeplight.cli.compose_run import run_compose

    run_compose(args)
