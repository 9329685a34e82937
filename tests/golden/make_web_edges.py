"""Make what the page's tilt by upright edges is checked with.

python tests/golden/make_web_edges.py

Pictures of posts with the tilts that Python sees in them go to web/tests/golden/edges.json.
"""

import json
from math import radians
from typing import Any

import numpy as np
from make_web import GOLDEN, as_text

from deeplight.camera import PinholeCamera
from deeplight.estimators.projection import ImagePlane
from deeplight.estimators.tilt import seen_tilt
from deeplight.frames import turned, world_from_camera

FILE = GOLDEN / "edges.json"
CAMERA = PinholeCamera(72, 96, radians(66))
PLANE = ImagePlane.centred(CAMERA.height, CAMERA.width, CAMERA.vertical_fov_rad)
CASES = {
    "upright": (1.0, -20, 0),
    "rolled": (1.0, 8, 13),
    "without edges": (0.0, 0, 0),
}
"""How far the posts stand out, and degrees of pitch and roll."""
GUESS_DEG, SCALE_DEG = -10, 15


def golden() -> dict[str, Any]:
    """The pictures, and what is seen in them."""
    return {
        "height": CAMERA.height,
        "width": CAMERA.width,
        "vertical_fov_rad": CAMERA.vertical_fov_rad,
        "cases": {name: case(*numbers) for name, numbers in CASES.items()},
    }


def case(contrast: float, pitch_deg: float, roll_deg: float) -> dict[str, Any]:
    """A picture with its tilt by a doubtful network's guess, by a sure one's, and by none."""
    pixels = posts(contrast, pitch_deg, roll_deg)
    guesses = {"doubtful": heads(SCALE_DEG), "sure": heads(5), "none": {}}
    tilts = {name: seen_tilt(pixels, PLANE, guess) for name, guess in guesses.items()}
    return {
        "rgb": as_text(pixels),
        "heads": guesses,
        "tilts": {
            name: tilt and {"up": tilt.up.tolist(), "scaleRad": tilt.scale_rad}
            for name, tilt in tilts.items()
        },
    }


def heads(scale_deg: float) -> dict[str, float]:
    """What a network says that takes the photo to be upright."""
    upright = {f"upright_{angle}": float(angle == 0) for angle in (0, 90, 180, 270)}
    return upright | {"pitch_rad": radians(GUESS_DEG), "pitch_scale": radians(scale_deg)}


def posts(contrast: float, pitch_deg: float, roll_deg: float) -> np.ndarray:
    """A noisy photo of coloured upright posts all around a camera."""
    world_from = world_from_camera(0.0, radians(pitch_deg), radians(roll_deg))
    rays = turned(CAMERA.rays(), world_from)
    level = np.tanh(4 * np.sin(20 * np.arctan2(rays[..., 0], -rays[..., 2])))
    noise = np.random.default_rng(0).normal(0, 6, (*level.shape, 3))
    photo = 130 + contrast * level[..., None] * [60, 30, -20] + noise
    return photo.clip(0, 255).astype(np.uint8)


if __name__ == "__main__":
    FILE.write_text(json.dumps(golden(), indent=1) + "\n", encoding="utf-8")
