"""Compact lights: a lamp or the sun as a disc with a direction, a size, a power and a colour.

On a panorama such a light is a few pixels that hold much of the power; apart from it, it is what
every renderer draws crisp shadows from. Drawn and taken out here so that no power is lost and none
is counted twice.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from jaxtyping import Float

from deeplight import frames
from deeplight.camera_response import LUMINANCE
from deeplight.errors import ShapeError
from deeplight.frames import Rotation
from deeplight.mappings import latlong

SUN_ANGULAR_RADIUS_RAD = float(np.radians(0.2666))  # mean over the year
_SAMPLES = 8  # along each side of a texel that a disc's edge crosses

Panorama = Float[np.ndarray, "height width 3"]


@dataclass(frozen=True, eq=False)
class Lamp:
    """An even disc of light, infinitely far away.

    Attributes:
        direction: unit vector towards its centre, camera frame.
        flux: RGB radiance integrated over its solid angle, in camera white times sr.
        angular_radius_rad: of the disc, above 0 and at most a quarter turn.

    Raises:
        ShapeError: another shape, a direction that is no unit vector, negative or infinite flux.
    """

    direction: Float[np.ndarray, "3"]
    flux: Float[np.ndarray, "3"]
    angular_radius_rad: float

    def __post_init__(self) -> None:
        for name in ("direction", "flux"):
            own = np.array(getattr(self, name), np.float64)
            # Of three numbers Python's own arithmetic takes a tenth of numpy's time.
            if own.shape != (3,) or not all(map(math.isfinite, own.tolist())):
                raise ShapeError(f"three finite numbers as {name}", f"{own}", "correct the lamp")
            own.setflags(write=False)
            object.__setattr__(self, name, own)
        if abs(math.hypot(*self.direction.tolist()) - 1) > 1e-4 or min(self.flux.tolist()) < 0:
            got = f"direction {self.direction}, flux {self.flux}"
            raise ShapeError("a unit direction and a flux of at least 0", got, "correct the lamp")
        if not 0 < self.angular_radius_rad <= np.pi / 2:
            got = f"{self.angular_radius_rad:g} rad"
            raise ShapeError("an angular radius of 0 to 90 degrees", got, "correct the lamp")

    @property
    def solid_angle(self) -> float:
        """Of the disc, in sr."""
        return float(4 * np.pi * np.sin(self.angular_radius_rad / 2) ** 2)

    @property
    def radiance(self) -> Float[np.ndarray, "3"]:
        """Of the disc, the same all over it."""
        return self.flux / self.solid_angle

    @property
    def irradiance(self) -> Float[np.ndarray, "3"]:
        """RGB on a surface that faces it: pi sin^2(r) times its radiance."""
        return self.radiance * (np.pi * np.sin(self.angular_radius_rad) ** 2)

    @property
    def colour(self) -> Float[np.ndarray, "3"]:
        """Its flux with the largest channel at 1; white where there is no light."""
        largest = self.flux.max()
        return self.flux / largest if largest > 0 else np.ones(3)

    @property
    def luminous_flux(self) -> float:
        """Its flux by luminance: what lamps are compared by."""
        return float(self.flux @ LUMINANCE)

    def turned(self, new_from_old: Rotation) -> Self:
        """The same lamp in a frame turned by `new_from_old`."""
        direction = frames.normalised(frames.turned(self.direction, new_from_old))
        return type(self)(direction, self.flux, self.angular_radius_rad)

    def scaled(self, factor: float | Float[np.ndarray, "3"]) -> Self:
        """The same lamp with its flux times a number, or one number per channel."""
        return type(self)(self.direction, self.flux * factor, self.angular_radius_rad)


def draw_lamps(lamps: Sequence[Lamp], height: int) -> Panorama:
    """Radiance of lamps alone as a latlong of `height` x 2 `height`.

    Each texel holds the part of the disc that it covers, and the whole is brought to the lamp's
    flux exactly. A disc smaller than a texel becomes that texel.
    """
    result = np.zeros((height, 2 * height, 3), np.float32)
    add_lamps(result, lamps)
    return result


def in_their_middle(lamps: Sequence[Lamp]) -> Lamp:
    """Lamps as one: all their flux in their mean direction, as wide as the widest."""
    middle = np.sum([lamp.luminous_flux * lamp.direction for lamp in lamps], axis=0)
    flux = np.sum([lamp.flux for lamp in lamps], axis=0)
    return Lamp(frames.normalised(middle), flux, max(lamp.angular_radius_rad for lamp in lamps))


def add_lamps(panorama: Panorama, lamps: Sequence[Lamp]) -> None:
    """Draw lamps into a latlong, in place; see `draw_lamps`."""
    height, width, _ = panorama.shape
    solid_angle = latlong.solid_angles(height, width)
    for lamp in lamps:
        rows, columns, cover = _coverage(lamp, height)
        area = float((cover * solid_angle[rows, columns]).sum())
        radiance = (lamp.flux / area).astype(np.float32)
        panorama[rows, columns] += cover[:, None].astype(np.float32) * radiance


def _coverage(lamp: Lamp, height: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows, columns and covered part (0 to 1) of the texels that a lamp's disc touches."""
    width, texel = 2 * height, np.pi / height
    reach = min(lamp.angular_radius_rad + 1.5 * texel, np.pi)
    middle = float(np.arccos(np.clip(lamp.direction[1], -1, 1)))
    top, end = int((middle - reach) / texel) - 1, int((middle + reach) / texel) + 2
    band = latlong.directions(height, width)[max(top, 0) : end]
    rows, columns = np.nonzero(band @ lamp.direction.astype(np.float32) > np.cos(reach))
    rows += max(top, 0)
    steps = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    # Sines and cosines once for each row and each column.
    own_rows, row = np.unique(rows, return_inverse=True)
    own_columns, column = np.unique(columns, return_inverse=True)
    theta = (own_rows[:, None] + steps) * texel
    phi = (own_columns[:, None] + steps) * texel - np.pi
    x, y, z = lamp.direction
    across = (x * np.sin(phi) - z * np.cos(phi))[column]
    cosine = np.sin(theta)[row][:, :, None] * across[:, None, :]
    cosine += (np.cos(theta) * y)[row][:, :, None]
    cover = (cosine > np.cos(lamp.angular_radius_rad)).mean((1, 2))
    if not cover.any():  # smaller than the samples' spacing: all of it in the texel it lies in
        row, column = latlong.position(lamp.direction[None], height, width)
        at = min(max(round(float(row[0])), 0), height - 1), round(float(column[0])) % width
        return np.array([at[0]]), np.array([at[1]]), np.ones(1)
    touched = cover > 0
    return rows[touched], columns[touched], cover[touched]
