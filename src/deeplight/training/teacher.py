"""Learning from a trained network (Hinton et al. 2015): its ln radiance is one more target."""

from dataclasses import replace
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor

from deeplight.errors import ModelError
from deeplight.training.augment import Inputs, turn_back
from deeplight.training.config import TrainConfig
from deeplight.training.distil import lit_l1, resized
from deeplight.training.generator import PHOTO_SIZE, Generator
from deeplight.training.losses import LossTerms
from deeplight.training.model_file import load_network
from deeplight.training.slim import start_from


class Teacher:
    """A trained network that answers every batch beside the one that learns."""

    def __init__(self, network: Generator, weight: float) -> None:
        self.network, self.weight = network.requires_grad_(False).eval(), weight

    @classmethod
    def of(cls, config: TrainConfig) -> "Teacher":
        """The teacher that the settings name.

        Raises:
            ModelError: it cannot be read, or looks at photos of another shape.
        """
        network, contract = load_network(Path(config.distil.teacher))
        orientation = config.network.orientation
        if (contract.height, contract.width) != PHOTO_SIZE[orientation]:
            got = f"{config.distil.teacher} for photos of {contract.width} x {contract.height}"
            raise ModelError(f"a teacher for {orientation} photos", got, "take another one")
        return cls(network, config.distil.weight)

    def start(self, generator: Generator, config: TrainConfig, photos: Tensor) -> None:
        """Give a new network weights with which it answers almost like its teacher."""
        start_from(generator, config.network, self.network, photos)

    @torch.no_grad()
    def answer(self, inputs: Inputs, size: int) -> Float[Tensor, "n 3 size size"]:
        """Its ln radiance for the photos that the other network sees, turned back alike."""
        return resized(turn_back(self.network(inputs.photo), inputs.flipped), size)

    def join(
        self, terms: LossTerms, log_radiance: Float[Tensor, "n 3 size size"], inputs: Inputs
    ) -> LossTerms:
        """Add the distance from the teacher to what is lowered."""
        size = log_radiance.shape[-1]
        distance = lit_l1(log_radiance.float(), self.answer(inputs, size).float())
        weighted = {**terms.weighted, "distil": self.weight * distance}
        return replace(terms, weighted=weighted)
