"""Reflectance bases on disk: one .npz of plain arrays for all spheres of a measurement.

<sphere>/weights               float32 (pixels of the crop, pixels of the light)
<sphere>/ball_from_camera      float64 (3, 3)
<sphere>/angular_radius_rad    float64
provenance                     JSON text: what was measured, how, and what came out
version                        1
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from deeplight.errors import DataSetError, InputError
from deeplight.io.arrays_file import read_arrays
from deeplight.io.atomic import replacing
from deeplight.io.boundary import reads_as
from deeplight.io.json_text import parse_json
from deeplight.reflectance import ReflectanceBasis, rig_bases
from deeplight.sphere import Rig, SphereView

VERSION = 1
MAX_BYTES = 256 * 2**20  # unpacked; a basis of 32 x 32 light takes 4 MB

_FIELDS = ("weights", "ball_from_camera", "angular_radius_rad")


def save_bases(
    path: Path | str, bases: Mapping[str, ReflectanceBasis], provenance: Mapping[str, Any]
) -> None:
    """Write a .npz, whole or not at all; OSError if that fails."""
    arrays: dict[str, Any] = {"version": VERSION, "provenance": json.dumps(provenance)}
    for name, basis in bases.items():
        view = basis.view
        values = (basis.weights, view.ball_from_camera, view.angular_radius_rad)
        arrays |= {f"{name}/{key}": v for key, v in zip(_FIELDS, values, strict=True)}
    with replacing(Path(path)) as temporary, temporary.open("wb") as file:
        np.savez_compressed(file, **arrays)


@reads_as(DataSetError)
def load_bases(
    path: Path | str, rig: Rig | None = None, light_size: int | None = None
) -> dict[str, ReflectanceBasis]:
    """Bases by sphere, as photographed or, with `rig`, as its spheres are seen.

    Of a rig all three come out: measured ones turned into its views, the mirror one-hot and any
    other that the file lacks analytic. Nothing in the file is executed.

    Args:
        light_size: of a rig's bases; left out, that of the measurement.

    Raises:
        OSError: it cannot be read.
        DataSetError: it is no file of bases, or damaged.
    """
    bases = _read(Path(path))
    if rig is None:
        return bases
    size = light_size or next(basis.light_size for basis in bases.values())
    measured = {
        name: basis.turned(rig.views[name], size)
        for name, basis in bases.items()
        if name in rig.views and name != "mirror"
    }
    return {**rig_bases(rig, size), **measured}


def load_provenance(path: Path | str) -> dict[str, Any]:
    """What the file says about its making; OSError or DataSetError as `load_bases`."""
    text = str(_arrays(Path(path)).get("provenance", "{}"))
    try:
        return dict(parse_json(text))
    except ValueError:
        raise _broken(Path(path), "a provenance that is no JSON") from None


def _read(path: Path) -> dict[str, ReflectanceBasis]:
    arrays = _arrays(path)
    if int(arrays.get("version", np.array(0))) != VERSION:
        raise _broken(path, f"version {arrays.get('version')}")
    names = sorted({key.partition("/")[0] for key in arrays if "/" in key})
    try:
        bases = {name: _basis(*(arrays[f"{name}/{key}"] for key in _FIELDS)) for name in names}
    except (KeyError, ValueError, TypeError, InputError) as error:
        raise _broken(path, f"{error}") from None
    if not bases or len({basis.light_size for basis in bases.values()}) > 1:
        raise _broken(path, "no sphere, or lights of several sizes")
    return bases


def _basis(weights: np.ndarray, turn: np.ndarray, angular: np.ndarray) -> ReflectanceBasis:
    pixels, lights = weights.shape
    size, light_size = int(np.sqrt(pixels)), int(np.sqrt(lights))
    if turn.shape != (3, 3) or not np.isfinite(turn).all():
        raise ValueError("ball_from_camera is no rotation")
    view = SphereView(turn.astype(float), float(angular), size)
    return ReflectanceBasis(weights.astype(np.float32), view, light_size)


def _arrays(path: Path) -> dict[str, np.ndarray]:
    try:
        return read_arrays(path, MAX_BYTES)
    except ValueError as error:
        raise _broken(path, f"{error}") from None


def _broken(path: Path, got: str) -> DataSetError:
    do = "make it with `deeplight reflectance`"
    return DataSetError(f"reflectance bases in {path}", " ".join(got.split())[:160], do)
