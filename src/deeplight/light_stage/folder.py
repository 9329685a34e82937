"""The photographs of a light stage's folder, sphere by sphere."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float32

from deeplight.camera import PinholeCamera
from deeplight.errors import DataSetError, ImageFileError
from deeplight.io.light_stage_file import (
    LIGHTS_CSV,
    LIGHTS_JSON,
    StageCamera,
    StageLights,
    read_camera,
    read_lights,
)
from deeplight.io.photograph import PHOTOGRAPH_SUFFIXES, read_photograph
from deeplight.io.photos import read_photo

MIRROR = "mirror"
DARK, OUTLINE = "dark", "outline"
DEFAULT_GAMMA = 2.2
_WHITE = 0.999  # of the largest integer: more is saturated


@dataclass(frozen=True, eq=False)
class SpherePhotographs:
    """One sphere's photographs: linear, dark frame subtracted, brought to exposure 1.

    Attributes:
        name: mirror, matte_silver, diffuse or another.
        folder: where they lie.
        gamma: of integer files.
        exposure: what they are divided by.
        dark: the dark frame as read; zero where there is none.
    """

    name: str
    folder: Path
    gamma: float
    exposure: float
    dark: Float32[np.ndarray, "height width 3"]

    def photograph(self, file: str) -> tuple[Float32[np.ndarray, "height width 3"], bool]:
        """One photograph, and whether any of its pixels is saturated.

        Raises:
            ImageFileError: broken, or of another size than the others.
        """
        raw = read_photograph(self.folder / file, self.gamma)
        if raw.shape != self.dark.shape:
            height, width, _ = raw.shape
            got = f"{self.folder / file} of {width} x {height}"
            expected = f"photographs of {self.dark.shape[1]} x {self.dark.shape[0]}, like the first"
            raise ImageFileError(expected, got, "photograph a sphere with one camera setting")
        saturated = not file.lower().endswith((".exr", ".hdr")) and float(raw.max()) >= _WHITE
        return (raw - self.dark) / np.float32(self.exposure), saturated

    def outline_photograph(self) -> Float32[np.ndarray, "height width 3"] | None:
        """The photograph in a lit room, if there is one."""
        path = _named(self.folder, OUTLINE)
        return None if path is None else self.photograph(path.name)[0]


@dataclass(frozen=True, eq=False)
class StageFolder:
    """What a folder of a light stage holds.

    Attributes:
        lights: in the order of the photographs.
        camera: what is known of it.
        spheres: the photographs by sphere, mirror first.
        notes: what the user should know.
    """

    lights: StageLights
    camera: StageCamera
    spheres: dict[str, SpherePhotographs]
    notes: tuple[str, ...]

    def pinhole(self, name: str, fov_deg: float | None) -> PinholeCamera:
        """The camera of a sphere's photographs.

        Raises:
            DataSetError: its field of view is nowhere stated.
        """
        sphere = self.spheres[name]
        fov = fov_deg or self.camera.vertical_fov_deg
        if fov is None:
            exif = read_photo(sphere.folder / self.lights.files[0]).vertical_fov_rad
            if exif is None:
                expected = "the camera's vertical field of view"
                do = "give --fov DEGREES or camera.json"
                raise DataSetError(expected, "none in camera.json nor in EXIF", do)
            fov = float(np.degrees(exif))
        height, width, _ = sphere.dark.shape
        return PinholeCamera(width, height, float(np.radians(fov)))


def open_stage(
    folder: Path, material: str | None, lights: Path | None, gamma: float | None
) -> StageFolder:
    """Look what there is, before any work.

    Args:
        material: name of the one sphere whose photographs lie in `folder` itself; None: each
            sphere has a sub-folder of its name.
        lights: a .json or .csv; None: the folder's own, or else the photographs themselves.
        gamma: of integer files, before what camera.json says.

    Raises:
        OSError: a file cannot be read.
        DataSetError: no photographs, or some are missing.
        ImageFileError: the first ones are broken.
    """
    if not folder.is_dir():
        raise DataSetError("a folder of photographs", f"{folder}", "give the light stage's folder")
    camera = read_camera(folder)
    camera = replace(camera, gamma=gamma or camera.gamma or DEFAULT_GAMMA)
    folders = {material: folder} if material else _sphere_folders(folder)
    stage_lights = _lights(folder, folders, lights)
    notes, spheres = [], {}
    for name, place in folders.items():
        missing = [file for file in stage_lights.files if not (place / file).is_file()]
        if missing:
            got = f"{len(missing)} missing in {place}, {missing[0]} the first"
            do = "photograph them or take them from the list of lights"
            raise DataSetError("a photograph for every light", got, do)
        spheres[name], noted = _sphere(name, place, stage_lights.files[0], camera)
        notes += noted
    return StageFolder(stage_lights, camera, spheres, tuple(notes))


def _sphere(
    name: str, folder: Path, first: str, camera: StageCamera
) -> tuple[SpherePhotographs, list[str]]:
    assert camera.gamma is not None
    path = _named(folder, DARK)
    dark = read_photograph(folder / first if path is None else path, camera.gamma)
    notes = []
    if path is None:
        dark = np.zeros_like(dark)
        notes.append(f"{name}: no dark frame (dark.png or .exr), room light stays in")
    return SpherePhotographs(
        name, folder, camera.gamma, camera.exposure.get(name, 1.0), dark
    ), notes


def _sphere_folders(folder: Path) -> dict[str, Path]:
    found = {place.name: place for place in sorted(folder.iterdir()) if any(_photographs(place))}
    if not found:
        do = "give --material NAME if the photographs lie in it directly"
        raise DataSetError(f"folders named after spheres in {folder}", "none", do)
    return dict(sorted(found.items(), key=lambda item: item[0] != MIRROR))


def _lights(folder: Path, folders: dict[str, Path], given: Path | None) -> StageLights:
    for path in (given,) if given else (folder / LIGHTS_JSON, folder / LIGHTS_CSV):
        if given or path.is_file():
            return read_lights(path)
    files = tuple(sorted(path.name for path in _photographs(next(iter(folders.values())))))
    if not files:
        raise DataSetError(f"photographs in {folder}", "none", "give the light stage's folder")
    return StageLights(files)


def all_linear(folder: Path) -> bool:
    """Whether every photograph of a stage's folder is in floating point, which has no gamma."""
    found = [path for place in (folder, *folder.glob("*")) for path in _photographs(place)]
    return bool(found) and all(path.suffix.lower() in (".exr", ".hdr") for path in found)


def _photographs(folder: Path) -> Iterator[Path]:
    """Photographs under single lights."""
    if not folder.is_dir() or folder.name.startswith("."):
        return
    for path in folder.iterdir():
        named = path.suffix.lower() in PHOTOGRAPH_SUFFIXES and not path.name.startswith(".")
        if named and path.stem not in (DARK, OUTLINE):
            yield path


def _named(folder: Path, stem: str) -> Path | None:
    """dark.png and the like."""
    paths = (folder / f"{stem}{suffix}" for suffix in sorted(PHOTOGRAPH_SUFFIXES))
    return next((path for path in paths if path.is_file()), None)
