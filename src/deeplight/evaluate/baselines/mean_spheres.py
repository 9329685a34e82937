"""Baseline: the mean light of the training spheres, from 8-bit pictures alone."""

import numpy as np
from jaxtyping import Float64

from deeplight.evaluate.baselines.baseline import DARKEST, ConstantLighting
from deeplight.evaluate.baselines.training_pixels import RigPixels
from deeplight.lighting import LIGHTING_SIZE
from deeplight.reflectance import ReflectanceBasis


def mean_spheres(rigs: list[RigPixels]) -> ConstantLighting:
    """Give the mean mirror sphere as lighting, as bright as the mean diffuse sphere says.

    The light of a training example is not known, only its clipped spheres are. So the mean linear
    mirror sphere, divided by its reflectivity and turned to the camera frame, gives the
    directions, and each channel is scaled so that the diffuse sphere rendered in it has the energy
    of the mean diffuse sphere, which gives back the light that the mirror clipped.
    """
    examples = [rig.examples for rig in rigs]
    radiance = np.average([_of_rig(rig) for rig in rigs], axis=0, weights=examples)
    log_radiance = np.log(np.maximum(radiance, DARKEST))
    shape = (LIGHTING_SIZE, LIGHTING_SIZE, 3)
    return ConstantLighting("mean_spheres", log_radiance.reshape(shape).astype(np.float32))


def _of_rig(rig: RigPixels) -> Float64[np.ndarray, "lights 3"]:
    mirror, diffuse = rig.bases["mirror"], rig.bases["diffuse"]
    radiance = seen_in_mirror(mirror, rig.mean_linear("mirror"))
    mask = rig.mask("diffuse")
    rendered = (diffuse.weights[mask] @ radiance).sum(0)
    filmed = rig.mean_linear("diffuse")[mask].sum(0)
    scaled: np.ndarray = radiance * (filmed / np.maximum(rendered, DARKEST))
    return scaled


def seen_in_mirror(
    basis: ReflectanceBasis, filmed: Float64[np.ndarray, "pixels 3"]
) -> Float64[np.ndarray, "lights 3"]:
    """Give each direction the mean of the mirror pixels that show it, over the reflectivity.

    Directions behind the sphere, which no pixel shows whole, get the mean of the others.
    """
    mask = basis.view.mask().ravel()
    weights = basis.weights[mask].astype(np.float64)  # (pixels, lights)
    reflectivity = weights.sum(1).max()
    shown = weights.sum(0)
    seen = shown > 0
    total = weights.T @ filmed[mask] / reflectivity
    radiance = np.broadcast_to(total.sum(0) / shown.sum(), total.shape).copy()
    radiance[seen] = total[seen] / shown[seen, None]
    return radiance
