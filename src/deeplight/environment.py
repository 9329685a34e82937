"""Environment: light from all directions at its own resolution, which is what people use.

`Lighting`, the 32 x 32 mirror ball, is what the network gives.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, Self

import numpy as np
from jaxtyping import Float

from deeplight import frames
from deeplight.camera_response import LUMINANCE
from deeplight.edit import Edit, edited_lamps, edited_latlong, with_neutral
from deeplight.errors import ShapeError
from deeplight.frames import Rotation
from deeplight.harmonics import DominantLight, dominant_light_of_latlong
from deeplight.lamp import Lamp, draw_lamps
from deeplight.lighting import Lighting
from deeplight.mappings import latlong, layouts, resample

MOST_NEGATIVE = 0.01
"""Share of the power that may be negative: the ringing that some published panoramas carry."""

MOST_LIGHTS = 3
LARGEST_LAMP_RAD = 0.2
"""A light after the main one counts as one if it is at most this large,"""
LEAST_SHARE = 0.03
"""and has at least this share of the luminous power that is left."""
_NOTHING = 1e-6  # a share of the power that is rounding
_BALL_ROWS = 128  # of a panorama without its main light: as fine as the ball's pixels

Frame = Literal["camera", "level", "file"]
"""camera: the view is -Z; level: the same with +Y against gravity; file: as it was stored."""
Unit = Literal["camera_white", "file"]
"""camera_white: 1.0 is where a pixel of the photo just saturates; file: as it was stored."""


@dataclass(frozen=True, eq=False)
class Environment:
    """Light from all directions at its own resolution.

    Attributes:
        radiance: latlong, linear, centre column = the view (-Z), right of it +X, top row +Y. What
            little is negative becomes 0. Read-only.
        seen: how much of each direction the pixels of a photo showed, 0 to 1; None where no photo
            is involved, as in a measured panorama. Read-only.
        frame: what the axes are tied to.
        unit: what radiance 1.0 is.
        known_lamps: the compact lights that `radiance` holds, the strongest first, where it was
            made of them, as an estimate is; None where nobody says, and they are looked for.

    Raises:
        ShapeError: not twice as wide as high, black, not finite, more than ringing is negative,
            or `seen` of another size or range.

    Examples:
        >>> room = np.full((64, 128, 3), 0.1, np.float32)
        >>> room[10, 96] = 200.0  # a lamp, right of the view and up
        >>> deeplight.Environment(room).main_light.direction.round(2)
        array([0.49, 0.87, 0.01], dtype=float32)
    """

    radiance: Float[np.ndarray, "height width 3"]
    seen: Float[np.ndarray, "height width"] | None = None
    frame: Frame = "camera"
    unit: Unit = "camera_white"
    known_lamps: tuple[Lamp, ...] | None = None

    def __post_init__(self) -> None:
        radiance = _checked(np.asarray(self.radiance, np.float32))
        radiance.setflags(write=False)
        object.__setattr__(self, "radiance", radiance)
        if self.seen is None:
            return
        seen = np.array(self.seen, np.float32)
        if seen.shape != radiance.shape[:2] or not ((seen >= 0) & (seen <= 1)).all():
            expected = f"seen of shape {radiance.shape[:2]} from 0 to 1"
            raise ShapeError(expected, f"{seen.shape} or values outside", "give one per texel")
        seen.setflags(write=False)
        object.__setattr__(self, "seen", seen)

    @classmethod
    def from_lighting(cls, lighting: Lighting, height: int = 256) -> Self:
        """The light of a mirror ball, smooth, `height` rows high."""
        return cls(lighting.latlong(height))

    @property
    def height(self) -> int:
        """Rows of the panorama."""
        return len(self.radiance)

    def edited(self, edit: Edit) -> Self:
        """The same light after `edit`; `seen` and the lamps turn with it."""
        if edit == Edit():
            return self
        with np.errstate(over="ignore"):  # too bright is refused like any infinity
            if not self.known_lamps:
                seen = self._seen_turned(edit.new_from_old)
                return replace(self, radiance=edited_latlong(self.radiance, edit), seen=seen)
            lamps = edited_lamps(self.known_lamps, edit)
            rest = edited_latlong(self.ambient, edit.of_what_is_left)
            whole = self._of_parts(rest, lamps, edit.new_from_old)
            white = with_neutral(whole.radiance, edit.neutral)
            kept = tuple(lamp.scaled(1 - edit.neutral) for lamp in lamps if edit.neutral < 1)
            return replace(whole, radiance=white, known_lamps=kept)

    def turned(self, new_from_old: Rotation) -> Self:
        """The same light in a frame turned by `new_from_old`; exact for whole columns of yaw."""
        if not self.known_lamps:
            radiance = resample.turned_latlong(self.radiance, new_from_old)
            return replace(self, radiance=radiance, seen=self._seen_turned(new_from_old))
        rest = resample.turned_latlong(self.ambient, new_from_old)
        lamps = tuple(lamp.turned(new_from_old) for lamp in self.known_lamps)
        return self._of_parts(rest, lamps, new_from_old)

    def _of_parts(
        self, rest: Float[np.ndarray, "height width 3"], lamps: tuple[Lamp, ...], turn: Rotation
    ) -> Self:
        """A panorama without lamps and lamps, as one, with this one's `seen` turned."""
        radiance = rest + draw_lamps(lamps, len(rest))
        return replace(self, radiance=radiance, seen=self._seen_turned(turn), known_lamps=lamps)

    def _seen_turned(self, new_from_old: Rotation) -> Float[np.ndarray, "height width"] | None:
        if self.seen is None:
            return None
        found: np.ndarray = resample.turned_latlong(self.seen[..., None], new_from_old)[..., 0]
        return found.clip(0, 1)

    def latlong(self, height: int | None = None) -> Float[np.ndarray, "height width 3"]:
        """The panorama, averaged or interpolated to a number of rows."""
        return self.radiance if height is None else layouts.resized(self.radiance, height)

    def cube(self, size: int = 128) -> Float[np.ndarray, "6 size size 3"]:
        """The light as the six cube faces of `cube.FACES`, each pixel an area average."""
        return layouts.cube_from_latlong(self.radiance, size)

    @cached_property
    def lighting(self) -> Lighting:
        """The same on the 32 x 32 mirror ball."""
        return Lighting.from_latlong(self.radiance)

    @cached_property
    def lamps(self) -> tuple[Lamp, ...]:
        """Its compact lights as even discs, the main light first: those that it was made of, else
        up to three that are found in it. With `ambient` they hold the whole power.
        """
        if self.known_lamps is not None:
            return self.known_lamps
        return tuple(
            Lamp(
                frames.normalised(light.direction.astype(np.float64)),
                self._power_of(excess),
                max(light.angular_radius_rad, np.pi / self.height / 2),
            )
            for light, excess in self._peeled
            if light.share > _NOTHING
        )

    @cached_property
    def ambient(self) -> Float[np.ndarray, "height width 3"]:
        """The panorama without `lamps`."""
        if self.known_lamps is not None:
            return self._without(self.known_lamps)
        rest = self.radiance
        for _, excess in self._peeled:
            rest = rest - excess
        return np.maximum(rest, 0)

    @cached_property
    def main_light(self) -> DominantLight:
        """The first of `lamps`; the brightest spot, however broad, where it was made of none."""
        if not self.known_lamps:
            return self._apart[0]
        lamp = self.known_lamps[0]
        rest = self.remainder
        if self.height > _BALL_ROWS and self.height % _BALL_ROWS == 0:
            rest = resample.shrink_latlong(rest, _BALL_ROWS)
        return DominantLight(
            lamp.direction.astype(np.float32),
            lamp.irradiance.astype(np.float32),
            lamp.luminous_flux / float(self._power_of(self.radiance) @ LUMINANCE),
            Lighting.from_latlong(rest),
            lamp.angular_radius_rad,
        )

    @cached_property
    def remainder(self) -> Float[np.ndarray, "height width 3"]:
        """The panorama without its main light."""
        if self.known_lamps:
            return self._without(self.known_lamps[:1])
        return np.maximum(self.radiance - self._apart[1], 0)

    def _without(self, lamps: tuple[Lamp, ...]) -> Float[np.ndarray, "height width 3"]:
        """The panorama less these discs. At another number of rows they were drawn a little
        otherwise, so what is clipped is made good: the power is the whole's less the lamps'.
        """
        rest = np.maximum(self.radiance - draw_lamps(lamps, self.height), 0)
        left = self._power_of(self.radiance) - sum(lamp.flux for lamp in lamps)
        factor = np.maximum(left, 0) / np.maximum(self._power_of(rest), 1e-30)
        return rest * factor.astype(np.float32)

    @staticmethod
    def _power_of(radiance: Float[np.ndarray, "height width 3"]) -> Float[np.ndarray, "3"]:
        weights = latlong.solid_angles(*radiance.shape[:2])
        power: np.ndarray = np.einsum("ij,ijc->c", weights, radiance)
        return power

    @cached_property
    def _peeled(self) -> list[tuple[DominantLight, Float[np.ndarray, "height width 3"]]]:
        """Each light with its own radiance, taken off one after the other."""
        found, rest = [self._apart], self.remainder
        while len(found) < MOST_LIGHTS:
            light, excess = dominant_light_of_latlong(rest)
            if light.angular_radius_rad > LARGEST_LAMP_RAD or light.share < LEAST_SHARE:
                break
            found.append((light, excess))
            rest = np.maximum(rest - excess, 0)
        return found

    @cached_property
    def _apart(self) -> tuple[DominantLight, Float[np.ndarray, "height width 3"]]:
        return dominant_light_of_latlong(self.radiance)

    def __repr__(self) -> str:
        known = "" if self.seen is None else f", {self.seen.mean():.0%} of it seen"
        size = f"{self.height} x {self.radiance.shape[1]}"
        return f"Environment({size}, {self.frame} frame, unit {self.unit}{known})"


def _checked(radiance: Float[np.ndarray, "height width 3"]) -> Float[np.ndarray, "height width 3"]:
    height, width = radiance.shape[:2]
    if width != 2 * height or height < 4:
        got = f"{width} x {height}"
        raise ShapeError("a panorama twice as wide as high", got, "crop it to the full sphere")
    least, most = float(radiance.min()), float(radiance.max())
    if not np.isfinite([least, most]).all():
        raise ShapeError("finite radiance", "NaN or infinite values", "repair the picture")
    if least == most == 0:
        raise ShapeError("light", "a panorama that is black all over", "give another one")
    if least >= 0:
        return radiance.copy()
    negative = -float(radiance[radiance < 0].sum(dtype=np.float64))
    power = float(np.abs(radiance).sum(dtype=np.float64))  # more than float32 may hold
    if negative > MOST_NEGATIVE * power:
        got = f"{negative / power:.0%} of it negative"
        raise ShapeError("radiance of at least 0", got, "give linear light, not a difference")
    return np.maximum(radiance, 0)
