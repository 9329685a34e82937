"""Rig files: a rig located before, or where the spheres are next to a tag.

A located rig is what `Rig.to_dict` gives. A tag rig:

    {"tag": {"family": "36h11", "id": 0, "size_m": 0.04},
     "spheres": {"mirror": {"centre_m": [-0.1, 0.06, 0.0], "diameter_m": 0.08}, ...}}

with centres in the tag's frame: origin in its middle, +X to its right, +Y to its top, +Z out of
its face; `size_m` is the side of its black square.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from deeplight.capture.located import TagRig
from deeplight.errors import DataSetError, InputError
from deeplight.io.atomic import replacing
from deeplight.io.boundary import reads_as
from deeplight.io.json_text import parse_json
from deeplight.sphere import SPHERES, Rig

_LARGEST_FILE = 1_000_000  # bytes; a rig file has a few hundred


@reads_as(DataSetError)
def read_rig_file(path: Path | str) -> Rig | TagRig:
    """The rig in a JSON file.

    Raises:
        OSError: there is no such file or it cannot be read.
        DataSetError: not JSON, or not a rig of three spheres.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            content = file.read(_LARGEST_FILE)
        values = parse_json(content)
        return _tag_rig(values) if "tag" in values else _saved_rig(values)
    except (ValueError, TypeError, KeyError, AttributeError, InputError, RecursionError) as error:
        raise DataSetError(
            "a rig file: a located rig, or a tag and its three spheres",
            f"{path} ({_reason(error)})",
            "locate the rig again, or see docs/locate.md for the form",
        ) from error


def write_rig_file(path: Path | str, rig: Rig | TagRig) -> None:
    """Write a rig so that `read_rig_file` gives it back."""
    values = rig.to_dict() if isinstance(rig, Rig) else _tag_values(rig)
    with replacing(Path(path)) as temporary:
        temporary.write_text(json.dumps(values, indent=1) + "\n")


def _reason(error: Exception) -> str:
    if isinstance(error, KeyError):
        return f"no {error}"
    if isinstance(error, InputError):
        return f"{error.got} instead of {error.expected}"
    return " ".join(str(error).split())[:120] or type(error).__name__


def _saved_rig(values: dict[str, Any]) -> Rig:
    rig = Rig.from_dict(values)
    for name, view in rig.views.items():
        if not (np.isfinite(view.ball_from_camera).all() and 0 < view.angular_radius_rad < 1):
            raise ValueError(f"{name} has no angular radius")
        if not -view.ball_from_camera[2, 2] < 0:
            raise ValueError(f"{name} lies behind the camera")
    return rig


def _tag_rig(values: dict[str, Any]) -> TagRig:
    tag, spheres = values["tag"], values["spheres"]
    if tag.get("family", "36h11") != "36h11":
        raise ValueError(f"tag family {tag['family']!r}; only 36h11 is known")
    centres = {name: np.array(spheres[name]["centre_m"], float) for name in SPHERES}
    if any(c.shape != (3,) or not np.isfinite(c).all() for c in centres.values()):
        raise ValueError("centre_m is not three numbers")
    diameters = {name: float(spheres[name]["diameter_m"]) for name in SPHERES}
    return TagRig(int(tag["id"]), float(tag["size_m"]), centres, diameters)


def _tag_values(rig: TagRig) -> dict[str, Any]:
    spheres = {
        name: {"centre_m": rig.centres_m[name].tolist(), "diameter_m": rig.diameters_m[name]}
        for name in SPHERES
    }
    tag = {"family": "36h11", "id": rig.tag_id, "size_m": rig.tag_size_m}
    return {"tag": tag, "spheres": spheres}
