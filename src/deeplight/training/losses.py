"""The relighting loss: render the spheres under the predicted light, compare pixels [section 3.4].

Everything here runs in float32 whatever the network's precision: exp, the basis product and the
soft clip lose the sun in half precision.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor, nn
from torch.nn import functional

from deeplight.camera_response import GAMMA, SOFT_CLIP_N
from deeplight.reflectance import ReflectanceBasis, rig_bases
from deeplight.sphere import LOSS_WEIGHTS, SPHERES, Rig

# x^(1/2.2) has an infinite slope at 0; linear 1e-4 is pixel value 4 of 255.
DARKEST = 1e-4

Form = Literal["consistent", "paper", "plain"]
Reduction = Literal["mean", "sum"]


@dataclass(frozen=True)
class LossConfig:
    """Weights and form of the reconstruction loss; defaults are the paper's numbers."""

    mirror: float = LOSS_WEIGHTS["mirror"]
    matte_silver: float = LOSS_WEIGHTS["matte_silver"]
    diffuse: float = LOSS_WEIGHTS["diffuse"]
    form: Form = "consistent"
    """What a sphere's pixel I is compared as. consistent: soft-clipped in linear radiance, like the
    rendering; paper: equation 4 to the letter, soft-clipped as a pixel value; plain: as it is."""
    reduction: Reduction = "mean"
    """Over masked pixels and channels of one sphere; over examples it is always the mean."""
    flip: float = 0.0
    """Weight of the difference between the light of a photo and of its mirror image, mirrored back:
    mean |ln radiance| and 1 - cos of the angle between the main lights. Above 0 every photo is seen
    both ways and learnt from twice."""
    steady: float = 0.0
    """Weight of 1 - cos of the angle between the main lights of two frames that follow each other
    in a take, as the room has them. Above 0 a batch is made of such pairs."""
    bases: str = ""
    """Photographed bases, an .npz of `deeplight reflectance`, for matte silver and diffuse; the
    mirror's is made, as in the paper. Empty: those that travel with the data set (bases.npz), and
    without any all are made from reflection models."""

    def weights(self) -> tuple[float, ...]:
        """One weight per sphere in the order of SPHERES."""
        return tuple(float(getattr(self, name)) for name in SPHERES)


class RigBases(nn.Module):
    """Reflectance bases and loss masks of every rig of a data set, as float32 buffers.

    `basis` (rig, sphere, pixel, light) and `mask` (rig, sphere, pixel); pixels and lights are in
    row-major order; spheres in the order of SPHERES.
    """

    basis: Tensor
    mask: Tensor

    def __init__(self, basis: Float[Tensor, "rig sphere pixel light"], mask: Tensor) -> None:
        super().__init__()
        self.register_buffer("basis", basis.float(), persistent=False)
        self.register_buffer("mask", mask.float(), persistent=False)

    @classmethod
    def of(cls, rigs: Sequence[Mapping[str, ReflectanceBasis]]) -> "RigBases":
        """The bases of every rig, by sphere; a rig's index here is its place in the sequence."""
        basis = [np.stack([bases[name].weights for name in SPHERES]) for bases in rigs]
        mask = [
            np.stack([bases[name].view.mask().reshape(-1) for name in SPHERES]) for bases in rigs
        ]
        return cls(torch.from_numpy(np.stack(basis)), torch.from_numpy(np.stack(mask)))

    @classmethod
    def from_rigs(cls, rigs: Sequence[Rig], light_size: int = 32) -> "RigBases":
        """Analytic bases of `rigs`."""
        return cls.of([rig_bases(rig, light_size) for rig in rigs])

    def render(
        self,
        log_radiance: Float[Tensor, "n 3 size size"],
        rig: Int[Tensor, "n"],
        spheres: slice = slice(None),
    ) -> Float[Tensor, "n sphere 3 pixel"]:
        """Equation 2: linear radiance of every sphere, or of `spheres`, of each example's own rig.

        `rig` stays on the CPU: grouping by rig must not wait for the accelerator.
        """
        with torch.autocast(log_radiance.device.type, enabled=False):
            radiance = log_radiance.float().exp().flatten(2)  # (n, 3, light)
            basis = self.basis[:, spheres]
            if len(basis) == 1:
                return relight(basis[0], radiance)
            rendered = radiance.new_empty(len(radiance), basis.shape[1], 3, basis.shape[2])
            for index in sorted(set(rig.tolist())):
                rows = (rig == index).nonzero()[:, 0].to(radiance.device, non_blocking=True)
                rendered = rendered.index_copy(0, rows, relight(basis[index], radiance[rows]))
            return rendered

    def masks(self, rig: Int[Tensor, "n"]) -> Float[Tensor, "n sphere 1 pixel"]:
        """1 where a pixel sees nothing but its sphere."""
        if len(self.mask) == 1:
            return self.mask[:, :, None].expand(len(rig), -1, -1, -1)
        return self.mask[rig.to(self.mask.device, non_blocking=True)][:, :, None]


