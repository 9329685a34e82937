"""The text files of a light stage's folder: which lights there are, and the camera.

    FOLDER/lights.json    {"distance_m": 1.2, "calibrated": false, "lights":
                           [{"file": "light_000.png", "direction": [x, y, z], "colour": [r, g, b]}]}
    FOLDER/lights.csv     instead of it: file,x,y,z,r,g,b or file,latitude_deg,longitude_deg
    FOLDER/camera.json    {"vertical_fov_deg": 4.0, "gamma": 1.0, "sphere_radius_m": 0.04,
                           "exposure": {"diffuse": 1.0, "mirror": 0.001}}

Directions are in the camera's frame, towards the light, from the sphere's centre. Latitude is
measured up from the level, longitude from +Z (the camera's side) towards +X (its right).
"""

import csv
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from deeplight.errors import DataSetError
from deeplight.frames import normalised
from deeplight.io.atomic import replacing
from deeplight.io.boundary import reads_as
from deeplight.io.json_text import read_json

LIGHTS_JSON, LIGHTS_CSV, CAMERA_JSON = "lights.json", "lights.csv", "camera.json"


@dataclass(frozen=True, eq=False)
class StageLights:
    """The lights of a stage, in the order of their photographs.

    Attributes:
        files: name of each light's photograph, the same in every sphere's folder.
        directions: unit, camera frame, from the sphere's centre; None where not known.
        colours: irradiance each light gives at the sphere's centre; None where not known.
        distance_m: from the sphere's centre to the lights; None is taken as far away.
        calibrated: colours are in the unit of the pixels: a white diffuser that faces a light
            of colour E, photographed with exposure 1, has the linear value E / pi.
    """

    files: tuple[str, ...]
    directions: Float[np.ndarray, "lights 3"] | None = None
    colours: Float[np.ndarray, "lights 3"] | None = None
    distance_m: float | None = None
    calibrated: bool = False


@dataclass(frozen=True)
class StageCamera:
    """What is known of the camera.

    Attributes:
        vertical_fov_deg: of the upright photograph; None where not known.
        gamma: of integer files; 1 is linear.
        exposure: of each sphere's photographs, relative or in seconds.
        sphere_radius_m: None where not known.
    """

    vertical_fov_deg: float | None = None
    gamma: float | None = None
    exposure: Mapping[str, float] = field(default_factory=dict)
    sphere_radius_m: float | None = None


@reads_as(DataSetError)
def read_lights(path: Path) -> StageLights:
    """The lights of a .json or .csv file.

    Raises:
        OSError: it cannot be read.
        DataSetError: it is broken, names a file twice, or describes some lights less than others.
    """
    table = _csv_rows(path) if path.suffix.lower() == ".csv" else _json(path)
    rows = table.get("lights")
    if not isinstance(rows, list) or not rows or not all(isinstance(r, dict) for r in rows):
        raise DataSetError(f"a list 'lights' in {path}", "none", "see docs/reflectance.md")
    files = tuple(str(row.get("file") or "") for row in rows)
    wrong = next((f for f in files if not f or Path(f).name != f or files.count(f) > 1), None)
    if wrong is not None:
        got = f"{wrong!r}"
        raise DataSetError(f"a plain file name of its own for each light of {path}", got, "name it")
    directions = _vectors(path, rows, "direction")
    colours = _vectors(path, rows, "colour")
    if directions is not None:
        if not (np.linalg.norm(directions, axis=1) > 0).all():
            raise DataSetError(f"directions of some length in {path}", "0, 0, 0", "correct it")
        directions = normalised(directions)
    if colours is not None and not (colours > 0).all():
        got = f"{files[int((colours <= 0).any(axis=1).argmax())]} with 0 or less"
        raise DataSetError(f"positive colours in {path}", got, "leave lights out that are dark")
    distance = _positive(path, table, "distance_m")
    return StageLights(files, directions, colours, distance, table.get("calibrated") is True)


