"""Make the golden pictures of the nouns: python tests/golden/make_nouns.py."""

from pathlib import Path

import numpy as np
from PIL import Image

from deeplight.camera_response import CameraResponse
from deeplight.frames import rotation
from deeplight.lighting import Lighting
from deeplight.mappings import latlong
from deeplight.relight import relight_rig
from deeplight.sphere import PAPER_RIG, SPHERES, Rig

LIGHTS = (  # towards, half angle in degrees, radiance
    ((-0.8, 0.4, -0.5), 25, (1.0, 0.55, 0.2)),
    ((0.7, -0.2, -0.3), 15, (0.1, 0.4, 1.0)),
    ((0.4, 0.8, 0.6), 6, (60.0, 60.0, 60.0)),
)


def light(yaw_deg: float = 0.0) -> Lighting:
    """A place without symmetry: sky, floor, an orange and a blue light, a white lamp."""
    directions = latlong.directions(512, 1024).astype(float)
    panorama = 0.2 + 0.15 * directions[..., 1:2] * [0.6, 0.8, 1.0]
    for towards, half_angle_deg, radiance in LIGHTS:
        cosine = directions @ (np.array(towards) / np.linalg.norm(towards))
        panorama += (cosine > np.cos(np.radians(half_angle_deg)))[..., None] * radiance
    return Lighting.from_latlong(panorama.astype(np.float32), rotation("y", np.radians(yaw_deg)))


def as_8_bit(radiance: np.ndarray) -> np.ndarray:
    """As the camera would store it."""
    pixels = CameraResponse().pixel_from_radiance(radiance)
    return np.round(255 * pixels).astype(np.uint8)


def spheres(lighting: Lighting, rig: Rig) -> np.ndarray:
    """The three crops side by side: mirror, matte silver, diffuse."""
    rendered = relight_rig(rig, lighting)
    return np.concatenate([as_8_bit(rendered[name]) for name in SPHERES], axis=1)


def mappings(lighting: Lighting) -> np.ndarray:
    """The ball, the latlong and the six cube faces side by side, each 32 high."""
    faces = np.concatenate(list(lighting.cube(32)), axis=1)
    parts = (lighting.radiance, lighting.latlong(32), faces)
    return np.concatenate([as_8_bit(part) for part in parts], axis=1)


if __name__ == "__main__":
    folder = Path(__file__).parent
    Image.fromarray(spheres(light(), PAPER_RIG)).save(folder / "spheres.png")
    Image.fromarray(mappings(light())).save(folder / "mappings.png")
