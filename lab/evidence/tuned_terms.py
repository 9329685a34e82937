"""Losses that `tuned_losses` tries: where the main light is, and that it stays there in a pan."""

from functools import lru_cache

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from deeplight.mappings import mirror_ball
from deeplight.training.agreement import jump_of, main_direction, sharpened
from deeplight.training.distil import lit_l1

WEIGHTS = (0.3, 0.3, 0.4)
"""Of mirror, matte silver, diffuse: the shipped model's."""
NEAR = 12.0
"""Concentration of the lobe around the true main light: half as much at 20 degrees."""
LEAST = 1e-4


def direction_loss(
    log_radiance: Float[Tensor, "n 3 size size"], true: Float[Tensor, "n 3"]
) -> Float[Tensor, ""]:
    """1 - cos of the angle between main lights, mean over the examples that have one."""
    known = true.isfinite().all(1)
    return (1 - (main_direction(log_radiance)[known] * true[known]).sum(1)).mean()


def mode_loss(
    log_radiance: Float[Tensor, "n 3 size size"], true: Float[Tensor, "n 3"]
) -> Float[Tensor, ""]:
    """-ln of the share of the light, its radiance to the power of `SHARPNESS`, that comes from near
    the true main light: the score of a forecast of its direction."""
    known = true.isfinite().all(1)
    towards, power = sharpened(log_radiance[known])
    share = power / power.sum(1, keepdim=True)
    near = torch.exp(NEAR * (true[known] @ towards.T - 1))
    return -torch.log((share * near).sum(1) + LEAST).mean()


def turn_loss(
    log_radiance: Float[Tensor, "two_n 3 size size"], world_from_camera: Float[Tensor, "n 2 3 3"]
) -> Float[Tensor, ""]:
    """1 - cos of the angle between the main lights of two frames of one take, in one frame of
    reference; the first half of `log_radiance` are the first frames."""
    return jump_of(log_radiance, second_from_first(world_from_camera))


def steadiness_loss(
    log_radiance: Float[Tensor, "two_n 3 size size"],
    world_from_camera: Float[Tensor, "n 2 3 3"],
    log_gain: Float[Tensor, "n 2 3"],
) -> Float[Tensor, ""]:
    """How far the lights of two frames of one take are apart: `turn_loss`, and mean |ln radiance|
    with the exposure between them taken out."""
    one, other = log_radiance.chunk(2)
    brighter = (log_gain[:, 1] - log_gain[:, 0])[:, :, None, None]
    moved = turned_ball(one, second_from_first(world_from_camera)) + brighter
    return lit_l1(moved, other) + turn_loss(log_radiance, world_from_camera)


def second_from_first(world_from_camera: Float[Tensor, "n 2 3 3"]) -> Float[Tensor, "n 3 3"]:
    """The camera frame of the second frame of each pair from that of the first."""
    before, after = world_from_camera.unbind(1)
    return after.mT @ before


def turned_ball(
    log_radiance: Float[Tensor, "n 3 size size"], new_from_old: Float[Tensor, "n 3 3"]
) -> Float[Tensor, "n 3 size size"]:
    """The same light in a turned frame: bilinear, each pixel from where its centre was."""
    size = log_radiance.shape[-1]
    old = _pixel_directions(size) @ new_from_old  # as rows: R^T d
    behind = (1 + old[..., 2]).clamp_min(LEAST)
    u, v = (old[..., axis] / torch.sqrt(2 * behind) for axis in (0, 1))
    grid = torch.stack((u, -v), -1).reshape(-1, size, size, 2)  # row 0 is the top
    return functional.grid_sample(
        log_radiance, grid, mode="bilinear", padding_mode="border", align_corners=False
    )


@lru_cache
def _pixel_directions(size: int) -> Float[Tensor, "pixels 3"]:
    return torch.tensor(mirror_ball.pixel_directions(size).reshape(-1, 3).astype(np.float32))
