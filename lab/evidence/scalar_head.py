"""A small head on a frozen network that reads what a photo states of its camera.

Latent vector, scalars and a "known" bit for each scalar become spherical harmonics that are added
to each channel of ln radiance; nothing, before it has learnt.
"""

from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from deeplight.harmonics import basis
from deeplight.mappings import mirror_ball
from deeplight.training.data import balanced_order
from lab.evidence.some_pixels import SomePixels

SCALARS = {"exposure": 1, "white balance": 2, "pitch": 1, "roll": 1, "field of view": 1}
"""How many numbers each scalar is, in their order in `Views.scalars`."""
MEMBERS = torch.repeat_interleave(torch.eye(len(SCALARS)), torch.tensor([*SCALARS.values()]), 1)
ORDER, HIDDEN, DROPOUT, BATCH, RATE, DECAY = 3, 128, 0.3, 64, 1e-3, 0.05
WEIGHTS = (0.4, 0.2, 0.4)  # of mirror, matte silver, diffuse


class Views(NamedTuple):
    """Examples as the frozen network has them."""

    latent: Float[Tensor, "n latent"]
    light: Float[Tensor, "n 3 light light"]  # ln radiance
    scalars: Float[Tensor, "n 6"]
    spheres: np.ndarray
    places: np.ndarray


class Head(nn.Module):
    """Latent vector and what is known of the camera -> what is added to ln radiance."""

    def __init__(self, latent_size: int, scalars: Float[Tensor, "n 6"], light_size: int) -> None:
        super().__init__()
        self.mean, self.spread = scalars.mean(0), scalars.std(0).clamp_min(1e-3)
        shapes = basis(mirror_ball.pixel_directions(light_size), ORDER)
        self.shapes = torch.tensor(shapes, dtype=torch.float32).permute(2, 0, 1)
        self.inner = nn.Sequential(
            nn.Dropout(DROPOUT), nn.Linear(latent_size + sum(MEMBERS.shape), HIDDEN), nn.ReLU(),
            nn.Dropout(DROPOUT),
        )  # fmt: skip
        self.outer = nn.Linear(HIDDEN, 3 * len(self.shapes))
        nn.init.zeros_(self.outer.weight)
        nn.init.zeros_(self.outer.bias)

    def forward(self, latent: Tensor, scalars: Tensor, known: Bool[Tensor, "n 5"]) -> Tensor:
        """(n, 3, light, light)."""
        bits = known.float()
        # Chosen, not multiplied: an unknown scalar may be anything, NaN included.
        read = torch.where(bits @ MEMBERS > 0, (scalars - self.mean) / self.spread, 0.0)
        weights = self.outer(self.inner(torch.cat((latent, read, bits), 1)))
        return torch.einsum("nck,kij->ncij", weights.unflatten(1, (3, -1)), self.shapes)


def trained(views: Views, pixels: SomePixels, missing: float, steps: int, seed: int) -> Head:
    """A head after the steps, all places equally often seen.

    Args:
        missing: share of the examples in which each scalar is unknown, drawn anew each time.
    """
    torch.manual_seed(seed)
    head = Head(views.latent.shape[1], views.scalars, views.light.shape[-1]).train()
    optimiser = torch.optim.AdamW(head.parameters(), RATE, weight_decay=DECAY)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    random = np.random.default_rng(seed)
    groups = [np.flatnonzero(views.places == place) for place in np.unique(views.places)]
    for _ in range(steps):
        rows = balanced_order(groups, BATCH, random)
        known = torch.from_numpy(random.random((BATCH, len(SCALARS))) >= missing)
        light = views.light[rows] + head(views.latent[rows], views.scalars[rows], known)
        loss = pixels.loss(light, views.spheres[rows], WEIGHTS, random)
        optimiser.zero_grad()
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        schedule.step()
    return head
