"""Baseline: the one lighting that answers the training split best."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float32, Float64

from deeplight.camera_response import GAMMA, SOFT_CLIP_N, encode, soft_clip
from deeplight.evaluate.baselines.baseline import ConstantLighting
from deeplight.evaluate.baselines.training_pixels import RigPixels
from deeplight.sphere import LOSS_WEIGHTS, SPHERES

STEPS = 400
LEARNING_RATE = 0.05
_DARKEST = 1e-4  # below it the slope of the gamma encoding is that at it


def best_constant(
    rigs: list[RigPixels], start: Float32[np.ndarray, "size size 3"], steps: int = STEPS
) -> ConstantLighting:
    """Minimise the weighted masked L1 over the training examples, for one lighting for all.

    The strongest baseline that does not look at the photo. The loss and its gradient come from the
    counted pixels, so every step sees every example. Adam (Kingma and Ba 2015), step size falling
    to 0 as a cosine; the best of all steps is kept, so the result is never worse than `start`.

    Args:
        start: ln radiance to begin at, for example `mean_spheres`'s.
    """
    spheres = [sphere for rig in rigs for sphere in _filmed_spheres(rig)]
    q = start.reshape(-1, 3).astype(np.float64)
    best, best_loss = q, np.inf
    first, second = np.zeros_like(q), np.zeros_like(q)
    for step in range(1, steps + 1):
        loss, gradient = _loss_and_gradient(spheres, q)
        if loss < best_loss:
            best, best_loss = q, loss
        first = 0.9 * first + 0.1 * gradient
        second = 0.99 * second + 0.01 * gradient**2
        rate = LEARNING_RATE * (1 + np.cos(np.pi * step / steps)) / 2
        unbiased = np.sqrt(second / (1 - 0.99**step)) + 1e-12
        q = q - rate * (first / (1 - 0.9**step)) / unbiased
    return ConstantLighting("best_constant", best.reshape(start.shape).astype(np.float32))


def constant_loss(rigs: list[RigPixels], log_radiance: Float32[np.ndarray, "size size 3"]) -> float:
    """Give the weighted masked L1 of one lighting for all counted training examples."""
    spheres = [sphere for rig in rigs for sphere in _filmed_spheres(rig)]
    return _loss_and_gradient(spheres, log_radiance.reshape(-1, 3).astype(np.float64))[0]


class _FilmedSphere(NamedTuple):
    """The masked pixels of one sphere of one rig in training.

    `part` and `total` are of the examples whose value is at most v / 255 at [..., v + 1]: how many
    of all they are, and the sum of their values over the number of all.
    """

    weights: Float32[np.ndarray, "pixels lights"]
    loss_weight: float  # of this sphere, times its rig's examples
    part: Float64[np.ndarray, "pixels 3 257"]
    total: Float64[np.ndarray, "pixels 3 257"]


def _filmed_spheres(rig: RigPixels) -> list[_FilmedSphere]:
    spheres = []
    for number, name in enumerate(SPHERES):
        mask = rig.mask(name)
        parts = rig.counts[number][mask] / rig.examples
        sums = parts * (np.arange(256) / 255)
        before = ((0, 0), (0, 0), (1, 0))
        part, total = (np.pad(values.cumsum(-1), before) for values in (parts, sums))
        loss_weight = LOSS_WEIGHTS[name] * rig.examples
        spheres.append(_FilmedSphere(rig.bases[name].weights[mask], loss_weight, part, total))
    return spheres


def _loss_and_gradient(
    spheres: list[_FilmedSphere], q: Float64[np.ndarray, "lights 3"]
) -> tuple[float, Float64[np.ndarray, "lights 3"]]:
    radiance = np.exp(q)
    loss, gradient = 0.0, np.zeros_like(q)
    for sphere in spheres:
        linear = (sphere.weights @ radiance.astype(np.float32)).astype(np.float64)
        clipped = soft_clip(linear)
        distance, slope = _mean_distance(encode(clipped), sphere)
        loss += sphere.loss_weight * float(distance.mean())
        slope *= np.maximum(clipped, _DARKEST) ** (1 / GAMMA - 1) / GAMMA
        # Far above the clip the slope is as good as 0; 1e-26 keeps float32 from slow denormals.
        slope /= 1 + np.exp(np.minimum(SOFT_CLIP_N * (linear - 1), 60.0))
        share = sphere.loss_weight / slope.size
        gradient += share * (sphere.weights.T @ slope.astype(np.float32)) * radiance
    whole = sum(sphere.loss_weight for sphere in spheres)
    return loss / whole, gradient / whole


def _mean_distance(
    pixel: Float64[np.ndarray, "pixels 3"], sphere: _FilmedSphere
) -> tuple[Float64[np.ndarray, "pixels 3"], Float64[np.ndarray, "pixels 3"]]:
    """Mean |pixel - filmed| over the training examples, for each pixel, and its slope."""
    at = np.clip(np.floor(pixel * 255).astype(int) + 1, 0, 256)[..., None]
    part, total = (np.take_along_axis(t, at, -1)[..., 0] for t in (sphere.part, sphere.total))
    slope = 2 * part - 1
    return pixel * slope + sphere.total[..., -1] - 2 * total, slope
