"""Lamps in the network: a few compact lights that are added to the map's radiance. Our choice.

A map that is taught by the spheres' pixels is safest when it is blurred, and a blurred light casts
no shadow. A lamp is small by construction: the network says where it stands and how much of the
light is its own, and the map is left with the rest.
"""

import math

import torch
from jaxtyping import Float
from torch import Tensor, nn

from deeplight.contract import LAMP_NUMBERS
from deeplight.lobe import lobe_grid

LEAST_CONCENTRATION, MOST_CONCENTRATION = 15.0, 150.0
"""Of the lobes: discs of 30 and of 9 degrees' radius."""
DIMMER = 0.4
"""A map with lamps starts this much dimmer, in ln; the lamps start with what it lacks."""
START_SPREAD = 0.3
"""Standard deviation of a lamp's seven numbers before training, about."""
SHORTEST = 1e-6


class Lamps(nn.Module):
    """Latent vector -> lamps; they start up and behind the camera, fanned out."""

    def __init__(self, latent_size: int, count: int, start_radiance: float) -> None:
        super().__init__()
        self.count = count
        self.head = nn.Linear(latent_size, count * LAMP_NUMBERS)
        nn.init.normal_(self.head.weight, std=START_SPREAD / math.sqrt(latent_size))
        missing = 4 * math.pi * start_radiance * (1 - math.exp(-DIMMER))
        start = torch.zeros(count, LAMP_NUMBERS)
        for number in range(count):
            across = 2 * math.pi * (number + 0.5) / count  # of a cone about up and behind
            start[number, 0] = 0.7 * math.sin(across)
            start[number, 1] = 0.8
            start[number, 2] = 0.6 + 0.3 * math.cos(across)
        start[:, 3:6] = math.log(missing / count)
        with torch.no_grad():
            self.head.bias.copy_(start.flatten())

    def forward(self, latent: Float[Tensor, "n latent"]) -> Float[Tensor, "n lamp 7"]:
        """Numbers of each lamp; `parts_of` says what they mean."""
        numbers: Tensor = self.head(latent).float().reshape(-1, self.count, LAMP_NUMBERS)
        return numbers

    @torch.no_grad()
    def brighten(self, log_gain: float) -> None:
        """Multiply every lamp's flux by exp(log_gain)."""
        self.head.bias.view(self.count, LAMP_NUMBERS)[:, 3:6] += log_gain


def parts_of(
    numbers: Float[Tensor, "n lamp 7"],
) -> tuple[Float[Tensor, "n lamp 3"], Float[Tensor, "n lamp 3"], Float[Tensor, "n lamp 1"]]:
    """Unit directions, ln flux and concentrations."""
    direction = numbers[..., :3]
    length = direction.square().sum(-1, keepdim=True).clamp_min(SHORTEST).sqrt()
    span = MOST_CONCENTRATION - LEAST_CONCENTRATION
    concentration = LEAST_CONCENTRATION + span * torch.sigmoid(numbers[..., 6:])
    return direction / length, numbers[..., 3:6], concentration


def mirror_image(numbers: Float[Tensor, "n lamp 7"]) -> Float[Tensor, "n lamp 7"]:
    """The lamps of the mirrored scene, left and right: the first is the last one's image, as the
    start has it."""
    turned = numbers.flip(1)
    return torch.cat((-turned[..., :1], turned[..., 1:]), -1)


class LampBall(nn.Module):
    """Lamps drawn on a mirror ball of `size` pixels, each with its flux exactly."""

    towards: Tensor
    solid_angle: Tensor

    def __init__(self, size: int) -> None:
        super().__init__()
        self.size = size
        towards, solid_angle = lobe_grid(size)
        self.register_buffer("towards", torch.tensor(towards).T.contiguous(), persistent=False)
        self.register_buffer("solid_angle", torch.tensor(solid_angle)[:, None], persistent=False)

    def forward(
        self,
        direction: Float[Tensor, "n lamp 3"],
        log_flux: Float[Tensor, "n lamp 3"],
        concentration: Float[Tensor, "n lamp 1"],
    ) -> Float[Tensor, "n 3 size size"]:
        """Radiance of all lamps together: of each a von Mises-Fisher lobe, normalised over the
        ball's own pixels, so that none of its flux is lost where it is smaller than one."""
        with torch.autocast(direction.device.type, enabled=False):
            exponent = concentration * (direction @ self.towards)  # (n, lamp, pixel)
            lobe = torch.exp(exponent - exponent.amax(-1, keepdim=True))
            lobe = lobe / (lobe @ self.solid_angle)
            radiance = log_flux.exp().mT @ lobe  # (n, 3, pixel)
        return radiance.reshape(-1, 3, self.size, self.size)


def together(
    log_map: Float[Tensor, "n 3 size size"], radiance: Float[Tensor, "n 3 size size"]
) -> Float[Tensor, "n 3 size size"]:
    """ln of the map's radiance and the lamps'."""
    return torch.log(log_map.float().exp() + radiance)


def numbers_of(direction: Tensor, log_flux: Tensor, concentration: Tensor) -> Tensor:
    """Lamps as the exported network gives them, (n, lamp, 7): see
    `ModelContract.lamps`."""
    radius = 2 * torch.asin(concentration.rsqrt())
    return torch.cat((direction, log_flux, radius), -1)
