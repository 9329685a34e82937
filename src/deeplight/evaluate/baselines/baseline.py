"""What every baseline is: an `Estimator` that needs only the network's input."""

from abc import ABC, abstractmethod

import numpy as np
from jaxtyping import Float32

from deeplight.io.photo_like import PhotoLike, as_photo
from deeplight.lighting import Lighting
from deeplight.preprocess import frame_photo, network_input

DARKEST = 1e-4  # radiance: black still has a logarithm


class Baseline(ABC):
    """An estimator of batches of network inputs; a photo is brought to one first."""

    @property
    @abstractmethod
    def name(self) -> str:
        """What tables call it."""

    @abstractmethod
    def estimate_inputs(
        self, inputs: Float32[np.ndarray, "batch 3 height width"]
    ) -> Float32[np.ndarray, "batch size size 3"]:
        """Give ln radiance on the mirror ball for pictures in [-0.5, 0.5]."""

    def estimate(self, photo: PhotoLike) -> Lighting:
        """Estimate the light of one photo of any size, in the photo's camera frame."""
        opened = as_photo(photo)
        height, width, _ = opened.pixels.shape
        framing = frame_photo(height, width, opened.vertical_fov_rad, "exif")
        inputs = network_input(opened.pixels, framing)[None]
        return Lighting.from_log_radiance(self.estimate_inputs(inputs)[0])


class ConstantLighting(Baseline):
    """The same lighting for every photo."""

    def __init__(self, name: str, log_radiance: Float32[np.ndarray, "size size 3"]) -> None:
        self._name = name
        self.log_radiance = log_radiance.astype(np.float32)
        self.log_radiance.setflags(write=False)

    @property
    def name(self) -> str:
        return self._name

    def estimate_inputs(
        self, inputs: Float32[np.ndarray, "batch 3 height width"]
    ) -> Float32[np.ndarray, "batch size size 3"]:
        return np.broadcast_to(self.log_radiance, (len(inputs), *self.log_radiance.shape))
