"""One photo's environment: the photo where the camera looked, the network elsewhere, and lamps."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, UInt8

from deeplight.estimate.lamps import excess_of, find_lamps
from deeplight.estimate.projection import ImagePlane, project_photo
from deeplight.estimate.surroundings import adapted, smooth_map
from deeplight.lamp import Lamp, draw_lamps
from deeplight.lighting import Lighting

HEIGHT = 256
"""Rows of an environment unless another number is asked for."""
HEIGHTS = (64, 2048)
"""The fewest and the most."""


@dataclass(frozen=True, eq=False)
class SceneLight:
    """A scene's light in the parts that a renderer takes: a panorama and lamps.

    Attributes:
        rest: the panorama without the lamps, linear, camera frame.
        lamps: compact lights, the strongest first; not in `rest`.
        seen: 0 to 1, how much of a texel the photo shows; elsewhere the light is estimated.
    """

    rest: Float32[np.ndarray, "height width 3"]
    lamps: tuple[Lamp, ...]
    seen: Float32[np.ndarray, "height width"]

    @property
    def radiance(self) -> Float32[np.ndarray, "height width 3"]:
        """The panorama with the lamps in it, each at its size."""
        return self.rest + draw_lamps(self.lamps, len(self.rest))


def assemble(
    lighting: Lighting,
    pixels: UInt8[np.ndarray, "rows columns 3"],
    plane: ImagePlane,
    height: int = HEIGHT,
) -> SceneLight:
    """Put a photo into the light that a network estimates from it.

    Where the camera looked the photo's own pixels stand, its tone curve undone, and clipped ones
    have at least the estimate's radiance. Elsewhere the light is the estimate's, next to the photo
    brought to what it shows at its edge. What stands out of the estimate becomes compact lights.

    Args:
        lighting: the network's estimate.
        pixels: the photo, upright, gamma-encoded.
        plane: where the photo lies before the camera.
        height: rows of the panorama.
    """
    photo = project_photo(pixels, plane, height)
    excess = excess_of(lighting)
    found = find_lamps(excess, photo)
    around = adapted(smooth_map(excess.rest.radiance, height), pixels, plane)
    shown = photo.radiance + photo.clipped * np.maximum(around - photo.radiance, 0)
    if found.areas is not None:
        shown += found.areas
    rest = around + (shown - around) * photo.seen[..., None]
    return SceneLight(rest, found.lamps, photo.seen)
