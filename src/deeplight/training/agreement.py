"""What should agree does: losses of the paper's future work.

A photo and its mirror image should give mirrored light; two frames of a take show one room, so its
main light should stand still while the camera turns.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from deeplight.camera_response import LUMINANCE
from deeplight.lobe import lobe_grid
from deeplight.training.distil import lit_l1
from deeplight.training.losses import LossTerms

FLIP, STEADY = "flip", "steady"
"""The terms' names."""
SHARPNESS = 2.0
"""Power of the radiance by which directions are averaged to the main light's: 1 is the mean of all
light, more is nearer to the brightest spot."""


def join_agreement(
    terms: LossTerms, log_radiance: Float[Tensor, "n 3 size size"], weight: float
) -> LossTerms:
    """Add how far the answers for the photos (first half) and for their mirror images (second half,
    turned back) are from each other to what is lowered."""
    log_radiance = log_radiance.float()
    one, other = log_radiance.chunk(2)
    a, b = main_direction(log_radiance).chunk(2)
    angle = 1 - (a * b).sum(-1).mean()
    difference = lit_l1(one, other) + angle
    weighted = {**terms.weighted, FLIP: weight * difference}
    return replace(terms, weighted=weighted, reported={**terms.reported, FLIP: difference.detach()})


def join_steadiness(
    terms: LossTerms,
    log_radiance: Float[Tensor, "n 3 size size"],
    turn: Float[Tensor, "pairs 3 3"],
    weight: float,
) -> LossTerms:
    """Add `jump_of` to what is lowered."""
    jump = jump_of(log_radiance.float(), turn)
    weighted = {**terms.weighted, STEADY: weight * jump}
    return replace(terms, weighted=weighted, reported={**terms.reported, STEADY: jump.detach()})


def jump_of(
    log_radiance: Float[Tensor, "n 3 size size"], turn: Float[Tensor, "pairs 3 3"]
) -> Float[Tensor, ""]:
    """1 - cos of how far the main light jumps between the frames of each pair, mean.

    `log_radiance` is of all first frames, then of all second ones; once or, seen both ways, twice.
    `turn` brings directions of the first frame's camera to the second one's.
    """
    found = main_direction(log_radiance).reshape(-1, 2, len(turn), 3)
    first, second = found.unbind(1)
    return 1 - (torch.einsum("nij,cnj->cni", turn, first) * second).sum(-1).mean()


def main_direction(log_radiance: Float[Tensor, "n 3 size size"]) -> Float[Tensor, "n 3"]:
    """Unit direction of the main light, in a form that can be learnt from; camera frame."""
    towards, power = sharpened(log_radiance)
    return functional.normalize(power @ towards, dim=-1)


def sharpened(
    log_radiance: Float[Tensor, "n 3 size size"],
) -> tuple[Float[Tensor, "pixels 3"], Float[Tensor, "n pixels"]]:
    """Directions, and what comes from each of the light to the power of `SHARPNESS`, in units of
    the brightest."""
    towards, solid_angle = (
        torch.tensor(part, device=log_radiance.device) for part in lobe_grid(log_radiance.shape[-1])
    )
    scale = torch.tensor(LUMINANCE, dtype=torch.float32, device=log_radiance.device)
    luminance = torch.einsum("nchw,c->nhw", log_radiance.exp(), scale).flatten(1)
    brightest = luminance.amax(1, keepdim=True)
    return towards, (luminance / brightest) ** SHARPNESS * solid_angle
