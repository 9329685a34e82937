"""Changes to light before it is used: turn, tint, scale, the main light apart, neutral.

Each is linear in radiance, so what is done to a sum of lights is done to each of them. Only which
pixels are the main light is not: that is found first, in the light as it came.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from deeplight import frames
from deeplight.camera_response import LUMINANCE
from deeplight.errors import ConfigError
from deeplight.frames import Rotation
from deeplight.harmonics import dominant_light_of_latlong
from deeplight.lamp import Lamp
from deeplight.lighting import Lighting
from deeplight.mappings import latlong, resample

MOST_STOPS = 30.0

Panorama = Float[np.ndarray, "height width 3"]


@dataclass(frozen=True)
class Edit:
    """What to change, in the order of the fields; left alone, nothing changes.

    Attributes:
        main_light: factor on the main light: 0 takes it out, 2 doubles it.
        main_light_to: direction to move the main light to (azimuth, elevation) in degrees; azimuth
            0 is straight ahead, positive to the right; its power stays.
        turn: yaw, pitch, roll in degrees to turn the light by, as `frames.world_from_camera` does:
            positive yaw moves light in front to the left, positive pitch raises it.
        tint: factor on red, green and blue.
        stops: brightness in doublings.
        neutral: share, 0 to 1, of even white light of the same luminous power mixed in.

    Examples:
        >>> grey = deeplight.Environment(np.full((64, 128, 3), 0.25, np.float32))
        >>> float(grey.edited(deeplight.Edit(stops=1.0)).radiance.mean())
        0.5
    """

    main_light: float = 1.0
    main_light_to: tuple[float, float] | None = None
    turn: tuple[float, float, float] = (0.0, 0.0, 0.0)
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)
    stops: float = 0.0
    neutral: float = 0.0

    def __post_init__(self) -> None:
        moved = self.main_light_to or (0.0, 0.0)
        numbers = (self.main_light, *moved, *self.turn, *self.tint, self.stops, self.neutral)
        rules = {
            "finite numbers": bool(np.isfinite(numbers).all()),
            "a main light of at least 0": self.main_light >= 0,
            "an elevation of -90 to 90 degrees": abs(moved[1]) <= 90,
            "a tint of at least 0": min(self.tint) >= 0,
            f"at most {MOST_STOPS:g} stops": abs(self.stops) <= MOST_STOPS,
            "a neutral share of 0 to 1": 0 <= self.neutral <= 1,
        }
        for expected, kept in rules.items():
            if not kept:
                raise ConfigError(expected, f"{self}", "correct the edit")

    @property
    def new_from_old(self) -> Rotation:
        """The turn as a map of directions."""
        yaw, pitch, roll = np.radians(self.turn)
        return frames.world_from_camera(yaw, pitch, roll)

    @property
    def of_what_is_left(self) -> "Edit":
        """What to do to a panorama whose lamps are edited apart, before white is mixed in."""
        return replace(self, main_light=1.0, main_light_to=None, neutral=0.0)


def edited(lighting: Lighting, edit: Edit) -> Lighting:
    """Lighting after `edit`; the same value where nothing is to change."""
    if edit == Edit():
        return lighting
    height = max(256, 8 * lighting.size)
    return Lighting.from_latlong(edited_latlong(lighting.latlong(height), edit), size=lighting.size)


def edited_latlong(radiance: Panorama, edit: Edit) -> Panorama:
    """A panorama after `edit`, at its own size."""
    if edit.main_light != 1 or edit.main_light_to is not None:
        radiance = _main_light_changed(radiance, edit)
    radiance = resample.turned_latlong(radiance, edit.new_from_old)
    radiance = radiance * (np.array(edit.tint, np.float32) * np.float32(2.0**edit.stops))
    return with_neutral(radiance, edit.neutral)


def edited_lamps(lamps: Sequence[Lamp], edit: Edit) -> tuple[Lamp, ...]:
    """Lamps after `edit` but for its neutral share, the strongest first; black ones are left out.

    The first one is the main light.
    """
    main = lamps[0].scaled(edit.main_light)
    if edit.main_light_to is not None:
        main = replace(main, direction=direction_of(*edit.main_light_to))
    factor = np.array(edit.tint) * 2.0**edit.stops
    lit = [lamp.turned(edit.new_from_old).scaled(factor) for lamp in (main, *lamps[1:])]
    lit.sort(key=lambda lamp: -lamp.luminous_flux)
    return tuple(lamp for lamp in lit if lamp.flux.any())


def with_neutral(radiance: Panorama, share: float) -> Panorama:
    """Mix in even white light of the panorama's own luminous power; 1 leaves nothing else."""
    weights = latlong.solid_angles(*radiance.shape[:2]) / (4 * np.pi)
    mean = ((radiance @ LUMINANCE) * weights).sum()
    return (radiance * (1 - share) + share * mean).astype(np.float32) if share else radiance


def direction_of(azimuth_deg: float, elevation_deg: float) -> Float[np.ndarray, "3"]:
    """Unit direction in the camera frame; azimuth 0 is the view, positive to the right."""
    azimuth, elevation = np.radians((azimuth_deg, elevation_deg))
    across = np.cos(elevation)
    return np.array([across * np.sin(azimuth), np.sin(elevation), -across * np.cos(azimuth)])


def _main_light_changed(radiance: Panorama, edit: Edit) -> Panorama:
    light, excess = dominant_light_of_latlong(radiance)
    rest = np.maximum(radiance - excess, 0)
    if edit.main_light_to is not None:
        to = direction_of(*edit.main_light_to)
        excess = resample.turned_latlong(
            excess, frames.shortest_turn(light.direction.astype(float), to)
        )
    return (rest + edit.main_light * excess).astype(np.float32)
