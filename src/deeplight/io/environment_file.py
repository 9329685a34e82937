"""Any file with light in all directions as an `Environment`."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from deeplight.environment import Environment
from deeplight.errors import ConfigError, ImageFileError, ShapeError
from deeplight.io.lighting_file import load_lighting, view_u
from deeplight.io.orientation import faces_for, turned_from
from deeplight.io.radiance import read_hdr
from deeplight.mappings.layouts import folded, latlong_from_cube, latlong_from_probe, mapping_of

LATLONG_HEIGHT = 256
"""Rows of the panorama made of a `.json`'s 32 x 32 mirror ball."""


def read_environment(
    paths: Sequence[Path], mapping: str | None = None, made_for: str | None = None
) -> Environment:
    """Read one picture in any mapping, six faces of a cube, or a lighting file of ours.

    Args:
        paths: one file, or six in the order +X -X +Y -Y +Z -Z.
        mapping: of the picture; left out, its shape tells. Of a square it must be told.
        made_for: the tool whose orientation the picture has; an EXR of ours tells it itself. Left
            out, the centre column, or the middle of a disc or cross, is the view (a mirror ball's
            rim is the view).

    Raises:
        OSError: a file cannot be read.
        ImageFileError: it holds no light.
        ShapeError: it has no mapping's shape, or faces of different sizes.
        ConfigError: not one file and not six.
    """
    if len(paths) == 6:
        return Environment(latlong_from_cube(faces_for(_six(paths), made_for)))
    if len(paths) != 1:
        raise ConfigError("one file, or six faces +X -X +Y -Y +Z -Z", f"{len(paths)}", "name those")
    path = paths[0]
    try:
        return _one(path, mapping, made_for)
    except ShapeError as error:
        raise ImageFileError(error.expected, f"{path}, {error.got}", error.do) from error


def _one(path: Path, mapping: str | None, made_for: str | None) -> Environment:
    if path.suffix.lower() == ".json":
        return Environment(load_lighting(path).latlong(LATLONG_HEIGHT))
    picture = read_hdr(path)
    mapping = mapping or mapping_of(*picture.shape[:2])
    if mapping == "cube":
        raise ConfigError("six files of a cube", "one", "name six, or say strip or cross")
    if mapping == "latlong":
        radiance = latlong_from_probe(picture, mapping)
        if made_for in (None, "webxr"):
            shift = round((0.5 - view_u(path)) * picture.shape[1])
            return Environment(np.roll(radiance, shift, axis=1))
        return Environment(turned_from(radiance, made_for))
    if mapping in ("strip", "column"):
        return Environment(latlong_from_cube(faces_for(folded(picture, mapping), made_for)))
    return Environment(latlong_from_probe(picture, mapping))


def _six(paths: Sequence[Path]) -> np.ndarray:
    faces = [read_hdr(path) for path in paths]
    first = faces[0].shape
    for path, face in zip(paths, faces, strict=True):
        if face.shape != first or first[0] != first[1]:
            got = f"{path} of {face.shape[1]} x {face.shape[0]}"
            raise ImageFileError("six square faces of one size", got, "export them alike")
    return np.stack(faces)
