"""The discriminator D and the pictures it judges: clipped mirror balls on a clean plate [3.4].

Real and predicted ball are laid over the same plate with the same alpha, both soft-clipped and
gamma-encoded, so that nothing but the light in the ball distinguishes them.
"""

from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

from deeplight.errors import ConfigError
from deeplight.sphere import SPHERES
from deeplight.training.augment import Inputs, turn_back
from deeplight.training.losses import Form, RigBases, pixels_of, target_pixels
from deeplight.training.network.mobilenet_v2 import BATCH_NORM_EPSILON

MIRROR = SPHERES.index("mirror")


@dataclass(frozen=True)
class AdversarialConfig:
    """The adversarial term of equations 5 and 6; the numbers are the paper's."""

    enabled: bool = False
    """The presets of table 1's first row, `paper` and those ending in -adv, switch it on."""
    lambda_rec: float = 0.999
    """Weight of the reconstruction loss; the adversarial term has the rest. It is meant for the
    mean of `loss.reduction`: the sum would make the term some 2,000 times weaker."""
    learning_rate_factor: float = 0.01
    """D's learning rate as a share of G's."""
    form: Literal["minimax", "non_saturating"] = "minimax"
    """What G lowers. minimax: log(1 - D), as in equation 5; non_saturating: -log D, whose
    gradient does not fade where D is sure."""
    norm_over: Literal["both", "each"] = "both"
    """What D's batch norm takes as one batch. both: real and predicted balls together, so that a
    batch's own mean cannot give it away; each: one after the other."""
    widths: tuple[int, int, int] = (32, 64, 128)
    """Channels of D's three convolutions (our choice: the paper's figure has them)."""

    def __post_init__(self) -> None:
        if not 0 <= self.lambda_rec <= 1:
            got = f"{self.lambda_rec:g}"
            raise ConfigError("adversarial.lambda_rec between 0 and 1", got, "change the value")


class Discriminator(nn.Module):
    """Mirror ball pictures in [0, 1] -> the logit of D: above 0 is "filmed".

    Three strided convolutions with batch norm and ELU, then one number (Implementation Details:
    batch norm for all layers but the last). Batch norm keeps no running statistics: D is only
    ever used on training batches.
    """

    def __init__(self, widths: tuple[int, int, int], size: int = 32) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        channels = 3
        for width in widths:
            layers += [
                nn.Conv2d(channels, width, 3, stride=2, padding=1, bias=False),
                nn.BatchNorm2d(width, eps=BATCH_NORM_EPSILON, track_running_stats=False),
                nn.ELU(),
            ]
            channels, size = width, -(-size // 2)
        self.features = nn.Sequential(*layers)
        self.last = nn.Linear(channels * size * size, 1)

    def forward(self, pixels: Float[Tensor, "n 3 size size"]) -> Float[Tensor, "n"]:
        logit: Tensor = self.last(self.features(pixels - 0.5).flatten(1))
        return logit[:, 0].float()  # its logarithms are taken in float32


def clean_plate(crop: Float[Tensor, "n 3 size size"]) -> Float[Tensor, "n 3 size size"]:
    """The picture as if the ball were gone: its four corner pixels, bilinearly interpolated."""
    size = crop.shape[-1]
    corners = crop[:, :, :: size - 1, :: size - 1]
    return functional.interpolate(corners, (size, size), mode="bilinear", align_corners=True)


def mirror_pictures(
    bases: RigBases, form: Form, log_radiance: Float[Tensor, "n 3 light light"], inputs: Inputs
) -> tuple[Float[Tensor, "n 3 size size"], Float[Tensor, "n 3 size size"]]:
    """(filmed, predicted) mirror balls as pixel values on the same clean plate, float32.

    Args:
        form: what the filmed ball's pixels are taken as, see `LossConfig.form`.
        log_radiance: of the scenes as filmed, `turn_back` done; flipped examples come out
            flipped: D sees the ball of the mirrored scene, whose photo G saw.
    """
    with torch.autocast(log_radiance.device.type, enabled=False):
        rendered = bases.render(log_radiance, inputs.rig, slice(MIRROR, MIRROR + 1))
        filmed = inputs.spheres[:, MIRROR]
        whole = bases.masks(inputs.rig)[:, MIRROR : MIRROR + 1]  # (n, 1, 1, pixel)
        size = round(filmed.shape[-1] ** 0.5)
        plate = clean_plate(filmed.reshape(-1, 3, size, size))
        # A filmed pixel of the rim is part ball and part background, which no rendering knows:
        # laid over the plate it would distinguish filmed from predicted whatever the light.
        alpha = whole.reshape(-1, 1, size, size)
        pictures = []
        for ball in (target_pixels(filmed, form), pixels_of(rendered, whole)[:, 0]):
            ball = ball.reshape(-1, 3, size, size)
            pictures.append(turn_back(plate + alpha * (ball - plate), inputs.flipped))
        return pictures[0], pictures[1]


def discriminator_loss(real: Float[Tensor, "n"], fake: Float[Tensor, "n"]) -> Float[Tensor, ""]:
    """-L_adv of equation 5, from D's logits: what D lowers."""
    return functional.softplus(-real).mean() + functional.softplus(fake).mean()


def generator_term(
    fake: Float[Tensor, "n"], form: Literal["minimax", "non_saturating"]
) -> Float[Tensor, ""]:
    """G's part of equation 5, from D's logits of its pictures: what G lowers."""
    if form == "minimax":
        return -functional.softplus(fake).mean()  # log(1 - D)
    return functional.softplus(-fake).mean()  # -log D
