"""Light from filmed spheres: equations 1 and 2 turned around.

The mirror sphere shows the directions, the diffuse one how much light the mirror's picture clipped.
`light_from_spheres` answers one picture of the spheres; `solve_mean` and `solve_constant` give the
one light that answers many, from how often each pixel had each 8-bit value.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Float32, Float64, Int64, UInt8

from deeplight.camera_response import GAMMA, SOFT_CLIP_N, decode, encode, soft_clip
from deeplight.errors import InputError
from deeplight.lighting import Lighting
from deeplight.mappings.resample import shrink
from deeplight.reflectance import ReflectanceBasis, rig_bases
from deeplight.sphere import LOSS_WEIGHTS, PAPER_RIG, SPHERES

CLIPPED = 250
"""8-bit values from here on have lost light."""
BRIGHTEST = 1000.0
"""Limit of how far a clipped pixel is raised."""
STEPS = 400
LEARNING_RATE = 0.05
_DARKEST = 1e-4  # below it the slope of the gamma encoding is that at it

Sphere = UInt8[np.ndarray, "size size 3"]


def light_from_spheres(
    spheres: Mapping[str, Sphere], bases: Mapping[str, ReflectanceBasis] | None = None
) -> Lighting:
    """The light that explains a photographed mirror and diffuse sphere.

    Where the mirror's picture is not clipped, the light is what it shows over its reflectivity.
    What it clipped is raised by one factor per channel, with which the diffuse sphere, rendered in
    the light, is as bright as it was filmed; at most `BRIGHTEST`.

    Args:
        spheres: "mirror" and "diffuse": square pictures that a sphere just fills, gamma-encoded, of
            at least the basis's size; larger ones are averaged down.
        bases: of these spheres as they were filmed; left out, `PAPER_RIG`'s.

    Returns:
        The light in the camera's frame, relative to its white. A mirror shows all directions but
        those right behind it; these get the mean of the others.

    Raises:
        InputError: one of the two is missing or no square picture.

    Examples:
        >>> white = deeplight.Lighting(np.full((32, 32, 3), 0.5, np.float32))
        >>> camera = deeplight.CameraResponse()
        >>> lit = deeplight.relight_rig(deeplight.PAPER_RIG, white)
        >>> filmed = {name: np.rint(255 * camera.pixel_from_radiance(radiance)).astype(np.uint8)
        ...           for name, radiance in lit.items()}
        >>> light = deeplight.light_from_spheres(filmed)
        >>> bool(np.allclose(light.power() / (4 * np.pi), 0.5, atol=0.01))
        True
    """
    bases = rig_bases(PAPER_RIG) if bases is None else bases
    for name in ("mirror", "diffuse"):
        if name not in spheres or name not in bases:
            got = ", ".join(spheres) or "none"
            raise InputError("pictures of a mirror and a diffuse sphere", got, "give both")
    mirror, diffuse = bases["mirror"], bases["diffuse"]
    shown, grey = (_fitted(spheres[n], bases[n], n) for n in ("mirror", "diffuse"))
    radiance = seen_in_mirror(mirror.weights, _mask(mirror), decode(shown / 255.0))
    lost = _lost(shown, mirror)
    mask = _mask(diffuse)
    weights, wanted = diffuse.weights[mask].astype(np.float64), decode(grey[mask] / 255.0)
    for channel in range(3):
        rest = np.where(lost[:, channel], 0, radiance[:, channel])
        above = radiance[:, channel] - rest
        usable = grey[mask, channel] < CLIPPED
        if not usable.any():  # the diffuse sphere is white all over: as bright as it says
            usable[:] = True
        a, b = (weights @ above)[usable], wanted[usable, channel] - (weights @ rest)[usable]
        factor = float(a @ b / (a @ a)) if a.any() else 1.0
        radiance[:, channel] = rest + np.clip(factor, 1.0, BRIGHTEST) * above
    size = mirror.light_size
    return Lighting(radiance.reshape(size, size, 3).astype(np.float32))


def seen_in_mirror(
    weights: Float[np.ndarray, "pixels lights"],
    mask: Bool[np.ndarray, " pixels"],
    filmed: Float64[np.ndarray, "pixels 3"],
) -> Float64[np.ndarray, "lights 3"]:
    """Give each direction the mean of the mirror pixels that show it, over the reflectivity.

    Directions behind the sphere, which no pixel shows whole, get the mean of the others.
    """
    kept = weights[mask].astype(np.float64)
    shown = kept.sum(0)
    seen = shown > 0
    total = kept.T @ filmed[mask] / kept.sum(1).max()
    radiance = np.broadcast_to(total.sum(0) / shown.sum(), total.shape).copy()
    radiance[seen] = total[seen] / shown[seen, None]
    return radiance


@dataclass(frozen=True, eq=False)
class SphereCounts:
    """How often each pixel of each sphere of one rig had each 8-bit value.

    For one light for all examples this says as much as the examples themselves: its loss, the
    gradient of its loss, and the mean pictures follow exactly.

    Attributes:
        weights: basis of each sphere of `SPHERES`, (pixels, lights).
        masks: the pixels that show nothing but sphere, row-major.
        counts: (sphere, pixel, channel, value 0 to 255).
        examples: how many were counted.
    """

    weights: Mapping[str, Float32[np.ndarray, "pixels lights"]]
    masks: Mapping[str, Bool[np.ndarray, " pixels"]]
    counts: Int64[np.ndarray, "3 pixels 3 256"]
    examples: int

    def mean_linear(self, sphere: str) -> Float64[np.ndarray, "pixels 3"]:
        """The mean of the decoded pictures of a sphere."""
        linear = decode(np.arange(256) / 255)
        mean: np.ndarray = self.counts[SPHERES.index(sphere)] @ linear / self.examples
        return mean


def solve_mean(rigs: Sequence[SphereCounts]) -> Float32[np.ndarray, "size size 3"]:
    """ln radiance of the mean mirror sphere, as bright as the mean diffuse sphere says.

    The mean linear mirror sphere over its reflectivity gives the directions; each channel is scaled
    so that the diffuse sphere rendered in it has the energy of the mean diffuse sphere, which gives
    back the light that the mirror clipped.
    """
    examples = [rig.examples for rig in rigs]
    radiance = np.average([_mean_of_rig(rig) for rig in rigs], axis=0, weights=examples)
    size = round(len(radiance) ** 0.5)
    return np.log(np.maximum(radiance, _DARKEST)).reshape(size, size, 3).astype(np.float32)


def solve_constant(
    rigs: Sequence[SphereCounts],
    start: Float32[np.ndarray, "size size 3"],
    steps: int = STEPS,
    loss_weights: Mapping[str, float] = LOSS_WEIGHTS,
) -> Float32[np.ndarray, "size size 3"]:
    """ln radiance of the one light that answers all examples with the least weighted masked L1.

    The strongest answer that does not look at the photo. The loss and its gradient come from the
    counted pixels, so every step sees every example. Adam (Kingma and Ba 2015), step size falling
    to 0 as a cosine; the best of all steps is kept, so the result is never worse than `start`.

    Args:
        rigs: the counted examples.
        start: ln radiance to begin at, for example `solve_mean`'s.
        steps: number of steps.
        loss_weights: of each sphere's L1.
    """
    spheres = _filmed_spheres(rigs, loss_weights)
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
    return best.reshape(start.shape).astype(np.float32)


def constant_loss(
    rigs: Sequence[SphereCounts], log_radiance: Float32[np.ndarray, "size size 3"]
) -> float:
    """The weighted masked L1 of one light for all counted examples."""
    spheres = _filmed_spheres(rigs, LOSS_WEIGHTS)
    return _loss_and_gradient(spheres, log_radiance.reshape(-1, 3).astype(np.float64))[0]


def _mask(basis: ReflectanceBasis) -> Bool[np.ndarray, " pixels"]:
    return basis.view.mask().ravel()


def _fitted(sphere: Sphere, basis: ReflectanceBasis, name: str) -> UInt8[np.ndarray, "pixels 3"]:
    """A picture's pixels at its basis's size, averaged in linear light."""
    size = basis.view.size
    height, width = np.shape(sphere)[:2]
    if height != width or height < size:
        expected = f"a square picture of the {name} sphere, at least {size} pixels a side"
        raise InputError(expected, f"{width} x {height}", "cut it closely around the sphere")
    if height == size:
        return np.asarray(sphere, np.uint8).reshape(-1, 3)
    linear = shrink(decode(np.asarray(sphere, np.float32) / 255), size, size)
    return np.rint(255 * encode(linear)).astype(np.uint8).reshape(-1, 3)


def _lost(shown: UInt8[np.ndarray, "pixels 3"], mirror: ReflectanceBasis) -> np.ndarray:
    """The directions whose light the mirror's picture clipped, by channel."""
    mask = _mask(mirror)
    weights = mirror.weights[mask]
    clipped = (shown[mask] >= CLIPPED).astype(np.float32)
    total = np.maximum(weights.sum(0), 1e-9)[:, None]
    return np.asarray(weights.T @ clipped / total > 0.5)


