"""The relighting loss on some pixels of each sphere: what small heads learn from in minutes."""

from collections.abc import Mapping, Sequence

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from deeplight.reflectance import ReflectanceBasis
from deeplight.training.losses import RigBases, encode, soft_clip, target_pixels

COUNTS = (183, 60, 40)  # of mirror, matte silver, diffuse, drawn anew for each step


class SomePixels:
    """The pixels of one rig that show nothing but sphere, and the light that each gathers."""

    def __init__(self, bases: Mapping[str, ReflectanceBasis]) -> None:
        shown = RigBases.of([bases])
        self.inside = [mask.nonzero()[:, 0] for mask in shown.mask[0]]
        self.basis = [
            basis[inside] for basis, inside in zip(shown.basis[0], self.inside, strict=True)
        ]

    def loss(
        self, log_radiance: Float[Tensor, "n 3 light light"],
        spheres: UInt8[np.ndarray, "n sphere size size 3"], weights: Sequence[float],
        random: np.random.Generator,
    ) -> Float[Tensor, ""]:  # fmt: skip
        """Equation 4 with a weight of each sphere; one with weight 0 is not looked at."""
        light, total = log_radiance.exp().flatten(2), log_radiance.new_zeros(())
        for number, weight in enumerate(weights):
            if weight == 0:
                continue
            inside = self.inside[number]
            some = torch.from_numpy(random.choice(len(inside), COUNTS[number], replace=False))
            rendered = encode(soft_clip(light @ self.basis[number][some].T))
            flat = spheres[:, number].reshape(len(spheres), -1, 3)[:, inside[some].numpy()]
            filmed = torch.from_numpy(flat).permute(0, 2, 1) / 255.0
            total = total + weight * (rendered - target_pixels(filmed, "consistent")).abs().mean()
        return total
