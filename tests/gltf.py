"""glTF files in the making, and what every way to write the same board must give."""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from deeplight.compose.mesh import Mesh, load

BOARD = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], np.float32)
UV = np.array([[0, 1], [1, 1], [1, 0], [0, 0]], np.float32)  # glTF's: from the upper left
FACES = np.array([0, 1, 2, 0, 2, 3], np.uint16)
TYPES = {
    "int8": 5120,
    "uint8": 5121,
    "int16": 5122,
    "uint16": 5123,
    "uint32": 5125,
    "float32": 5126,
}


class Gltf:
    """A file in the making: arrays go into one buffer, the rest is JSON."""

    def __init__(self) -> None:
        self.bytes = b""
        self.json: dict[str, Any] = {
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}], "accessors": [], "bufferViews": [],
        }  # fmt: skip

    def view(self, content: bytes, **more: Any) -> int:
        self.bytes += bytes(-len(self.bytes) % 4)
        place = {"buffer": 0, "byteOffset": len(self.bytes), "byteLength": len(content)}
        self.json["bufferViews"].append({**place, **more})
        self.bytes += content
        return len(self.json["bufferViews"]) - 1

    def array(self, values: np.ndarray, **more: Any) -> int:
        kinds = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
        width = 1 if values.ndim == 1 else values[0].size
        entry = {"componentType": TYPES[str(values.dtype)], "count": len(values)}
        view = {} if "sparse" in more else {"bufferView": self.view(values.tobytes())}
        self.json["accessors"].append({**entry, "type": kinds[width], **view, **more})
        return len(self.json["accessors"]) - 1

    def board(self, positions: np.ndarray = BOARD, **attributes: int) -> dict[str, Any]:
        given = {"POSITION": attributes.pop("POSITION", None)}
        if given["POSITION"] is None:
            given["POSITION"] = self.array(positions)
        primitive = {"attributes": {**given, **attributes}, "indices": self.array(FACES)}
        self.json["meshes"] = [{"primitives": [primitive]}]
        return primitive

    def textured(self, **info: Any) -> None:
        import io

        stream = io.BytesIO()
        Image.new("RGB", (4, 4), (200, 100, 50)).save(stream, "PNG")
        self.json["images"] = [
            {"mimeType": "image/png", "bufferView": self.view(stream.getvalue())}
        ]
        self.json["textures"] = [{"source": 0}]
        pbr = {"baseColorTexture": {"index": 0, **info}, "metallicFactor": 0}
        self.json["materials"] = [{"pbrMetallicRoughness": pbr}]
        self.json["meshes"][0]["primitives"][0]["material"] = 0

    def save(self, path: Path) -> str:
        content = self.bytes + bytes(-len(self.bytes) % 4)
        self.json["buffers"] = [{"byteLength": len(content)}]
        text = json.dumps(self.json).encode()
        text += b" " * (-len(text) % 4)
        size = 12 + 8 + len(text) + 8 + len(content)
        path.write_bytes(
            b"glTF" + struct.pack("<II", 2, size) + struct.pack("<I", len(text)) + b"JSON" + text
            + struct.pack("<I", len(content)) + b"BIN\0" + content
        )  # fmt: skip
        return str(path)


def corners(mesh: Mesh) -> np.ndarray:
    """The triangles' corners, whatever the order of their vertices."""
    points = mesh.vertices[mesh.faces].reshape(-1, 9)
    result: np.ndarray = points[np.lexsort(points.T)]
    return result


PLAIN = BOARD[FACES.reshape(-1, 3)].reshape(-1, 9)
PLAIN = PLAIN[np.lexsort(PLAIN.T)]


def same(name: str) -> bool:
    return np.allclose(corners(load(name)[0]), PLAIN, atol=1e-4)
