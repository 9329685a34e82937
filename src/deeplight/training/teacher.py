"""Learning from a trained network (Hinton et al. 2015): its ln radiance is one more target."""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import torch
from jaxtyping import Float
from torch import Tensor, nn

from deeplight.errors import ModelError
from deeplight.training.augment import Inputs, turn_back
from deeplight.training.config import TrainConfig
from deeplight.training.distil import lit_l1, resized
from deeplight.training.losses import LossTerms
from deeplight.training.model_file import load_network
from deeplight.training.network.generator import PHOTO_SIZE, Generator
from deeplight.training.slim import start_from


class Teacher:
    """Trained networks that answer every batch, as one, for the one that learns."""

    def __init__(self, networks: Sequence[Generator], weight: float) -> None:
        self.networks, self.weight = nn.ModuleList(networks).requires_grad_(False).eval(), weight

    @classmethod
    def of(cls, config: TrainConfig) -> "Teacher":
        """The teachers that the settings name.

        Raises:
            ModelError: one cannot be read, or looks at photos of another shape.
        """
        orientation = config.network.orientation
        networks = []
        for name in config.distil.teacher.split(","):
            network, contract = load_network(Path(name.strip()))
            if (contract.height, contract.width) != PHOTO_SIZE[orientation]:
                got = f"{name} for photos of {contract.width} x {contract.height}"
                raise ModelError(f"a teacher for {orientation} photos", got, "take another one")
            networks.append(network)
        return cls(networks, config.distil.weight)

    def start(self, generator: Generator, config: TrainConfig, photos: Tensor) -> None:
        """Give a new network weights with which it answers almost like its first teacher."""
        first = self.networks[0]
        assert isinstance(first, Generator)
        start_from(generator, config.network, first, photos)

    @torch.no_grad()
    def answer(self, inputs: Inputs, size: int) -> Float[Tensor, "n 3 size size"]:
        """ln of their mean radiance for the photos that the other sees, turned back alike."""
        light = [resized(network(inputs.photo), size) for network in self.networks]
        together = torch.stack(light).logsumexp(0) - math.log(len(light))
        return turn_back(together, inputs.flipped)

    def join(
        self, terms: LossTerms, log_radiance: Float[Tensor, "n 3 size size"], inputs: Inputs
    ) -> LossTerms:
        """Add the distance from the teacher to what is lowered."""
        size = log_radiance.shape[-1]
        distance = lit_l1(log_radiance.float(), self.answer(inputs, size).float())
        weighted = {**terms.weighted, "distil": self.weight * distance}
        return replace(terms, weighted=weighted)
