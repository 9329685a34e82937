"""A panorama as another place: seen from elsewhere in it, its lights and sides brighter or dimmer.

Few places are what a network lacks most. What is made here is no real place, but photo, spheres
and light of a take all come from the same made panorama, so they agree as in a real one.
"""

import numpy as np
from jaxtyping import Float, Float32

from deeplight.camera_response import LUMINANCE
from deeplight.mappings import latlong, resample

Panorama = Float[np.ndarray, "height width 3"]

LEVEL_STEP, UPRIGHT_STEP = 0.3, 0.12
"""Standard deviation of the camera's step, in distances to the walls."""
LONGEST_STEP = 0.6
LIGHT_SPREAD = 0.7  # standard deviation of ln of the gain of lights
TINT_SPREAD = 0.08  # of the colour of that gain
SIDE_SPREAD = 0.35  # of ln radiance across the panorama, 1 radian apart
LIGHTS_FROM, LIGHTS_FULL = 4.0, 16.0
"""A texel this many times as bright as the median is partly, wholly, a light."""


def varied(panorama: Panorama, rng: np.random.Generator) -> Float32[np.ndarray, "height width 3"]:
    """Another place made from `panorama`; `rng` decides which."""
    step = rng.normal(0, (LEVEL_STEP, UPRIGHT_STEP, LEVEL_STEP))
    step *= min(1.0, LONGEST_STEP / float(np.linalg.norm(step)))
    gain = np.exp(rng.normal(0, LIGHT_SPREAD) + rng.normal(0, TINT_SPREAD, 3))
    side = rng.normal(0, SIDE_SPREAD, 3)
    return one_sided(stepped(relit(panorama, gain), step), side)


def stepped(
    panorama: Panorama, step: Float[np.ndarray, "3"]
) -> Float32[np.ndarray, "height width 3"]:
    """The view from `step` away from the centre of a sphere of radius 1 that wears the panorama.

    The warp of Gardner et al. 2017 for light found far away; a matte room keeps its radiance.
    """
    directions = latlong.directions(*panorama.shape[:2]).astype(np.float32)
    along = directions @ step.astype(np.float32)
    reach = np.sqrt(along**2 + 1 - float(step @ step)) - along
    seen = step.astype(np.float32) + reach[..., None] * directions
    return resample.sample_latlong(panorama.astype(np.float32), seen)


def relit(
    panorama: Panorama, gain: Float[np.ndarray, "3"]
) -> Float32[np.ndarray, "height width 3"]:
    """The panorama with its lights `gain` times as bright; what they light stays as it was."""
    luminance = np.maximum(panorama @ LUMINANCE, 1e-12)
    weight = latlong.solid_angles(*panorama.shape[:2])
    order = np.argsort(luminance, axis=None)
    half = np.searchsorted(np.cumsum(weight.ravel()[order]), weight.sum() / 2)
    stops = np.log(luminance / luminance.ravel()[order][half])
    light = (stops - np.log(LIGHTS_FROM)) / np.log(LIGHTS_FULL / LIGHTS_FROM)
    share = np.clip(light, 0, 1)[..., None]
    return (panorama * gain**share).astype(np.float32)


def one_sided(
    panorama: Panorama, side: Float[np.ndarray, "3"]
) -> Float32[np.ndarray, "height width 3"]:
    """The panorama brighter towards `side`: times e^|side| there, e^-|side| opposite."""
    directions = latlong.directions(*panorama.shape[:2])
    return (panorama * np.exp(directions @ side)[..., None]).astype(np.float32)
