"""Make what the page's reader and shaders of transfer are checked with.

python tests/golden/make_web_transfer.py

A small object, a light, and what the light does to it go to web/tests/golden/transfer.json.
"""

import base64
import json
from typing import Any

import numpy as np
from make_web import GOLDEN, packed

from deeplight import harmonics
from deeplight.camera_response import CameraResponse, encode
from deeplight.compose import shapes
from deeplight.compose.mesh import Finish, Mesh
from deeplight.frames import normalised
from deeplight.lighting import Lighting
from deeplight.mappings.mirror_ball import pixel_directions
from deeplight.transfer import file as transfer_file
from deeplight.transfer.ground import Ground
from deeplight.transfer.precompute import TransferSettings, precompute
from deeplight.transfer.view import Eye, RenderedView, view

FILE = GOLDEN / "transfer.json"
EYE = Eye((0.7, 0.8, 1.9), (0, 0.4, 0), 0.7, 48, 48)
BACKDROP = 0.5  # radiance of the ground in the picture


def made() -> bytes:
    """A bunny of few triangles, every part of the format in it."""
    vertices, faces, normals = shapes.bunny(16)
    colours = 0.2 + 0.6 * (normals + 1) / 2
    mesh = Mesh(vertices, faces, normals, None, colours, Finish())
    settings = TransferSettings(
        samples=256,
        diffuse=None,
        ground=Ground(size=16),
        longest_edge=1.0,
        clusters=4,
        components=5,
    )
    return transfer_file.encode(precompute([mesh], settings)[0])


def light() -> np.ndarray:
    """A sun of some size in a blue sky over a brown ground, as harmonics."""
    directions = pixel_directions(32).astype(float)
    sun = normalised(np.array([0.5, 0.7, 0.6]))
    sky = np.where(directions[..., 1:2] > 0, [0.3, 0.4, 0.6], [0.2, 0.15, 0.1])
    radiance = sky + np.array([9, 8, 6]) * np.exp(12 * (directions @ sun - 1))[..., None]
    return harmonics.spherical_harmonics(Lighting(radiance.astype(np.float32)), 4)


def golden(content: bytes) -> dict[str, Any]:
    """What `content` gives in the light; nothing in it is traced again."""
    transfer, lit = transfer_file.decode(content), light()
    assert transfer.glossy is not None
    met = np.einsum("cpji,ik->cpjk", transfer.glossy.clusters.matrices, lit)
    ones = {name: view(transfer, lit, name, EYE) for name in ("diffuse", "glossy")}
    seen = ones["diffuse"]
    return {
        "file": base64.b64encode(content).decode(),
        "light": packed(lit),
        "positions": packed(transfer.vertices),
        "normals": packed(transfer.normals),
        "diffuse": packed(np.maximum(transfer.diffuse @ lit, 0)),
        "met": packed(met),
        "shadow": packed(transfer.shadow(lit)),
        "eye": {"place": EYE.place, "target": EYE.target, "fov_rad": EYE.fov_rad},
        "size": EYE.height,
        "cover": packed(seen.cover),
        "pictures": {name: packed(pixels(one.radiance)) for name, one in ones.items()},
        "ground": packed(ground_pixels(seen)),
        "backdrop": float(encode(np.array([BACKDROP]))[0]),
    }


def pixels(radiance: np.ndarray) -> np.ndarray:
    """As a screen shows it, 0 to 255."""
    return CameraResponse().pixel_from_radiance(radiance) * 255


def ground_pixels(seen: RenderedView) -> np.ndarray:
    """An even ground under the shadow; -1 where the page fades it out, and on the object."""
    directions = EYE.directions.reshape(*seen.cover.shape, 3)
    at = np.array(EYE.place) - directions * (EYE.place[1] / directions[..., 1:2])
    near = (directions[..., 1] < 0) & (np.abs(at[..., [0, 2]]).max(-1) < 0.75) & ~seen.cover
    shown = encode(BACKDROP * np.minimum(seen.shadow, 1)) * 255
    return np.where(near[..., None], shown, -1)


if __name__ == "__main__":
    FILE.write_text(json.dumps(golden(made())) + "\n")
