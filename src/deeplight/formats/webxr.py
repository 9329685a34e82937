"""Lighting as a WebXR page reads it from `XRLightEstimate`.

https://www.w3.org/TR/webxr-lighting-estimation-1/. The reference space is the photo's camera:
+X right, +Y up, -Z the view, the same axes as ours.
"""

import base64
from typing import Any

import numpy as np

from deeplight.harmonics import CONDON_SHORTLEY, DominantLight, dominant_light, spherical_harmonics
from deeplight.io.orientation import CUBE_TOOLS, faces_for
from deeplight.lighting import Lighting
from deeplight.mappings import cube

CUBE_SIZE = 32
"""Pixels along a face of the reflection cube map: ARCore gives 16, and complaints with it."""


def light_estimate(lighting: Lighting, main_light: DominantLight | None = None) -> dict[str, Any]:
    """Give the three members of an `XRLightEstimate`, ready for JSON.

    The coefficients are of radiance, red, green and blue interleaved, in the Condon-Shortley sign
    of ARCore and Chromium (1, 3, 5 and 7 negated). The main light is not in them: irradiance from
    the coefficients and from the main light add up to that of the whole environment. three.js and
    other users of the all-positive sign negate those four again.

    Args:
        lighting: the whole light.
        main_light: its dominant light, if it is known better than from the ball.
    """
    light = main_light or dominant_light(lighting)
    coefficients = spherical_harmonics(light.remainder) * CONDON_SHORTLEY[:, None]
    x, y, z = (float(value) for value in light.direction)
    red, green, blue = (float(value) for value in light.irradiance)
    return {
        "sphericalHarmonicsCoefficients": coefficients.ravel().tolist(),
        "primaryLightDirection": {"x": x, "y": y, "z": z, "w": 0.0},
        "primaryLightIntensity": {"x": red, "y": green, "z": blue, "w": 1.0},
    }


def light_estimate_file(
    lighting: Lighting, main_light: DominantLight | None = None
) -> dict[str, Any]:
    """Give `light_estimate` with the reflection cube map and what the numbers mean, for a file."""
    faces = faces_for(lighting.cube(CUBE_SIZE).astype(np.float32), "webxr")
    return light_estimate(lighting, main_light) | {
        "reflectionCubeMap": {
            "size": CUBE_SIZE,
            "faces": [name.upper() for name in cube.FACES],
            "orientation": CUBE_TOOLS["webxr"],
            "encoding": "base64 of float32, little-endian, rows from the first, RGB; per face",
            "data": [base64.b64encode(face.astype("<f4").tobytes()).decode() for face in faces],
        },
        "about": {
            "coefficients": "of radiance, without the main light; order 00, 1-1, 10, 11, 2-2, 2-1, "
            "20, 21, 22, RGB interleaved",
            "sign": "Condon-Shortley (ARCore, Chromium): for all-positive users such as three.js "
            "negate coefficients 1, 3, 5 and 7",
            "identity": "irradiance(coefficients) + irradiance(main light) = irradiance(all)",
            "direction": "unit vector towards the main light",
            "intensity": "RGB irradiance on a surface that faces it, radiance unit times sr",
            "frame": "camera: +X right, +Y up, the camera looks along -Z",
            "reflectionCubeMap": "the whole light, main light included",
        },
    }
