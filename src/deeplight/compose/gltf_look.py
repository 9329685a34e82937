"""Materials of a glTF 2.0 file: metallic-roughness, with their textures' places."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from deeplight.compose.gltf_file import GltfFile

TRANSFORM = "KHR_texture_transform"
GLOSSY = "KHR_materials_pbrSpecularGlossiness"
REPEAT, MIXED = "repeat", "mixed"
_WRAPS = {10497: REPEAT, 33071: "clamp", 33648: "mirror"}


@dataclass(frozen=True)
class TexturePlace:
    """Where a texture lies on its coordinates: KHR_texture_transform, scaled, turned, moved."""

    offset: tuple[float, float] = (0.0, 0.0)
    rotation_rad: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)

    def apply(self, uv: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 2"]:
        """Transform coordinates whose origin is the texture's upper left."""
        cos, sin = np.cos(self.rotation_rad), np.sin(self.rotation_rad)
        result: np.ndarray = (uv * self.scale) @ np.array([[cos, -sin], [sin, cos]]) + self.offset
        return result


@dataclass(frozen=True, eq=False)
class MaterialLook:
    """A material.

    Attributes:
        colour: base colour, linear.
        colour_map, roughness_map: which of the file's images; the second holds roughness in
            green, metal in blue.
        uv_set, uv_place: which coordinates the pictures use, and how.
        wrap: what lies around a picture: "repeat", "clamp", "mirror", or a mix of these.
        lost: it names a picture of a kind that we cannot read.
        notes: what could not be applied.
    """

    colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
    colour_map: int | None = None
    roughness: float = 1.0
    metallic: float = 1.0
    roughness_map: int | None = None
    uv_set: int = 0
    uv_place: TexturePlace = TexturePlace()
    wrap: str = REPEAT
    lost: bool = False
    notes: tuple[str, ...] = ()
    given: bool = True


def look(file: GltfFile, index: Any) -> MaterialLook:
    """Read a material; None is the one of a primitive that names none.

    Raises:
        ImageFileError: it breaks the specification.
    """
    if index is None:
        return MaterialLook(given=False)
    material = file.item("materials", index)
    pbr = material.get("pbrMetallicRoughness", {})
    glossy = material.get("extensions", {}).get(GLOSSY)
    if glossy is not None and not pbr:
        pbr = _from_glossy(glossy)
    colour_info, rough_info = pbr.get("baseColorTexture"), pbr.get("metallicRoughnessTexture")
    result = MaterialLook(
        _colour(pbr.get("baseColorFactor", (1, 1, 1, 1))),
        roughness=float(pbr.get("roughnessFactor", 1)),
        metallic=float(pbr.get("metallicFactor", 1)),
        notes=_left_out(material),
    )
    result = _with_picture(file, result, "colour_map", colour_info)
    both = colour_info is not None and rough_info is not None
    if both and _placing(colour_info) != _placing(rough_info):
        left_out = "a roughness texture that lies elsewhere was left out"
        return replace(result, notes=(*result.notes, left_out))
    return _with_picture(file, result, "roughness_map", rough_info)


def _left_out(material: Mapping[str, Any]) -> tuple[str, ...]:
    """Say what a material has that is not drawn."""
    glass = material.get("extensions", {}).get("KHR_materials_transmission", {})
    pbr = material.get("pbrMetallicRoughness", {})
    thin = material.get("alphaMode", "OPAQUE") != "OPAQUE" and (
        "baseColorTexture" in pbr or float(pbr.get("baseColorFactor", (1, 1, 1, 1))[3]) < 1
    )
    notes = []
    if thin or float(glass.get("transmissionFactor", 0)) > 0:
        notes.append("transparent parts are drawn solid")
    if any(float(value) > 0 for value in material.get("emissiveFactor", ())):
        notes.append("light of its own was left out")
    return tuple(notes)


def _from_glossy(glossy: Mapping[str, Any]) -> dict[str, Any]:
    """Give the nearest metallic-roughness material of the older extension: a dielectric."""
    result = {
        "baseColorFactor": glossy.get("diffuseFactor", (1, 1, 1, 1)),
        "metallicFactor": 0,
        "roughnessFactor": 1 - float(glossy.get("glossinessFactor", 1)),
    }
    if "diffuseTexture" in glossy:
        result["baseColorTexture"] = glossy["diffuseTexture"]
    return result


def _colour(factor: Any) -> tuple[float, float, float]:
    red, green, blue = (float(np.clip(float(value), 0, 1)) for value in factor[:3])
    return red, green, blue


def _placing(info: Mapping[str, Any]) -> tuple[int, TexturePlace]:
    """Give a texture's set of coordinates and its place on them."""
    moved = info.get("extensions", {}).get(TRANSFORM, {})
    across, down = (float(value) for value in moved.get("offset", (0, 0)))
    wide, high = (float(value) for value in moved.get("scale", (1, 1)))
    place = TexturePlace((across, down), float(moved.get("rotation", 0)), (wide, high))
    return int(moved.get("texCoord", info.get("texCoord", 0))), place


def _with_picture(
    file: GltfFile, of: MaterialLook, name: str, info: Mapping[str, Any] | None
) -> MaterialLook:
    """Add a picture, and where it lies, to a material."""
    if info is None:
        return of
    texture = file.item("textures", info["index"])
    other = texture.get("extensions", {}).get("EXT_texture_webp", {})
    source = other.get("source", texture.get("source"))
    if source is None:  # Basis Universal alone
        return replace(of, lost=True)
    uv_set, place = _placing(info)
    changes: dict[str, Any] = {name: int(source), "uv_set": uv_set, "uv_place": place}
    return replace(of, **changes, wrap=_wrap(file, texture))


def _wrap(file: GltfFile, texture: Mapping[str, Any]) -> str:
    """Say what lies to the sides of a texture's picture."""
    sampler = file.item("samplers", texture["sampler"]) if "sampler" in texture else {}
    sides = {_WRAPS.get(sampler.get(name, 10497), REPEAT) for name in ("wrapS", "wrapT")}
    return MIXED if len(sides) > 1 else sides.pop()
