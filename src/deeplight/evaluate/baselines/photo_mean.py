"""Baseline: the same light from everywhere, in the photo's mean colour."""

import numpy as np
from jaxtyping import Float32

from deeplight.camera_response import decode
from deeplight.evaluate.baselines.baseline import DARKEST, Baseline
from deeplight.lighting import LIGHTING_SIZE


class PhotoMean(Baseline):
    """Uniform lighting whose radiance is the mean linear colour of the photo.

    It knows exposure and colour cast, and nothing about where the light comes from.
    """

    @property
    def name(self) -> str:
        return "photo_mean"

    def estimate_inputs(
        self, inputs: Float32[np.ndarray, "batch 3 height width"]
    ) -> Float32[np.ndarray, "batch size size 3"]:
        pixels = np.clip(inputs + np.float32(0.5), 0, 1)
        colour = np.log(np.maximum(decode(pixels).mean((2, 3)), DARKEST))
        size = (len(inputs), LIGHTING_SIZE, LIGHTING_SIZE, 3)
        return np.broadcast_to(colour[:, None, None, :], size).astype(np.float32)
