"""Light out: one environment in the format and orientation that somebody asked for."""

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType

import numpy as np

from deeplight.environment import Environment
from deeplight.errors import ConfigError, MissingExtraError
from deeplight.formats.gltf import glb, gltf
from deeplight.formats.webxr import light_estimate_file
from deeplight.harmonics import spherical_harmonics
from deeplight.io.atomic import replacing
from deeplight.io.gain_map import write_gain_map_jpeg
from deeplight.io.image_file import is_utf8
from deeplight.io.ktx2 import write_ktx2
from deeplight.io.lighting_file import (
    FRAME,
    LATLONG_HEIGHT,
    UNIT,
    VIEW_U,
    lamps_record,
    save_lighting,
    seen_record,
)
from deeplight.io.orientation import TOOLS, faces_for, turned_for
from deeplight.io.radiance import write_exr, write_hdr
from deeplight.lighting import Lighting
from deeplight.mappings import cube
from deeplight.mappings.layouts import cube_from_latlong, probe_from_latlong, resized, unfolded

LARGEST_SIZE = 8192
PICTURES = ("exr", "hdr", "jpg")
WITH_PICTURE = {"blender": "exr", "three": "exr", "unreal": "hdr", "usd": "exr"}
"""Formats with a picture next to them, and what that is: Unreal makes cubes of .hdr alone."""
ALWAYS_APART = ("unreal", "usd")
"""Of these, the ones whose picture never holds the compact lights."""
_NO_LIGHT = {"direction": [0.0, 1.0, 0.0], "irradiance": [0.0, 0.0, 0.0], "angularRadius": 0.0}
WITHOUT_VIEW = frozenset({"mirror-ball", "angular", "cross", "horizontal-cross"})
"""Mappings whose middle is the view (or its opposite) by definition, so that no tool turns them."""


@dataclass(frozen=True)
class FileSpec:
    """What to write.

    Attributes:
        path: of the file; a cube's six get `_px` and so on before the suffix, a script a picture
            of its name and tool next to it, a `.json` an `.exr` of its name.
        format: one of `FORMATS`; left out, that of the suffix, of a `.py` Blender's or Unreal's.
        mapping: of a picture, any `probe.Mapping`.
        made_for: the tool to turn it for.
        size: rows of a latlong, side of a disc or a face; left out, as fine as what came in.
        lamps_apart: leave the compact lights out of pictures; scripts and the `.json` then have
            them as lights. glTF, WebXR, USD and Unreal's script always do.
    """

    path: Path
    format: str | None = None
    mapping: str = "latlong"
    made_for: str | None = None
    size: int | None = None
    lamps_apart: bool = False

    def __post_init__(self) -> None:
        kind = self.kind
        if self.lamps_apart and kind == "ktx2":
            raise ConfigError("a format that has lights for --lamps-apart", kind, "drop it")
        if kind in ("exr", "hdr", "json") and self.path.suffix.lower() != f".{kind}":
            raise ConfigError(f"--out ending in .{kind}", f"{self.path}", "rename it")
        if self.mapping != "latlong" and kind not in PICTURES:
            got = f"{self.mapping} for {kind}"
            raise ConfigError(f"a picture ({', '.join(PICTURES)}) of that mapping", got, "drop one")
        if self.made_for and self.mapping in WITHOUT_VIEW:
            got = f"{self.mapping} for {self.made_for}"
            raise ConfigError("a latlong or a cube to turn for a tool", got, "drop one of them")
        if self.size is not None and not 4 <= self.size <= LARGEST_SIZE:
            raise ConfigError(f"a size of 4 to {LARGEST_SIZE}", f"{self.size}", "correct it")
        if self.size is not None and self.mapping == "latlong" and self.size % 2:
            raise ConfigError("an even number of rows", f"{self.size}", "correct it")

    @property
    def kind(self) -> str:
        """The format, by name.

        Raises:
            ConfigError: no format, and a suffix that names none.
        """
        if self.format is not None:
            return self.format
        name = self.path.name.lower()
        if name.endswith(".py") and self.made_for == "unreal":
            return "unreal"
        for suffix, kind in SUFFIXES.items():
            if name.endswith(suffix):
                return kind
        expected = f"--out ending in {' '.join(SUFFIXES)}"
        raise ConfigError(expected, f"{self.path}", "rename it or give --format")

    @property
    def files(self) -> list[Path]:
        """What will be written."""
        if self.kind == "json":
            return [self.path, self.path.with_suffix(".exr")]
        if self.kind in WITH_PICTURE:
            picture = f".{self.kind}.{WITH_PICTURE[self.kind]}"
            return [self.path, self.path.with_suffix(picture)]
        if self.mapping != "cube":
            return [self.path]
        signs = {"+": "p", "-": "n"}
        ends = [f"_{signs[name[0]]}{name[1]}" for name in cube.FACES]
        return [self.path.with_name(f"{self.path.stem}{e}{self.path.suffix}") for e in ends]

    def must_not_replace(self, inputs: Sequence[Path]) -> None:
        """Raise ConfigError if the output is one of the inputs."""
        for path in inputs:
            for out in self.files:
                if path.exists() and out.exists() and path.samefile(out):
                    got = f"{path}, an input, which {out.name} would replace"
                    raise ConfigError("another name for --out", got, "rename it")


