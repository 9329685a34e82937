"""The best constant answer: one lighting for every photo, fitted through the training loss.

A network that does not beat it has learnt nothing from the photo, so validation prints both.
"""

import math

import torch
from jaxtyping import Float, Int, UInt8
from torch import Tensor

from deeplight.lighting import Lighting
from deeplight.training.losses import LossConfig, RigBases, masked_norm, pixels_of, target_pixels
from deeplight.training.network.generator import START_RADIANCE

LEARNING_RATE = 0.05


def fit_constant_lighting(
    bases: RigBases,
    spheres: UInt8[Tensor, "n sphere size size 3"],
    rig: Int[Tensor, "n"],
    loss: LossConfig | None = None,
    steps: int = 300,
    batch_size: int = 256,
) -> Lighting:
    """The lighting that, given for every example, has the least reconstruction loss.

    Adam over batches of the examples; always from the same start and in the same order, so the
    result is a function of its arguments.
    """
    q = fit_log_radiance(bases, spheres, rig, loss or LossConfig(), steps, batch_size)
    return Lighting.from_log_radiance(q.permute(1, 2, 0).cpu().numpy())


def fit_log_radiance(
    bases: RigBases,
    spheres: UInt8[Tensor, "n sphere size size 3"],
    rig: Int[Tensor, "n"],
    loss: LossConfig,
    steps: int = 300,
    batch_size: int = 256,
) -> Float[Tensor, "3 light light"]:
    """As `fit_constant_lighting`, in ln radiance."""
    rigs, _, _, lights = bases.basis.shape
    size, device = math.isqrt(lights), bases.basis.device
    q = torch.full((3, size, size), math.log(START_RADIANCE), device=device, requires_grad=True)
    optimiser = torch.optim.Adam([q], lr=LEARNING_RATE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    weights = torch.tensor(loss.weights(), device=device)
    targets = target_pixels(spheres.flatten(2, 3).transpose(2, 3) / 255.0, loss.form).to(device)
    every_rig = torch.arange(rigs)
    masks = bases.masks(every_rig)
    order = torch.randperm(len(spheres), generator=torch.Generator().manual_seed(0))
    for step in range(steps):
        chosen = order.roll(-step * batch_size)[:batch_size]
        # Rendered once per rig, not once per example.
        shown = pixels_of(bases.render(q.expand(rigs, -1, -1, -1), every_rig), masks)
        wanted = targets[chosen.to(device)]
        difference = of_rig(shown, rig[chosen]) - wanted
        per_sphere = masked_norm(difference, of_rig(masks, rig[chosen]))
        optimiser.zero_grad()
        (per_sphere.mean(0) * weights).sum().backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        schedule.step()
    return q.detach()


def of_rig(values: Tensor, rig: Int[Tensor, "n"]) -> Tensor:
    """Each example's row of `values`, which has one per rig."""
    if len(values) == 1:  # without the copies that indexing makes
        return values.expand(len(rig), *values.shape[1:])
    return values[rig.to(values.device)]
