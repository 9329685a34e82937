"""Any other method's answers: a folder of HDR panoramas, one for each example (section 4.3)."""

import csv
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from deeplight.errors import ConfigError, DataSetError
from deeplight.evaluate.scores import LogRadiance
from deeplight.frames import world_from_camera
from deeplight.io.environment_file import SUFFIXES, read_environment
from deeplight.lighting import Lighting

ELEVATIONS = "elevations.csv"
MAX_HEIGHT = 256
"""Rows; more than the ball needs would take hours for thousands of 4k panoramas."""
DARKEST = 1e-6  # radiance: black still has a logarithm


class PanoramaEstimates:
    """A method known by its answers alone: FOLDER/<example's key>.exr or .hdr.

    Panoramas are equirectangular; the centre column is the direction the camera looks, the top is
    up. A method that gives them upright while the camera is tilted also gives the camera's
    elevation: one for all, or `elevations.csv` in the folder (columns key, elevation_deg),
    positive = looking up. They are averaged to the 32 x 32 mirror ball and turned to the camera's
    frame. Their scale is taken as it is, relative to camera white.
    """

    def __init__(self, name: str, folder: Path, elevation_deg: float | None = None) -> None:
        self._name, self.folder = name, folder
        self._files = {
            path.stem: path
            for path in sorted(folder.iterdir())
            if path.suffix.lower() in SUFFIXES and not path.name.startswith(".")
        }
        if not self._files:
            got = f"none in {folder}"
            raise DataSetError(f"panoramas ({', '.join(SUFFIXES)})", got, "name them by key")
        self._elevations = _elevations(folder / ELEVATIONS)
        self._elevation_deg = elevation_deg

    @property
    def name(self) -> str:
        """What tables call it."""
        return self._name

    def covers(self, key: str) -> bool:
        """Whether there is a panorama for this example."""
        return key in self._files

    def estimate_keys(self, keys: Sequence[str]) -> LogRadiance:
        """Give ln radiance for these examples.

        Raises:
            ImageFileError, ShapeError: a panorama is damaged or not twice as wide as high.
            DataSetError: there is none for a key, or no elevation while others have one.
        """
        balls = np.stack([self.lighting(key).radiance for key in keys])
        log_radiance: LogRadiance = np.log(np.maximum(balls, DARKEST))
        return log_radiance

    def lighting(self, key: str) -> Lighting:
        """The light of one example, in the camera's frame."""
        if key not in self._files:
            raise DataSetError(f"{key}.exr or .hdr in {self.folder}", "none", "add it")
        radiance = read_environment(self._files[key], max_height=MAX_HEIGHT).radiance
        camera_from_world = world_from_camera(0.0, math.radians(self._elevation(key))).T
        return Lighting.from_latlong(radiance, camera_from_world)

    def _elevation(self, key: str) -> float:
        if self._elevation_deg is not None:
            return self._elevation_deg
        if not self._elevations:
            return 0.0
        if key not in self._elevations:
            expected = f"an elevation for every panorama in {self.folder / ELEVATIONS}"
            raise DataSetError(expected, f"none for {key}", "complete it")
        return self._elevations[key]


def panorama_estimates(given: Sequence[str]) -> list[PanoramaEstimates]:
    """Open the folders that `--panoramas` names: NAME=FOLDER or NAME=FOLDER,ELEVATION_DEG.

    Raises:
        ConfigError: another form, or an elevation that is no angle from -90 to 90.
        DataSetError: no such folder, or no panoramas in it.
    """
    return [_opened(item) for item in given]


def _opened(item: str) -> PanoramaEstimates:
    name, equals, rest = item.partition("=")
    if not (name and equals and rest):
        raise ConfigError("NAME=FOLDER or NAME=FOLDER,ELEVATION_DEG", repr(item), "name the method")
    path, _, angle = rest.rpartition(",")
    elevation = None if not path else _angle(angle)
    folder = Path(rest if elevation is None else path)
    if not folder.is_dir():
        raise DataSetError(f"a folder of panoramas for {name}", f"{folder}", "correct the path")
    return PanoramaEstimates(name, folder, elevation)


def _angle(text: str) -> float | None:
    """The elevation in degrees; None where the text is no number, so part of a path."""
    try:
        angle = float(text)
    except ValueError:
        return None
    if not -90 <= angle <= 90:
        raise ConfigError("an elevation from -90 to 90 degrees", text, "give it in degrees")
    return angle


def _elevations(path: Path) -> dict[str, float]:
    if not path.is_file():
        return {}
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            found = {row["key"]: float(row["elevation_deg"]) for row in csv.DictReader(file)}
    except (UnicodeDecodeError, csv.Error, KeyError, TypeError, ValueError) as error:
        expected = f"columns key and elevation_deg in {path}"
        raise DataSetError(expected, f"{error!r}", "correct it") from None
    if not all(math.isfinite(angle) and abs(angle) <= 90 for angle in found.values()):
        raise DataSetError(f"elevations from -90 to 90 in {path}", "others", "give degrees")
    return found