def write_lights(path: Path, lights: StageLights) -> None:
    """Write lights.json, whole or not at all; OSError if that fails."""
    rows: list[dict[str, Any]] = [{"file": file} for file in lights.files]
    for key, values in (("direction", lights.directions), ("colour", lights.colours)):
        for row, value in zip(rows, () if values is None else values, strict=False):
            row[key] = [round(float(v), 7) for v in value]
    whole = {"distance_m": lights.distance_m, "calibrated": lights.calibrated, "lights": rows}
    write_json(path, whole)


def write_json(path: Path, values: Mapping[str, Any]) -> None:
    """Write plain values as JSON, whole or not at all; OSError if that fails."""
    with replacing(path) as temporary:
        temporary.write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8")


def read_camera(folder: Path) -> StageCamera:
    """What camera.json says; nothing where there is none.

    Raises:
        OSError: it cannot be read.
        DataSetError: it is broken.
    """
    path = folder / CAMERA_JSON
    if not path.is_file():
        return StageCamera()
    values = _json(path)
    exposure = values.get("exposure", {})
    if not isinstance(exposure, dict):
        raise DataSetError(f"exposure by sphere in {path}", f"{exposure!r}", "correct it")
    times = {name: _positive(path, exposure, name) or 1.0 for name in exposure}
    fov = _positive(path, values, "vertical_fov_deg")
    if fov is not None and fov >= 180:
        raise DataSetError(f"vertical_fov_deg below 180 in {path}", f"{fov}", "correct it")
    gamma, radius = _positive(path, values, "gamma"), _positive(path, values, "sphere_radius_m")
    return StageCamera(fov, gamma, times, radius)


def _json(path: Path) -> dict[str, Any]:
    try:
        values = read_json(path)
    except (UnicodeDecodeError, ValueError, RecursionError) as error:
        raise DataSetError(f"JSON in {path}", f"{error}", "repair it") from None
    if not isinstance(values, dict):
        raise DataSetError(f"a JSON object in {path}", type(values).__name__, "repair it")
    return values


def _csv_rows(path: Path) -> dict[str, Any]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            table = list(csv.DictReader(file))
    except (UnicodeDecodeError, csv.Error) as error:
        raise DataSetError(f"a CSV table in UTF-8 in {path}", f"{error}", "repair it") from None
    rows = []
    for cells in table:
        row: dict[str, Any] = {"file": cells.get("file")}
        if "x" in cells:
            row["direction"] = [_number(path, cells, key) for key in "xyz"]
        elif "latitude_deg" in cells:
            row["direction"] = _from_angles(
                _number(path, cells, "latitude_deg"), _number(path, cells, "longitude_deg")
            )
        if "r" in cells:
            row["colour"] = [_number(path, cells, key) for key in "rgb"]
        rows.append(row)
    return {"lights": rows}


def _from_angles(latitude_deg: float, longitude_deg: float) -> list[float]:
    up, around = math.radians(latitude_deg), math.radians(longitude_deg)
    level = math.cos(up)
    return [level * math.sin(around), math.sin(up), level * math.cos(around)]


def _number(path: Path, cells: Mapping[str, Any], key: str) -> float:
    try:
        return float(cells[key])
    except (KeyError, TypeError, ValueError):
        got = f"{cells.get(key)!r} for {cells.get('file')}"
        raise DataSetError(f"a number in column {key} of {path}", got, "correct it") from None


def _positive(path: Path, values: Mapping[str, Any], key: str) -> float | None:
    value = values.get(key)
    if value is None:
        return None
    if not isinstance(value, int | float) or not 0 < value < math.inf:
        raise DataSetError(f"a positive number as {key} in {path}", f"{value!r}", "correct it")
    return float(value)


def _vectors(path: Path, rows: list[dict[str, Any]], key: str) -> np.ndarray | None:
    """One row of three numbers per light; None if no light has any."""
    given = [row.get(key) for row in rows]
    if all(value is None for value in given):
        return None
    for row, value in zip(rows, given, strict=True):
        if not (isinstance(value, list) and len(value) == 3 and all(map(_is_number, value))):
            expected = f"{key} as three numbers for every light of {path}"
            raise DataSetError(expected, f"{value!r} for {row['file']}", "complete it")
    return np.array(given, float)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and math.isfinite(value)
