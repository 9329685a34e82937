"""How an object's surface reflects, as Mitsuba describes it."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

import numpy as np

from deeplight import brdf
from deeplight.compose.mesh import Finish, Mesh

# Share of white light that the paper's bunnies reflect (section 4.2); the mirror is its sphere's.
REFLECTIVITY: Mapping[str, float] = MappingProxyType(
    {"diffuse": 0.345, "silver": 0.499, "mirror": brdf.REFLECTIVITY["mirror"]}
)
SILVER_KEPT = 0.85
"""What a ball of roughness 0.3 that absorbs nothing gives back of white light in Mitsuba, which
leaves out light scattered more than once. The test of the furnace measures it."""
PLASTIC_COLOUR = (0.55, 0.55, 0.55)
MIRROR_ROUGHNESS = 0.15
MATERIALS = ("diffuse", "silver", "mirror", "plastic", "file")


def bsdf(mi: Any, material: str, mesh: Mesh) -> dict[str, Any]:
    """Give Mitsuba's description of a material of `MATERIALS`; both sides of a triangle have it."""
    inner = _file(mi, mesh) if material == "file" else _named(material)
    return {"type": "twosided", "inner": inner}


def is_mirror(material: str, mesh: Mesh) -> bool:
    """Whether a surface reflects a picture of what is around it."""
    if material == "file":
        return mesh.finish.roughness < MIRROR_ROUGHNESS and mesh.finish.metallic > 0.5
    return material == "mirror"


def _named(material: str) -> dict[str, Any]:
    if material == "plastic":
        return {"type": "roughplastic", "alpha": 0.08, "diffuse_reflectance": _rgb(PLASTIC_COLOUR)}
    reflectivity = REFLECTIVITY[material]
    if material == "diffuse":
        return {"type": "diffuse", "reflectance": _rgb([reflectivity] * 3)}
    if material == "mirror":
        grey = _rgb([reflectivity] * 3)
        return {"type": "conductor", "material": "none", "specular_reflectance": grey}
    return {
        "type": "roughconductor",
        "material": "none",
        "distribution": "ggx",
        "alpha": brdf.MATTE_SILVER_ROUGHNESS,
        "specular_reflectance": _rgb([reflectivity / SILVER_KEPT] * 3),
    }


def _file(mi: Any, mesh: Mesh) -> dict[str, Any]:
    """glTF's metallic-roughness model, as the principled material that it was taken from."""
    finish: Finish = mesh.finish
    if mesh.colours is not None:
        colour: dict[str, Any] = {"type": "mesh_attribute", "name": "vertex_color"}
    elif finish.colour_map is not None and mesh.uv is not None:
        colour = _bitmap(mi, finish, finish.colour_map)
    else:
        colour = _rgb(finish.colour)
    maps = {"roughness": finish.roughness_map, "metallic": finish.metallic_map}
    numbers: dict[str, Any] = {
        "roughness": max(finish.roughness, 0.03),
        "metallic": finish.metallic,
    }
    for name, values in maps.items():
        if values is not None and mesh.uv is not None:
            numbers[name] = {**_bitmap(mi, finish, values[..., None]), "raw": True}
    return {"type": "principled", "base_color": colour, "specular": 0.5, **numbers}


def _bitmap(mi: Any, finish: Finish, pixels: np.ndarray) -> dict[str, Any]:
    return {"type": "bitmap", "bitmap": mi.Bitmap(pixels), "wrap_mode": finish.wrap}


def _rgb(values: Any) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(v) for v in values]}
