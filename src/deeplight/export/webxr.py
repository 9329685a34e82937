"""Lighting as a WebXR page reads it from `XRLightEstimate`.

https://www.w3.org/TR/webxr-lighting-estimation-1/. The reference space is the photo's camera:
+X right, +Y up, -Z the view, the same axes as ours.
"""

from typing import Any

from deeplight.harmonics import CONDON_SHORTLEY, dominant_light, project
from deeplight.lighting import Lighting


def light_estimate(lighting: Lighting) -> dict[str, Any]:
    """Give the three members of an `XRLightEstimate`, ready for JSON.

    The coefficients are of radiance, red, green and blue interleaved, in the Condon-Shortley sign
    of ARCore and Chromium (1, 3, 5 and 7 negated). The main light is not in them: irradiance from
    the coefficients and from the main light add up to that of the whole environment. three.js and
    other users of the all-positive sign negate those four again.
    """
    light = dominant_light(lighting)
    coefficients = project(light.remainder) * CONDON_SHORTLEY[:, None]
    x, y, z = (float(value) for value in light.direction)
    red, green, blue = (float(value) for value in light.irradiance)
    return {
        "sphericalHarmonicsCoefficients": coefficients.ravel().tolist(),
        "primaryLightDirection": {"x": x, "y": y, "z": z, "w": 0.0},
        "primaryLightIntensity": {"x": red, "y": green, "z": blue, "w": 1.0},
    }
