"""Light as glTF 2.0: compact lights as KHR_lights_punctual, the rest as EXT_lights_image_based.

A scene of one node, which a tool merges with its own. Units: radiance relative to the camera's
white stands where glTF has nits, so irradiance stands where it has lux; turn both by one factor.
"""

import base64
import io
import json
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8
from PIL import Image

from deeplight.environment import Environment
from deeplight.frames import looking_at
from deeplight.harmonics import irradiance_coefficients, spherical_harmonics
from deeplight.io.orientation import GLTF_SIGN, gltf_faces
from deeplight.lamp import Lamp
from deeplight.lighting import Lighting
from deeplight.mappings import cube, latlong
from deeplight.mappings.layouts import cube_from_latlong, resized

FACE_SIZE = 128
MIPS = 4
"""128, 64, 32 and 16 pixels a face; roughness grows evenly from 0 to 1 over them."""
RGBD_MAX = 255.0
"""Brightest radiance that RGBD holds; it is in the specular faces only, and the sun is apart."""
RGBD_GAMMA = 2.2
_FILTER_ROWS = 48  # of the panorama that rough mips average over

Faces = Float[np.ndarray, "6 size size 3"]


def gltf(environment: Environment) -> dict[str, Any]:
    """Give the glTF document, its pictures inside as data URIs."""
    uris = [f"data:image/png;base64,{base64.b64encode(p).decode()}" for p in _pictures(environment)]
    return _document(environment) | {"images": [{"uri": uri} for uri in uris]}


def glb(environment: Environment) -> bytes:
    """Give the same as binary glTF, the pictures behind the document."""
    document, views, binary = _document(environment), [], b""
    for picture in _pictures(environment):
        views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(picture)})
        binary += picture + b"\0" * (-len(picture) % 4)
    document["images"] = [{"bufferView": i, "mimeType": "image/png"} for i in range(len(views))]
    document["bufferViews"], document["buffers"] = views, [{"byteLength": len(binary)}]
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _pictures(environment: Environment) -> list[bytes]:
    """PNG of each face of each mip."""
    mips = specular_mips(environment.ambient)
    return [_png(rgbd(face)) for faces in mips for face in gltf_faces(faces)]


def _document(environment: Environment) -> dict[str, Any]:
    """Everything but the pictures."""
    rest = Lighting.from_latlong(environment.ambient)
    harmonics = irradiance_coefficients(spherical_harmonics(rest))
    image_light = {
        "name": "everything but the lights",
        "intensity": 1.0,
        "rotation": [0.0, 0.0, 0.0, 1.0],
        "irradianceCoefficients": (harmonics * GLTF_SIGN[:, None]).tolist(),
        "extras": {
            "irradianceCoefficients": "as Babylon.js 9 reads them: 1, 4 and 5 negated",
            "irradianceCoefficientsAllPositive": harmonics.tolist(),
            "order": "00 1-1 10 11 2-2 2-1 20 21 22 in glTF's axes (Ramamoorthi and Hanrahan)",
        },
        "specularImageSize": FACE_SIZE,
        "specularImages": [[6 * mip + face for face in range(6)] for mip in range(MIPS)],
    }
    extensions: dict[str, Any] = {"EXT_lights_image_based": {"lights": [image_light]}}
    scene: dict[str, Any] = {"extensions": {"EXT_lights_image_based": {"light": 0}}}
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "deeplight convert"},
        "extensionsUsed": list(extensions),
        "extensions": extensions,
        "scenes": [scene],
        "scene": 0,
    }
    if environment.lamps:  # glTF allows no empty lists
        punctual, document["nodes"] = _punctual(environment.lamps)
        scene["nodes"] = list(range(len(punctual)))
        document["extensionsUsed"].insert(0, "KHR_lights_punctual")
        extensions["KHR_lights_punctual"] = {"lights": punctual}
    return document


