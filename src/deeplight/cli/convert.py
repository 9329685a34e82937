"""Bring light into the format of a tool, right side up, edited on the way.

deeplight convert photo.jpg --out light.glb

deeplight convert out/photo.json --out light.py --for unreal

deeplight convert studio.hdr --out light.exr --for blender --turn 30 0 0 --stops -1

deeplight convert --test-panorama --out test.js
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from deeplight.edit import Edit
from deeplight.environment import Environment
from deeplight.mappings.layouts import Mapping

Format = Literal[
    "exr",
    "hdr",
    "jpg",
    "json",
    "webxr",
    "ktx2",
    "gltf",
    "glb",
    "blender",
    "three",
    "unreal",
    "usd",
]
Tool = Literal["blender", "three", "mitsuba", "unity", "unreal", "usd", "webxr"]


@dataclass(frozen=True)
class Args:
    """Options of `deeplight convert`."""

    inputs: Annotated[
        tuple[Path, ...],
        tyro.conf.Positional,
        tyro.conf.arg(metavar="IN...", help_behavior_hint="(one, or six faces)"),
    ]
    """A photo, whose light is estimated; a lighting .json or .exr of deeplight, an HDR picture, or
    six faces +X -X +Y -Y +Z -Z."""
    out: Path
    """.exr .hdr .jpg .json .webxr.json .ktx2 .gltf .glb .py (Blender, or Unreal with --for) .js
    (three.js) .usda .usdc."""
    format: Format | None = None
    """What to write, if the name's ending does not say."""
    mapping: Mapping = "latlong"
    """Mapping of a picture that is written; cube gives six files."""
    size: int | None = None
    """Rows of a latlong, side of a disc or a face. Default: as fine as what comes in."""
    made_for: Annotated[Tool | None, tyro.conf.arg(name="for")] = None
    """Turn a latlong or a cube for this tool; a .py becomes a script for it."""
    in_mapping: Mapping | None = None
    """Mapping of IN. Default: by its shape; for a square it must be given."""
    made_from: Annotated[Tool | None, tyro.conf.arg(name="from")] = None
    """IN is turned as this tool has it."""
    layer: str | None = None
    """Layer of IN, an EXR with several that could be the light."""
    fov: float | None = None
    """Vertical field of view of an upright photo in degrees. Default: from EXIF, else 66 degrees
    along the long side."""
    lamps_apart: bool = False
    """Leave the compact lights out of the picture; scripts and the .json have them as lights."""
    test_panorama: bool = False
    """Use the labelled test panorama instead of IN."""
    edit: Annotated[Edit, tyro.conf.arg(name="")] = field(default_factory=Edit)


def run(args: Args) -> None:
    """Read or estimate, edit and write."""
    from rich.console import Console

    from deeplight.cli.flags import refuse_unused
    from deeplight.formats.files import FileSpec, write_environment
    from deeplight.formats.labelled import labelled_environment

    if args.test_panorama:
        refuse_unused(args, "with --test-panorama", "inputs", "in_mapping", "made_from", "fov")
    spec = FileSpec(args.out, args.format, args.mapping, args.made_for, args.size, args.lamps_apart)
    spec.must_not_replace(args.inputs)
    light, notes = (labelled_environment(), ()) if args.test_panorama else _light(args)
    console = Console(highlight=False, soft_wrap=True, markup=False)
    console.print(*write_environment(light.edited(args.edit), spec), sep="\n")
    for note in notes:
        console.print(f"  {note}", style="dim")


def _light(args: Args) -> tuple[Environment, tuple[str, ...]]:
    """The light that comes in, and what the user should know of it."""
    from deeplight.cli.flags import refuse_unused
    from deeplight.errors import ConfigError
    from deeplight.estimators.estimate import estimate_file
    from deeplight.io.environment_file import holds_light, read_environment
    from deeplight.io.video import is_video

    if len(args.inputs) != 1 or (not is_video(args.inputs[0]) and holds_light(args.inputs[0])):
        refuse_unused(args, "with what is light already", "fov")
        return read_environment(args.inputs, args.in_mapping, args.made_from, layer=args.layer), ()
    (path,) = args.inputs
    if is_video(path):
        raise ConfigError("a photo", f"{path}", "gather a video's light with deeplight fuse")
    if args.fov is not None and not 0 < args.fov < 180:
        raise ConfigError("--fov between 0 and 180 degrees", f"{args.fov:g}", "correct it")
    refuse_unused(args, "with a photo", "in_mapping", "made_from", "layer")
    rows = args.size if args.mapping == "latlong" else None
    return estimate_file(path, args.fov, rows)
