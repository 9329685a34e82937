"""The light to hand over: a panorama in the camera frame, and what can be told of it."""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from jaxtyping import Float

from deeplight.edit import Edit, edited_latlong
from deeplight.errors import ShapeError
from deeplight.harmonics import DominantLight, dominant_light_of_latlong
from deeplight.lighting import Lighting

MOST_NEGATIVE = 0.01
"""Share of the power that may be negative: the ringing that some published panoramas carry."""


@dataclass(frozen=True, eq=False)
class Environment:
    """Light from all directions at its file's own resolution.

    Attributes:
        radiance: latlong, linear, centre column = the view (-Z); what little is negative becomes 0.

    Raises:
        ShapeError: not twice as wide as high, black, not finite, or more than ringing is negative.
    """

    radiance: Float[np.ndarray, "height width 3"]

    def __post_init__(self) -> None:
        radiance = np.asarray(self.radiance, np.float32)
        height, width = radiance.shape[:2]
        if width != 2 * height or height < 4:
            got = f"{width} x {height}"
            raise ShapeError("a panorama twice as wide as high", got, "crop it to the full sphere")
        if not np.isfinite(radiance).all():
            raise ShapeError("finite radiance", "NaN or infinite values", "repair the picture")
        negative = -float(radiance[radiance < 0].sum(dtype=np.float64))
        power = float(radiance.sum(dtype=np.float64)) + 2 * negative
        if negative > MOST_NEGATIVE * power:
            got = f"{negative / power:.0%} of it negative"
            raise ShapeError("radiance of at least 0", got, "give linear light, not a difference")
        if power == 0:
            raise ShapeError("light", "a panorama that is black all over", "give another one")
        object.__setattr__(self, "radiance", np.maximum(radiance, 0))

    def edited(self, edit: Edit) -> Self:
        """The same light after `edit`."""
        with np.errstate(over="ignore"):  # too bright is refused like any infinity
            return self if edit == Edit() else type(self)(edited_latlong(self.radiance, edit))

    @cached_property
    def lighting(self) -> Lighting:
        """The same on the 32 x 32 mirror ball."""
        return Lighting.from_latlong(self.radiance)

    @cached_property
    def main_light(self) -> DominantLight:
        """The dominant light, as fine as the panorama."""
        return self._apart[0]

    @cached_property
    def remainder(self) -> Float[np.ndarray, "height width 3"]:
        """The panorama without its main light."""
        return np.maximum(self.radiance - self._apart[1], 0)

    @cached_property
    def _apart(self) -> tuple[DominantLight, Float[np.ndarray, "height width 3"]]:
        return dominant_light_of_latlong(self.radiance)