def _punctual(lamps: Sequence[Lamp]) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Directional lights of KHR_lights_punctual, and a node for each."""
    names = ["main light", *(f"light {number}" for number in range(2, len(lamps) + 1))]
    lights = [
        {
            "name": name,
            "type": "directional",
            "color": [float(value) for value in lamp.colour],
            "intensity": float(lamp.irradiance.max()),
            "extras": {"angularRadius": lamp.angular_radius_rad},
        }
        for name, lamp in zip(names, lamps, strict=True)
    ]
    nodes = [
        {
            "name": name,
            "rotation": shining_from(lamp.direction),
            "extensions": {"KHR_lights_punctual": {"light": number}},
        }
        for number, (name, lamp) in enumerate(zip(names, lamps, strict=True))
    ]
    return lights, nodes


def specular_mips(radiance: Float[np.ndarray, "height width 3"]) -> list[Faces]:
    """Cube faces of the panorama, each level half as large and blurred by a rougher GGX lobe.

    Level i is for perceptual roughness i / (levels - 1), alpha its square, seen head on.
    """
    small = resized(radiance, _FILTER_ROWS)
    height, width, _ = small.shape
    directions = latlong.directions(height, width).reshape(-1, 3)
    weights = latlong.solid_angles(height, width).reshape(-1).astype(np.float32)
    levels = [cube_from_latlong(radiance, FACE_SIZE)]
    for mip in range(1, MIPS):
        size = FACE_SIZE >> mip
        normals = cube.directions(size).reshape(-1, 3).astype(np.float32)
        alpha = (mip / (MIPS - 1)) ** 2
        blurred = [
            _blurred(some, directions, weights, small.reshape(-1, 3), alpha)
            for some in np.array_split(normals, max(1, len(normals) // 512))
        ]
        levels.append(np.concatenate(blurred).reshape(6, size, size, 3))
    return levels


def rgbd(radiance: Float[np.ndarray, "size size 3"]) -> UInt8[np.ndarray, "size size 4"]:
    """Pack radiance up to 255: gamma-encoded colour, which decoded and divided by alpha gives it.

    The specification leaves the encoding open; this is what Babylon.js, its first user, reads.
    """
    largest = np.clip(radiance.max(axis=-1, keepdims=True), 1.0, RGBD_MAX)
    divisor = np.floor(RGBD_MAX / largest) / 255
    colour = np.clip(radiance * divisor, 0, 1) ** (1 / RGBD_GAMMA)
    packed = np.round(np.concatenate([colour, divisor], axis=-1) * 255)
    return packed.astype(np.uint8)


def _png(pixels: UInt8[np.ndarray, "size size 4"]) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "PNG")
    return buffer.getvalue()


def _blurred(
    normals: np.ndarray,
    directions: np.ndarray,
    weights: np.ndarray,
    radiance: np.ndarray,
    alpha: float,
) -> np.ndarray:
    """Mean radiance around each normal under GGX seen head on, weighted by the cosine."""
    n_l = normals @ directions.T
    n_h_squared = (1 + n_l) / 2
    lobe = np.maximum(n_l, 0) / (n_h_squared * (alpha**2 - 1) + 1) ** 2 * weights
    return (lobe @ radiance / lobe.sum(axis=1, keepdims=True)).astype(np.float32)


def shining_from(direction: Float[np.ndarray, "3"]) -> list[float]:
    """Quaternion x y z w of a node whose -Z, where a glTF light shines, is -`direction`."""
    away = -direction.astype(float)
    if abs(away[1]) > 1 - 1e-6:  # straight up or down, where nothing is level
        half = np.sqrt(0.5) * np.sign(away[1])
        return [float(half), 0.0, 0.0, float(np.sqrt(0.5))]
    return _quaternion(looking_at(away).T)


def _quaternion(matrix: Float[np.ndarray, "3 3"]) -> list[float]:
    """Unit quaternion x y z w of a rotation: the largest eigenvector of its own symmetric form."""
    m = matrix
    k = np.array(
        [
            [m[0, 0] - m[1, 1] - m[2, 2], 0, 0, 0],
            [m[1, 0] + m[0, 1], m[1, 1] - m[0, 0] - m[2, 2], 0, 0],
            [m[2, 0] + m[0, 2], m[2, 1] + m[1, 2], m[2, 2] - m[0, 0] - m[1, 1], 0],
            [m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1], np.trace(m)],
        ]
    )
    values, vectors = np.linalg.eigh(k)  # reads the lower triangle
    x, y, z, w = (float(value) for value in vectors[:, values.argmax()])
    return [x, y, z, w]