SUFFIXES: Mapping[str, str] = MappingProxyType(
    {
        ".exr": "exr",
        ".hdr": "hdr",
        ".jpg": "jpg",
        ".jpeg": "jpg",
        ".webxr.json": "webxr",
        ".json": "json",
        ".ktx2": "ktx2",
        ".gltf": "gltf",
        ".glb": "glb",
        ".py": "blender",
        ".js": "three",
        ".usda": "usd",
        ".usdc": "usd",
    }
)
"""What a name's ending says; the longer of two comes first."""


def write_environment(environment: Environment, spec: FileSpec) -> list[Path]:
    """Write what `spec` names, each file whole or not at all; give the files written.

    Raises:
        OSError: a file cannot be written.
        InputError: the tool takes no such picture.
    """
    return FORMATS[spec.kind](environment, spec)


def _panorama(environment: Environment, spec: FileSpec) -> np.ndarray:
    """The panorama to write, with or without the lights that tools add themselves."""
    return environment.ambient if spec.lamps_apart else environment.radiance


def _picture(environment: Environment, spec: FileSpec) -> list[Path]:
    panorama = _panorama(environment, spec)
    rows = len(panorama)
    if spec.mapping in ("cube", "strip", "column"):
        faces = cube_from_latlong(panorama, spec.size or max(rows // 2, 4))
        faces = faces_for(faces, spec.made_for)
        if spec.mapping == "cube":
            return [_written(p, face, spec) for p, face in zip(spec.files, faces, strict=True)]
        return [_written(spec.path, unfolded(faces, spec.mapping), spec)]
    cross = "cross" in spec.mapping
    # Quarter turns need whole columns, so an odd panorama gives up a row for a tool.
    whole = rows - rows % 2 if spec.made_for in TOOLS else rows
    size = spec.size or (max(rows // 2, 4) if cross else whole)
    picture = probe_from_latlong(panorama, spec.mapping, size)
    if spec.mapping == "latlong" and spec.made_for in TOOLS:
        picture = turned_for(picture, spec.made_for)
    return [_written(spec.path, picture, spec)]


def _written(path: Path, picture: np.ndarray, spec: FileSpec) -> Path:
    radiance = np.ascontiguousarray(picture, np.float32)
    if spec.kind == "exr":
        header: dict[str, str | int | float] = {"deeplight:unit": UNIT, "deeplight:frame": FRAME}
        if spec.mapping == "latlong":
            tool = TOOLS.get(spec.made_for or "")
            header[VIEW_U] = tool.view_u if tool else 0.5
        write_exr(path, radiance, header)
    elif spec.kind == "hdr":
        write_hdr(path, radiance)
    else:
        write_gain_map_jpeg(path, radiance)
    return path


def _lighting_file(environment: Environment, spec: FileSpec) -> list[Path]:
    tool = TOOLS.get(spec.made_for or "")
    turn = tool.turn if tool else None
    latlong = resized(_panorama(environment, spec), spec.size or LATLONG_HEIGHT)
    stem = spec.path.with_suffix("")
    facts = {"lamps": lamps_record(environment.lamps, in_environment=not spec.lamps_apart)}
    if environment.seen is not None:
        facts["seen"] = seen_record(environment.seen)
    return save_lighting(
        environment.lighting,
        stem,
        turn=turn,
        latlong=latlong,
        facts=facts,
        main_light=environment.main_light,
    )


def _webxr(environment: Environment, spec: FileSpec) -> list[Path]:
    content = light_estimate_file(environment.lighting, environment.main_light)
    return _text(spec.path, json.dumps(content, indent=1) + "\n")


def _ktx2(environment: Environment, spec: FileSpec) -> list[Path]:
    if spec.made_for not in (None, "webxr"):
        raise ConfigError("a KTX2 cube as OpenGL has it", f"--for {spec.made_for}", "drop --for")
    size = spec.size or max(len(environment.radiance) // 2, 4)
    faces = faces_for(cube_from_latlong(environment.radiance, size), "webxr")
    write_ktx2(spec.path, faces.astype(np.float32), UNIT)
    return [spec.path]


def _gltf(environment: Environment, spec: FileSpec) -> list[Path]:
    return _text(spec.path, json.dumps(gltf(environment)) + "\n")


def _glb(environment: Environment, spec: FileSpec) -> list[Path]:
    with replacing(spec.path) as temporary:
        temporary.write_bytes(glb(environment))
    return [spec.path]


def _script(tool: str, snippet: str) -> Callable[[Environment, FileSpec], list[Path]]:
    def write(environment: Environment, spec: FileSpec) -> list[Path]:
        if spec.made_for not in (None, tool):
            raise ConfigError(f"a script for {tool}", f"--for {spec.made_for}", "drop --for")
        picture = _picture_next_to(spec, tool)
        text = files("deeplight.formats").joinpath("snippets", snippet).read_text(encoding="utf-8")
        lights = [
            {
                "direction": lamp.direction.tolist(),
                "irradiance": lamp.irradiance.tolist(),
                "angularRadius": lamp.angular_radius_rad,
            }
            for lamp in environment.lamps
        ]
        rest = Lighting.from_latlong(environment.ambient)
        for mark, value in {
            "NAME": re.sub(r"[^\w .-]", "_", spec.path.stem),
            "PICTURE": json.dumps(picture.path.name),
            "MAIN_LIGHT": json.dumps(lights[0] if lights else _NO_LIGHT),
            "LIGHTS": json.dumps(lights),
            "APART": json.dumps(spec.lamps_apart),
            "HARMONICS": json.dumps(spherical_harmonics(rest).tolist()),
        }.items():
            text = text.replace(f"@{mark}@", value)
        return [*_picture(environment, picture), *_text(spec.path, text)]

    return write


def _usd(environment: Environment, spec: FileSpec) -> list[Path]:
    try:
        from deeplight.formats.usd import write_usd
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "pxr":
            raise
        raise MissingExtraError("usd", f"writing {spec.path.name}") from error
    if spec.made_for is not None:
        raise ConfigError("a USD stage", f"--for {spec.made_for}", "drop --for")
    if not is_utf8(spec.path):  # as the names in a stage are
        raise ConfigError("a name in UTF-8", f"{ascii(spec.path.name)}", "rename it")
    texture = _picture_next_to(spec, "usd")
    files = _picture(environment, texture)
    write_usd(spec.path, environment.lamps, texture.path.name)
    return [*files, spec.path]


def _picture_next_to(spec: FileSpec, tool: str) -> FileSpec:
    """What is written next to a script or a stage for `tool`."""
    apart = spec.lamps_apart or tool in ALWAYS_APART
    path, kind = spec.files[1], WITH_PICTURE[tool]
    return replace(spec, path=path, format=kind, made_for=tool, lamps_apart=apart)


def _text(path: Path, text: str) -> list[Path]:
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return [path]


FORMATS: Mapping[str, Callable[[Environment, FileSpec], list[Path]]] = MappingProxyType(
    {
        "exr": _picture,
        "hdr": _picture,
        "jpg": _picture,
        "json": _lighting_file,
        "webxr": _webxr,
        "ktx2": _ktx2,
        "gltf": _gltf,
        "glb": _glb,
        "blender": _script("blender", "blender.py.txt"),
        "three": _script("three", "three.js"),
        "unreal": _script("unreal", "unreal.py.txt"),
        "usd": _usd,
    }
)
"""How each format is written."""
