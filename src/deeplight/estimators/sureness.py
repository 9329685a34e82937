"""How sure an estimate is, by the network's own word: scales that hold 68 % of such errors."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import degrees, log, radians
from typing import Any

from deeplight.estimators.confidence import FAINT_SHARE, UNITS, Word, warnings_of, words_of
from deeplight.estimators.network import Estimate
from deeplight.estimators.upright import likeliest_turn, turn_notes
from deeplight.harmonics import dominant_light

SOFTENED = 0.6
"""Radius of a lamp's glow in a composite, over the scale of its direction. On validation places 0.7
makes the error of shadows 4 to 8 % smaller than small lamps do, 1.0 takes 1 % more and leaves
objects flat."""
WIDEST_GLOW_RAD = radians(55)
LIMITS = {"direction": 60.0, "brightness": 0.9, "colour": 8.0}
"""Of the scales in degrees, stops and degrees: beyond them nothing is known."""


@dataclass(frozen=True)
class Sureness:
    """What a network with heads says of its own light; has what `Confidence` has.

    Attributes:
        heads: numbers by the names of `contract.HEADS`.
        has_direction: whether a main light stands out at all.
        warnings: what is wrong with the photo itself, in words.
    """

    heads: Mapping[str, float]
    has_direction: bool
    warnings: tuple[str, ...] = ()

    @property
    def scales(self) -> dict[str, float]:
        """Direction in degrees, brightness in stops, colour in degrees: two of three such photos
        are off by less."""
        return {
            "direction": degrees(self.heads["direction_scale"]),
            "brightness": self.heads["brightness_scale"] / log(2),
            "colour": degrees(self.heads["colour_scale"]),
        }

    @property
    def words(self) -> dict[str, Word]:
        """For direction, brightness and colour how well the estimate knows it."""
        vague = {name for name, scale in self.scales.items() if scale >= LIMITS[name]}
        vague |= {"direction"} if turn_notes(self.heads) else set()
        return words_of(vague, self.has_direction, self.warnings)

    @property
    def sentences(self) -> tuple[str, ...]:
        """What a user should know, a line each."""
        lines = []
        for name, word in self.words.items():
            scale = self.scales[name]
            error = f"{scale:.0f}" if scale >= 10 else f"{scale:.1f}"
            lines.append(f"{name}: {word} (two of three photos within {error} {UNITS[name]})")
        return self.warnings or (*turn_notes(self.heads), *lines)

    def record(self) -> dict[str, Any]:
        """The entry of the JSON file."""
        return {
            "words": self.words,
            "scale": self.scales | {"log_radiance": self.heads["log_radiance_scale"]},
            "meaning": "scale: 68 % of the errors on places that the network did not see are below "
            "it (direction in degrees, brightness in stops, colour in degrees, ln radiance in one "
            "direction)",
            "has_main_light": self.has_direction,
            "warnings": list(self.warnings),
        }


def sureness_of(estimate: Estimate) -> Sureness | None:
    """How sure the network says it is; None of a network without heads."""
    if not estimate.heads:
        return None
    has_direction = dominant_light(estimate.lighting).share > FAINT_SHARE
    return Sureness(estimate.heads, has_direction, warnings_of(estimate.photo.pixels))


def glow_rad(heads: Mapping[str, float]) -> float | None:
    """How wide a composite's lamps are best drawn, for what is known of their direction; None of a
    network that does not say."""
    if not heads:
        return None
    return min(SOFTENED * heads["direction_scale"], WIDEST_GLOW_RAD)


def soft_note(heads: Mapping[str, float]) -> str:
    """What to say of a composite whose lamps are drawn so."""
    within = degrees(heads["direction_scale"])
    return f"shadows are soft: the light may stand {within:.0f} degrees elsewhere (--sun places it)"


def camera_record(heads: Mapping[str, float]) -> dict[str, Any]:
    """The JSON entry of what the network says of the camera. Field of view and roll are left out:
    on test places they were no better than the best fixed numbers."""
    turn, chance = likeliest_turn(heads)
    return {
        "pitch_deg": {
            "value": degrees(heads["pitch_rad"]),
            "scale": degrees(heads["pitch_scale"]),
        },
        "upright_after_turning": {"degrees_clockwise": turn, "chance": chance},
    }
