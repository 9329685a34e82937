"""What light looks like: lighting fitted to training examples, and its principal components.

Each example's lighting is found from its three 8-bit spheres alone, through the relighting loss:
no HDR enters. A few dozen components of these fits give a network few places can teach a start
(`network.components`): it begins by choosing among plausible lights.
"""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from deeplight.io.arrays_file import read_array
from deeplight.io.atomic import replacing
from deeplight.mappings import mirror_ball
from deeplight.training.data import Batch, take
from deeplight.training.losses import LossConfig, RigBases, reconstruction_terms
from deeplight.training.network.generator import START_RADIANCE

STEPS = 200
LEARNING_RATE = 0.15
SMOOTHNESS = 0.005
"""Weight of the mean squared difference of neighbouring pixels of ln radiance (our choice): where
the spheres leave the light open, as where the mirror is clipped, it stays smooth."""
CHUNK = 256

Progress = Callable[[int, int], None]


def fit_all(
    bases: RigBases, table: Batch, loss: LossConfig, folder: Path, progress: Progress | None = None
) -> Float[Tensor, "n 3 light light"]:
    """ln radiance fitted to each example of `table`, in its camera frame.

    Works in chunks that are kept in `folder`: a killed fit goes on with the next chunk.

    Args:
        progress: called with the examples done and their count.
    """
    count, fits = len(table.photo), []
    size = math.isqrt(bases.basis.shape[-1])
    for first in range(0, count, CHUNK):
        rows = np.arange(first, min(first + CHUNK, count))
        path = folder / f"fitted-{first:06d}.npy"
        if not path.is_file():
            found = fit(bases, take(table, rows), loss, STEPS).cpu().numpy()
            with replacing(path) as temporary:
                np.save(temporary, found)
        fits.append(torch.from_numpy(read_array(path)))
        if progress is not None:
            progress(first + len(rows), count)
    return torch.cat(fits).reshape(count, 3, size, size)


def fit(
    bases: RigBases, batch: Batch, loss: LossConfig, steps: int = STEPS
) -> Float[Tensor, "n 3 light light"]:
    """The smooth lighting of each example with the least reconstruction loss, by Adam.

    Always from the same start, so the result is a function of its arguments.
    """
    device, size = bases.basis.device, math.isqrt(bases.basis.shape[-1])
    n = len(batch.spheres)
    start = math.log(START_RADIANCE)
    q = torch.full((n, 3, size, size), start, device=device, requires_grad=True)
    optimiser = torch.optim.Adam([q], lr=LEARNING_RATE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, steps)
    spheres = (batch.spheres.flatten(2, 3).transpose(2, 3) / 255.0).to(device)
    inside = torch.tensor(mirror_ball.coverage(size) > 0, device=device)
    for _ in range(steps):
        terms = reconstruction_terms(bases, loss, q, spheres, batch.rig)
        optimiser.zero_grad()
        # Times n: every example has its own optimum and none should wait for the others.
        (n * (terms.total() + SMOOTHNESS * roughness(q, inside))).backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        schedule.step()
    return torch.where(inside, q.detach(), start)


def roughness(q: Float[Tensor, "n 3 size size"], inside: Tensor) -> Float[Tensor, ""]:
    """Mean squared difference of neighbours inside the disc."""
    down = (q[:, :, 1:] - q[:, :, :-1]).square()[..., inside[1:] & inside[:-1]]
    right = (q[..., 1:] - q[..., :-1]).square()[..., inside[:, 1:] & inside[:, :-1]]
    return down.mean() + right.mean()


def principal_components(
    fits: Float[Tensor, "n 3 light light"], count: int, flips: bool, shuffles: bool
) -> tuple[Float[Tensor, "3 light light"], Float[Tensor, "k 3 light light"]]:
    """Mean and `count` principal components of ln radiance, each times its standard deviation.

    Args:
        flips: training flips photos, so lights are taken flipped as well.
        shuffles: it also shuffles colour channels.
    """
    if flips:
        fits = torch.cat((fits, fits.flip(-1)))
    if shuffles:
        fits = torch.cat([fits.roll(turn, dims=1) for turn in range(3)])
    mean = fits.mean(0)
    flat = (fits - mean).flatten(1)
    kept = min(count, *flat.shape)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        _, scale, directions = torch.svd_lowrank(flat, q=min(kept + 10, *flat.shape), niter=4)
    components = flat.new_zeros(count, flat.shape[1])
    components[:kept] = (directions[:, :kept] * scale[:kept] / math.sqrt(len(flat))).T
    return mean, components.reshape(count, *mean.shape)
