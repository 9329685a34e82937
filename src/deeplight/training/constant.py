"""The best constant answer, by `solve_constant` from the examples that training holds in memory.

A network that does not beat it has learnt nothing from the photo, so validation prints both.
"""

import math

import numpy as np
from jaxtyping import Float32, Int, UInt8
from torch import Tensor

from deeplight.solve import SphereCounts, solve_constant
from deeplight.sphere import SPHERES
from deeplight.training.losses import LossConfig, RigBases
from deeplight.training.network.generator import START_RADIANCE


def fit_log_radiance(
    bases: RigBases,
    spheres: UInt8[Tensor, "n sphere size size 3"],
    rig: Int[Tensor, "n"],
    loss: LossConfig,
    steps: int = 300,
) -> Float32[np.ndarray, "3 light light"]:
    """ln radiance of the lighting that, given for every example, has the least weighted L1."""
    size = math.isqrt(bases.basis.shape[-1])
    start = np.full((size, size, 3), math.log(START_RADIANCE), np.float32)
    weights = dict(zip(SPHERES, loss.weights(), strict=True))
    found = solve_constant(counted(bases, spheres, rig), start, steps, weights)
    return np.ascontiguousarray(found.transpose(2, 0, 1))


def counted(
    bases: RigBases, spheres: UInt8[Tensor, "n sphere size size 3"], rig: Int[Tensor, "n"]
) -> list[SphereCounts]:
    """How often each pixel had each value, for each rig that the examples have."""
    result = []
    for number in np.unique(rig.numpy()):
        pixels = spheres[rig == number].flatten(2, 3).numpy()  # (examples, sphere, pixel, 3)
        counts = np.zeros((*pixels.shape[1:], 256), np.int64)
        at = np.indices(pixels.shape[1:], sparse=True)
        for example in pixels:
            counts[(*at, example)] += 1
        basis = bases.basis[number].cpu().numpy()
        mask = bases.mask[number].cpu().numpy() > 0
        weights = dict(zip(SPHERES, basis, strict=True))
        masks = dict(zip(SPHERES, mask, strict=True))
        result.append(SphereCounts(weights, masks, counts, len(pixels)))
    return result
