"""The shape in which the network draws a lamp on the mirror ball: a von Mises-Fisher lobe.

Radiance falls with exp(concentration (cos angle - 1)), the bell curve of directions. Unlike a
disc it is smooth, so a network can learn where it belongs. `Lamp` has the disc that is as widely
spread.
"""

from functools import lru_cache
from math import asin, sin, sqrt

import numpy as np
from jaxtyping import Float

from deeplight.lamp import Lamp
from deeplight.mappings import mirror_ball

LEAST_RADIANCE = 1e-6
"""Of a map where it is nothing but lamp: once its lobes are taken off, its logarithm is wanted."""
NEARNESS = 8.0
"""Of answers that become one: concentration of the lobe within which two lamps point alike, 0.5 at
24 degrees."""
TRUST = 8.0
"""Power of the agreement by which their flux is shared. 0 is the plain mean; chosen on validation
places, where 8 gives the brightest light the share it has in truth."""


def lobe_on_ball(lamp: Lamp, size: int = 32) -> Float[np.ndarray, "size size 3"]:
    """Radiance of a lamp on a mirror ball, as the network's map has it.

    Normalised over the ball's own pixels: radiance times solid angle sums to the lamp's flux for
    a lamp smaller than a pixel as well.
    """
    towards, solid_angle = lobe_grid(size)
    exponent = concentration_of(lamp.angular_radius_rad) * (towards @ lamp.direction)
    lobe = np.exp(exponent - exponent.max())
    radiance = lobe[:, None] / (lobe @ solid_angle) * lamp.flux
    return radiance.reshape(size, size, 3).astype(np.float32)


def concentration_of(angular_radius_rad: float) -> float:
    """Concentration of the lobe whose mean of 1 - cos angle is that of an even disc.

    It is sin^2(radius / 2) for the disc and 1 / concentration for the lobe, but for terms of
    exp(-2 concentration). 150 is a disc of 9 degrees' radius, 15 one of 30.
    """
    return 1 / sin(angular_radius_rad / 2) ** 2


def angular_radius_of(concentration: float) -> float:
    """Radius in rad of the disc that is as widely spread as the lobe; see `concentration_of`."""
    return 2 * asin(min(1.0, sqrt(1 / concentration)))


@lru_cache(maxsize=8)
def lobe_grid(
    size: int,
) -> tuple[Float[np.ndarray, "pixels 3"], Float[np.ndarray, " pixels"]]:
    """Mean direction of each pixel of a mirror ball, and its solid angle in sr; read-only.

    A mean of directions is shorter than 1 where a pixel spans many, as at the rim, and 0 off the
    ball.
    """
    directions, inside = mirror_ball.subpixels(size)
    count = np.maximum(inside.sum(1, keepdims=True), 1)
    towards = ((directions * inside[..., None]).sum(1) / count).astype(np.float32)
    solid_angle = mirror_ball.solid_angles(size).ravel().astype(np.float32)
    for array in (towards, solid_angle):
        array.setflags(write=False)
    return towards, solid_angle
