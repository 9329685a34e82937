"""Any file with light in all directions as an `Environment`: the one reader of panoramas."""

import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from deeplight.environment import Environment, Unit
from deeplight.errors import ConfigError, ImageFileError, ShapeError
from deeplight.io.boundary import reading
from deeplight.io.image_file import opened
from deeplight.io.lighting_file import (
    LATLONG_HEIGHT,
    VIEW_U,
    lamps_of_record,
    read_lighting_json,
    read_record,
    seen_of_record,
)
from deeplight.io.orientation import faces_for, turned_from
from deeplight.io.photos import PHOTO_SUFFIXES
from deeplight.io.radiance import MAX_HDR_PIXELS, is_floating_point, read_hdr
from deeplight.io.raw import RAW_SUFFIXES
from deeplight.lamp import Lamp, draw_lamps
from deeplight.lighting import Lighting
from deeplight.mappings import latlong
from deeplight.mappings.layouts import folded, latlong_from_cube, latlong_from_probe, mapping_of
from deeplight.mappings.resample import sample_latlong, shrink_latlong

SUFFIXES = (".exr", ".hdr")
"""What is taken for a panorama in a folder; a named file may also be a .tif or our .json."""


def read_environment(
    paths: Path | str | Sequence[Path],
    mapping: str | None = None,
    made_for: str | None = None,
    max_height: int | None = None,
    layer: str | None = None,
) -> Environment:
    """Read one picture in any mapping, six faces of a cube, or a lighting file of ours.

    Negative ringing next to a sun belongs to the sun's energy: it is clamped only after the area
    average to `max_height`.

    Args:
        paths: one file, or six in the order +X -X +Y -Y +Z -Z.
        mapping: of the picture; left out, its shape decides. For a square it must be given.
        made_for: the tool whose orientation the picture has; an EXR of ours says it itself. Left
            out, the centre column, or the middle of a disc or cross, is the view (a mirror ball's
            rim is the view).
        max_height: rows of the panorama; a finer file is averaged down to it.
        layer: of an EXR with several that could be the light.

    Returns:
        The light; relative to the camera's white if the file is one of ours, else in the file's
        own unit.

    Raises:
        OSError: a file cannot be read.
        ImageFileError: it holds no light: black, mostly negative, or of no mapping's shape.
        ConfigError: not one file and not six.
    """
    files = [Path(paths)] if isinstance(paths, str | Path) else [Path(path) for path in paths]
    if len(files) not in (1, 6):
        expected = "one file, or six faces +X -X +Y -Y +Z -Z"
        raise ConfigError(expected, f"{len(files)}", "name those")
    seen, lamps = None, None
    unit: Unit = "camera_white"
    try:
        with reading(files[0]):
            if len(files) == 6:
                radiance, unit = _six(files, made_for, layer)
            elif files[0].suffix.lower() == ".json":
                radiance, seen, lamps = _described(files[0])
            else:
                radiance, unit = _one(files[0], mapping, made_for, layer)
            if max_height is not None and len(radiance) > max_height:
                radiance = shrink_latlong(radiance, max_height)
            if seen is not None:
                directions = latlong.directions(len(radiance), 2 * len(radiance))
                seen = sample_latlong(seen[..., None], directions)[..., 0].clip(0, 1)
            return Environment(radiance, seen, unit=unit, known_lamps=lamps)
    except ShapeError as error:
        raise ImageFileError(error.expected, f"{files[0]}, {error.got}", error.do) from error


def holds_light(path: Path | str) -> bool:
    """Whether a file is light already rather than a photo: by its name, of a TIFF by its pixels.

    Raises:
        OSError, ImageFileError: a TIFF cannot be opened.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix in (".tif", ".tiff"):
        with reading(path), opened(path, MAX_HDR_PIXELS) as file:
            return is_floating_point(file)
    return suffix not in PHOTO_SUFFIXES | RAW_SUFFIXES


def load_lighting(path: Path | str) -> Lighting:
    """Read lighting back from a `.json` (exact) or any environment that `read_environment` takes.

    From an environment the mirror ball comes back with its power to 2 %; next to a strong light a
    pixel may take some of it.

    Raises:
        OSError: there is no such file, or reading it is not permitted.
        ImageFileError: it holds no light, or is a lighting file of another version or damaged.
    """
    path = Path(path)
    if path.suffix.lower() == ".json":
        return read_lighting_json(path)
    return read_environment(path).lighting


_Panorama = tuple[Float[np.ndarray, "height width 3"], Unit]
_Described = tuple[
    Float[np.ndarray, "height width 3"],
    Float[np.ndarray, "rows columns"] | None,
    tuple[Lamp, ...] | None,
]


def _one(
    path: Path, mapping: str | None, made_for: str | None, layer: str | None = None
) -> _Panorama:
    picture = read_hdr(path, layer)
    mapping = mapping or mapping_of(*picture.shape[:2])
    if mapping == "cube":
        raise ConfigError("six files of a cube", "one", "name six, or say strip or cross")
    if mapping == "latlong":
        return _latlong(path, latlong_from_probe(picture, mapping), made_for)
    if mapping in ("strip", "column"):
        return latlong_from_cube(faces_for(folded(picture, mapping), made_for)), "file"
    return latlong_from_probe(picture, mapping), "file"


def _described(path: Path) -> _Described:
    """What a lighting file describes: the environment next to it with its lamps, else its ball,
    in which no lamp is as small as it was."""
    record = read_record(path)
    try:
        lamps, drawn = lamps_of_record(record)
        names = [name for name in record["environment"]["files"] if name.endswith(".exr")]
        neighbour = path.with_name(Path(names[0]).name) if names else None
        if neighbour is None or not neighbour.is_file():
            return read_lighting_json(path).latlong(LATLONG_HEIGHT), None, None
        radiance, _ = _one(neighbour, "latlong", None)
        if not drawn:
            radiance = radiance + draw_lamps(lamps or (), len(radiance))
        return radiance, seen_of_record(record), lamps
    except (ValueError, KeyError, TypeError, zlib.error) as error:
        got = f"{path}, which is damaged ({type(error).__name__}: {error})"
        raise ImageFileError("a lighting file", got, "write it again") from error


def _latlong(
    path: Path, radiance: Float[np.ndarray, "height width 3"], made_for: str | None
) -> _Panorama:
    """A panorama with its view in the centre column; an EXR of ours says where it is."""
    with opened(path, max_pixels=10**9) as file:
        view_u = file.spec().getattribute(VIEW_U)
    unit: Unit = "file" if view_u is None else "camera_white"
    if made_for not in (None, "webxr"):
        return turned_from(radiance, made_for), unit
    shift = 0 if view_u is None else round((0.5 - float(view_u)) * radiance.shape[1])
    return np.roll(radiance, shift, axis=1), unit


def _six(paths: Sequence[Path], made_for: str | None, layer: str | None) -> _Panorama:
    faces = [read_hdr(path, layer) for path in paths]
    first = faces[0].shape
    for path, face in zip(paths, faces, strict=True):
        if face.shape != first or first[0] != first[1]:
            got = f"{path} of {face.shape[1]} x {face.shape[0]}"
            raise ImageFileError("six square faces of one size", got, "export them alike")
    return latlong_from_cube(faces_for(np.stack(faces), made_for)), "file"
