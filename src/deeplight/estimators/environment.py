"""One photo's environment: the photo where the camera looked, the network elsewhere, and lamps."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from jaxtyping import Float32, UInt8

from deeplight.environment import Environment
from deeplight.errors import ConfigError
from deeplight.estimators.continuation import continued
from deeplight.estimators.fill import Chosen, Fill, chosen, detailed
from deeplight.estimators.lamps import find_lamps
from deeplight.estimators.network import NETWORK_SIDE, Estimate
from deeplight.estimators.projection import ImagePlane, project_photo
from deeplight.estimators.surroundings import (
    MAP_ROWS,
    adapted,
    enlarged,
    resized,
    smooth_map,
)
from deeplight.estimators.tilt import tilt_of_estimate
from deeplight.io.tilt import Tilt
from deeplight.lamp import Lamp, add_lamps
from deeplight.lighting import Lighting
from deeplight.lobe import concentration_of
from deeplight.mappings import latlong

HEIGHT = 256
"""Rows of an environment unless another number is asked for."""
PIXELS_PER_ROW = 3.5
"""Of the photo's longer side, for each row of the environment: twice what its texels need."""
HEIGHTS = (64, 2048)
"""The fewest and the most; a number between them must be a multiple of 2, for quarter turns."""

ITSELF = "the photo itself"
"""Whose detail is shown where the photo does not look, by default."""

_SHOWN = 0.5  # of the texel that a lamp's middle falls into


@dataclass(frozen=True, eq=False)
class SceneLight:
    """A scene's light in the parts that renderers take: a panorama and lamps.

    Attributes:
        rest: the panorama without the lamps, linear, camera frame.
        lamps: compact lights, the strongest first; not in `rest`.
        seen: 0 to 1, how much of a texel the photo shows; elsewhere the light is estimated.
        detail_of: whose detail was made up where nothing is seen, `ITSELF` or a place of the
            library; None if none was.
        tilt: the camera's, as far as it is known.
    """

    rest: Float32[np.ndarray, "height width 3"]
    lamps: tuple[Lamp, ...]
    seen: Float32[np.ndarray, "height width"]
    detail_of: str | None = None
    tilt: Tilt | None = None

    @cached_property
    def environment(self) -> Environment:
        """Everything in one panorama, each lamp at its place and size."""
        whole = self.rest.copy()
        add_lamps(whole, self.lamps)
        return Environment(whole, self.seen, known_lamps=self.lamps)

    def softened(self, radius_rad: float) -> Self:
        """The same light with its lamps as glows of about this radius: what is known of lamps
        whose direction may be off by so much.

        A surface that faces a lamp is as bright as before: a glow's edges fall on it aslant, so
        the glow has more flux than the lamp had, 1.27 times at 55 degrees. Lamps that the photo
        shows, and wider ones, stay; no glow falls into the photo.
        """
        size = self.seen.shape
        directions, solid_angle = latlong.directions(*size), latlong.solid_angles(*size)
        rest, kept = self.rest.copy(), []
        for lamp in self.lamps:
            shown = latlong.nearest(self.seen, lamp.direction[None])[0] > _SHOWN
            if shown or lamp.angular_radius_rad >= radius_rad:
                kept.append(lamp)
                continue
            cosine = directions @ lamp.direction.astype(np.float32)
            glow = np.exp(np.float32(concentration_of(radius_rad)) * (cosine - 1))
            glow *= 1 - self.seen
            facing = float((glow * np.maximum(cosine, 0) * solid_angle).sum())
            radiance = (lamp.irradiance / facing).astype(np.float32)
            rest += glow[..., None] * radiance
        return replace(self, rest=rest, lamps=tuple(kept))


def scene_light(
    estimate: Estimate,
    height: int = HEIGHT,
    fill: Fill | None = "auto",
    tilt: Tilt | None = None,
) -> SceneLight:
    """Put a photo into the light that was estimated from it.

    Args:
        estimate: of `NetworkEstimator.explain`.
        height: rows of the panorama, 64 to 2048.
        fill: what to show where the photo does not look; see `estimators.fill`.
        tilt: the camera's; left out, that of `tilt_of_estimate`.

    Raises:
        ConfigError: another number of rows.
    """
    check_height(height)
    pixels, fov = estimate.photo.pixels, estimate.framing.vertical_fov_rad
    height_px, width_px, _ = pixels.shape
    plane = ImagePlane.centred(height_px, width_px, fov)
    if tilt is None:
        tilt, _ = tilt_of_estimate(estimate)
    filling = chosen(fill, estimate.heads)
    return assemble(estimate.lighting, pixels, plane, height, estimate.lamps, filling, tilt)


def pixels_for(height: int) -> int:
    """Pixels along a photo's longer side that an environment of `height` rows needs."""
    return max(round(PIXELS_PER_ROW * height), NETWORK_SIDE)


def check_height(height: int) -> None:
    """Raise ConfigError unless an environment can have this number of rows."""
    fewest, most = HEIGHTS
    if not fewest <= height <= most or height % 2:
        expected = f"an even number of rows from {fewest} to {most}"
        raise ConfigError(expected, f"{height}", "correct --height")


def assemble(
    lighting: Lighting,
    pixels: UInt8[np.ndarray, "rows columns 3"],
    plane: ImagePlane,
    height: int = HEIGHT,
    lamps: Sequence[Lamp] = (),
    fill: Chosen | None = "photo",
    tilt: Tilt | None = None,
) -> SceneLight:
    """Put a photo that fills `plane` into a light estimated from it.

    Where the camera looked the photo's own pixels stand, its tone curve undone, and clipped ones
    have at least the estimate's radiance. Elsewhere the light is the estimate's, next to the photo
    brought to what that shows at its edge. What stands out of the estimate becomes compact lights.

    Args:
        lighting: the estimate, camera frame.
        pixels: upright, gamma-encoded.
        plane: where they lie before the camera.
        height: rows of the panorama.
        lamps: the network's own, which the estimate holds.
        fill: what to show where the photo does not look; see `estimators.fill`.
        tilt: the camera's; without it the photo does not go on.
    """
    photo = project_photo(pixels, plane, height)
    found = find_lamps(lighting, photo, lamps)
    smooth = around = smooth_map(found.rest.radiance, min(MAP_ROWS, height))
    place = None
    if fill is not None and tilt is not None:
        around, place = continued(around, photo, tilt), ITSELF
    around = adapted(around, photo.pixels, plane)
    if fill is not None and fill != "photo":
        level = np.eye(3) if tilt is None else tilt.level_from_camera
        around, place = detailed(around, photo, level, fill)
    rest = resized(around, height)
    box = photo.box
    known, clipped = photo.radiance[box] + found.areas[box], photo.clipped[box]
    if clipped.any():
        least = enlarged(smooth, height, box[0])[:, box[1]]
        known += clipped * np.maximum(least - photo.radiance[box], 0)
    rest[box] += (known - rest[box]) * photo.seen[box][..., None]
    return SceneLight(rest, found.lamps, photo.seen, place, tilt)
