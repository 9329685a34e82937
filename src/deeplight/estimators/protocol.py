"""What estimates light."""

from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32

from deeplight.io.photo_like import PhotoLike
from deeplight.lighting import Lighting


@runtime_checkable
class InputsEstimator(Protocol):
    """What an estimator of one's own must have: a name, and light for prepared pictures."""

    @property
    def name(self) -> str:
        """What tables call it."""

    def estimate_inputs(
        self, inputs: Float32[np.ndarray, "batch 3 height width"]
    ) -> Float32[np.ndarray, "batch size size 3"]:
        """Give ln radiance for pictures already brought to the trained view and to [-0.5, 0.5]."""


class Estimator(InputsEstimator, Protocol):
    """Anything that gives the light of a photo: the network, and each baseline."""

    def estimate(self, photo: PhotoLike) -> Lighting:
        """Estimate the light of one photo of any size, in the photo's camera frame."""