def _mean_of_rig(rig: SphereCounts) -> Float64[np.ndarray, "lights 3"]:
    radiance = seen_in_mirror(rig.weights["mirror"], rig.masks["mirror"], rig.mean_linear("mirror"))
    mask = rig.masks["diffuse"]
    rendered = (rig.weights["diffuse"][mask] @ radiance).sum(0)
    filmed = rig.mean_linear("diffuse")[mask].sum(0)
    scaled: np.ndarray = radiance * (filmed / np.maximum(rendered, _DARKEST))
    return scaled


class _FilmedSphere(NamedTuple):
    """The masked pixels of one sphere of one rig.

    `part` and `total` are of the examples whose value is at most v / 255 at [..., v + 1]: how many
    of all they are, and the sum of their values over the number of all.
    """

    weights: Float32[np.ndarray, "pixels lights"]
    loss_weight: float  # of this sphere, times its rig's examples
    part: Float64[np.ndarray, "pixels 3 257"]
    total: Float64[np.ndarray, "pixels 3 257"]


def _filmed_spheres(
    rigs: Sequence[SphereCounts], loss_weights: Mapping[str, float]
) -> list[_FilmedSphere]:
    spheres = []
    for rig in rigs:
        for number, name in enumerate(SPHERES):
            mask = rig.masks[name]
            parts = rig.counts[number][mask] / rig.examples
            sums = parts * (np.arange(256) / 255)
            before = ((0, 0), (0, 0), (1, 0))
            part, total = (np.pad(values.cumsum(-1), before) for values in (parts, sums))
            weight = loss_weights[name] * rig.examples
            spheres.append(_FilmedSphere(rig.weights[name][mask], weight, part, total))
    return spheres


def _loss_and_gradient(
    spheres: Sequence[_FilmedSphere], q: Float64[np.ndarray, "lights 3"]
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
    """Mean |pixel - filmed| over the examples, for each pixel, and its slope."""
    at = np.clip(np.floor(pixel * 255).astype(int) + 1, 0, 256)[..., None]
    part, total = (np.take_along_axis(t, at, -1)[..., 0] for t in (sphere.part, sphere.total))
    slope = 2 * part - 1
    return pixel * slope + sphere.total[..., -1] - 2 * total, slope