def relight(
    basis: Float[Tensor, "sphere pixel light"], radiance: Float[Tensor, "n 3 light"]
) -> Float[Tensor, "n sphere 3 pixel"]:
    """Equation 1 for all spheres of one rig."""
    spheres, pixels, lights = basis.shape
    rendered = radiance.reshape(-1, lights) @ basis.reshape(-1, lights).T  # (n 3, sphere pixel)
    return rendered.reshape(-1, 3, spheres, pixels).transpose(1, 2)


def soft_clip(p: Tensor, n: float = SOFT_CLIP_N) -> Tensor:
    """Equation 3, in the form that does not overflow for bright p."""
    return 1.0 - functional.softplus(-n * (p - 1.0)) / n


def encode(linear: Tensor) -> Tensor:
    """Linear radiance -> pixel value; the gradient at black stays finite."""
    return linear.clamp_min(DARKEST) ** (1.0 / GAMMA)


def pixels_of(
    rendered: Float[Tensor, "n sphere 3 pixel"], mask: Float[Tensor, "n sphere 1 pixel"]
) -> Float[Tensor, "n sphere 3 pixel"]:
    """Pixel values of linear renderings; 1 outside the mask.

    Masked before the power: in the corners 0 * inf would be a gradient of nan.
    """
    return encode(soft_clip(torch.where(mask > 0, rendered, torch.ones_like(rendered))))


def target_pixels(pixels: Tensor, form: Form) -> Tensor:
    """What a sphere's pixel values in [0, 1] are compared as; see `LossConfig.form`."""
    if form == "plain":
        return pixels
    if form == "paper":
        return soft_clip(pixels)
    return encode(soft_clip(pixels**GAMMA))


def masked_l1(
    rendered: Float[Tensor, "n sphere 3 pixel"],
    pixels: Float[Tensor, "n sphere 3 pixel"],
    mask: Float[Tensor, "n sphere 1 pixel"],
    form: Form = "consistent",
    reduction: Reduction = "mean",
) -> Float[Tensor, "n sphere"]:
    """Equation 4 without its weights: |encode(soft_clip(rendered)) - target| inside the mask.

    `rendered` is linear radiance, `pixels` are 8-bit values / 255. "mean" is over masked pixels and
    channels, "sum" is the norm as printed (some 2,000 times larger, so that the adversarial weight
    would mean something else).
    """
    difference = pixels_of(rendered, mask) - target_pixels(pixels, form)
    return masked_norm(difference, mask, reduction)


def masked_norm(
    difference: Float[Tensor, "n sphere 3 pixel"],
    mask: Float[Tensor, "n sphere 1 pixel"],
    reduction: Reduction = "mean",
) -> Float[Tensor, "n sphere"]:
    """Sum or mean of |difference| over masked pixels and channels."""
    total = (difference.abs() * mask).sum((2, 3))
    return total if reduction == "sum" else total / (3.0 * mask.sum((2, 3)))


@dataclass(frozen=True, eq=False)
class LossTerms:
    """The weighted terms of the objective by name (equation 6), and what is only reported."""

    weighted: Mapping[str, Tensor]
    """Scalars to be added up: "reconstruction", and "adversarial" where there is a D."""
    reported: Mapping[str, Tensor]
    """Masked L1 per sphere, and what is reported of D, unweighted, detached."""

    def total(self) -> Tensor:
        return torch.stack(tuple(self.weighted.values())).sum()


def reconstruction_terms(
    bases: RigBases,
    config: LossConfig,
    log_radiance: Float[Tensor, "n 3 size size"],
    spheres: Float[Tensor, "n sphere 3 pixel"],
    rig: Int[Tensor, "n"],
) -> LossTerms:
    """Equation 4 with the weights of the spheres, mean over the examples."""
    rendered = bases.render(log_radiance, rig)
    with torch.autocast(log_radiance.device.type, enabled=False):
        per_sphere = masked_l1(
            rendered, spheres, bases.masks(rig), config.form, config.reduction
        ).mean(0)
        weights = torch.tensor(config.weights(), device=per_sphere.device)
        return LossTerms(
            weighted={"reconstruction": (weights * per_sphere).sum()},
            reported={name: per_sphere[i].detach() for i, name in enumerate(SPHERES)},
        )
