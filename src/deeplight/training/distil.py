"""How far one network's light is from another's, whatever their sizes; settings of `teacher`."""

from dataclasses import dataclass
from functools import lru_cache

import torch
from jaxtyping import Float
from torch import Tensor
from torch.nn import functional

from deeplight.mappings.mirror_ball import coverage


@dataclass(frozen=True)
class DistilConfig:
    """The teacher of a smaller network, of one with another output size, and of one that is to
    answer as several do; not in the paper."""

    teacher: str = ""
    """A trained network: .onnx, best.safetensors or the folder of a run; or several, divided by
    commas, which teach their mean radiance. The new network starts as near the first as it can (see
    `slim`), without --weights. Empty: no teacher."""
    weight: float = 0.1
    """Weight of the mean |ln radiance - the teacher's| added to the reconstruction loss."""


def lit_l1(a: Float[Tensor, "n 3 size size"], b: Float[Tensor, "n 3 size size"]) -> Tensor:
    """Mean absolute difference over all directions, each solid angle counted alike."""
    lit = lit_share(a.shape[-1]).to(a.device)
    return ((a - b).abs() * lit).sum() / (lit.sum() * a.shape[0] * a.shape[1])


def resized(
    log_radiance: Float[Tensor, "n 3 old old"], size: int
) -> Float[Tensor, "n 3 size size"]:
    """The same light on a ball of another size: smaller by the mean radiance, larger bilinear."""
    old = log_radiance.shape[-1]
    if size == old:
        return log_radiance
    if size > old:
        return functional.interpolate(log_radiance, (size, size), mode="bilinear")
    lit = lit_share(old).to(log_radiance.device)
    light = functional.avg_pool2d(log_radiance.exp() * lit, old // size)
    share = functional.avg_pool2d(lit[None, None], old // size)
    # Where nothing is lit there is no light to average; what stands there is never looked at.
    return torch.log(torch.where(share > 0, light / share.clamp_min(1e-6), torch.ones_like(light)))


@lru_cache
def lit_share(size: int) -> Float[Tensor, "size size"]:
    """How much of each pixel lies on the mirror ball."""
    return torch.tensor(coverage(size), dtype=torch.float32)
