"""How sure an estimate is: how much the answers to the same photo, flipped and cropped, differ.

What a network does not know it answers by chance: another cut of the same scene then gets another
light. That answers agree does not make them right, so what is said is how far off the estimates
of such photos were where the truth is known (`benchmarks/confidence.py`).
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from jaxtyping import Float, UInt8

from deeplight.camera_response import LUMINANCE
from deeplight.estimators.look import Answer, seen_from_photo
from deeplight.estimators.network import Estimate, NetworkEstimator
from deeplight.harmonics import dominant_light
from deeplight.lighting import Lighting
from deeplight.preprocess import Framing, network_input

Word = Literal["roughly known", "not known"]

UNITS = {"direction": "degrees", "brightness": "stops", "colour": "degrees"}
"""Of errors of what is said to be known or not."""
DIRECTION_DEG = 18.0
BRIGHTNESS_STOPS = 0.17
"""From this spread on direction and brightness are not known."""
TYPICAL_ERRORS = {
    "direction": {"roughly known": 35.0, "not known": 50.0},  # degrees
    "brightness": {"roughly known": 0.4, "not known": 0.6},  # stops
    "colour": {"roughly known": 2.3, "not known": 2.3},  # degrees: its spread says nothing
}
"""Half of the validation photos of that kind are off by less: `benchmarks/confidence.py`."""
FAINT_SHARE = 0.05
"""A main light with less of the power has no direction worth the name."""
_CROPS = ((0.9, 0.0), (0.9, -0.08), (0.9, 0.08))
"""Size of the cuts and how far they lie to the right, as parts of the trained view."""
_BLANK_LEVELS = 3.0  # standard deviation: less shows nothing


@dataclass(frozen=True)
class Confidence:
    """How far the answers to one photo, flipped and cropped, spread around the first.

    Attributes:
        direction_deg: mean angle between their main lights and the first's.
        brightness_stops: standard deviation of ln of the power, in doublings.
        colour_deg: mean angle between their colours and the first's.
        has_direction: whether a main light stands out at all.
        warnings: what is wrong with the photo itself, in words.
    """

    direction_deg: float
    brightness_stops: float
    colour_deg: float
    has_direction: bool
    warnings: tuple[str, ...] = ()

    @property
    def words(self) -> dict[str, Word]:
        """For direction, brightness and colour how well the estimate knows it."""
        vague = {"direction"} if self.direction_deg >= DIRECTION_DEG else set()
        vague |= {"brightness"} if self.brightness_stops >= BRIGHTNESS_STOPS else set()
        return words_of(vague, self.has_direction, self.warnings)

    @property
    def sentences(self) -> tuple[str, ...]:
        """What a user should know, a line each."""
        lines = []
        for name, word in self.words.items():
            error = f"{TYPICAL_ERRORS[name][word]:g} {UNITS[name]}"
            lines.append(f"{name}: {word} (half of such photos are within {error})")
        return self.warnings or tuple(lines)

    def record(self) -> dict[str, Any]:
        """The entry of the JSON file."""
        spread = {
            "direction_deg": self.direction_deg,
            "brightness_stops": self.brightness_stops,
            "colour_deg": self.colour_deg,
        }
        typical = {name: TYPICAL_ERRORS[name][word] for name, word in self.words.items()}
        return {
            "words": self.words,
            "typical_error": typical,
            "meaning": "typical_error: half of the validation photos whose answers spread as much "
            "are off by less (degrees, stops, degrees); spread: of the answers to the photo "
            "flipped and cropped, around the first",
            "spread": spread,
            "has_main_light": self.has_direction,
            "warnings": list(self.warnings),
        }


def confidence_of(estimator: NetworkEstimator, estimate: Estimate) -> Confidence:
    """Ask the network again with the photo flipped and cut a little smaller."""
    pixels, framing = estimate.photo.pixels, estimate.framing
    first = network_input(pixels, framing)
    inputs = [first[:, :, ::-1]]
    inputs += [network_input(pixels, _cut(framing, *crop)) for crop in _CROPS]
    answers = estimator.estimate_inputs(np.stack(inputs))
    turned = [seen_from_photo([Answer(answer)], [framing]) for answer in answers]
    others = [Lighting.from_log_radiance(answer.log_radiance) for answer in turned]
    return _spread(estimate.lighting, [others[0].mirrored(), *others[1:]], warnings_of(pixels))


def words_of(
    vague: Collection[str], has_direction: bool, warnings: Collection[str]
) -> dict[str, Word]:
    """The word for each of `UNITS`: of `vague`, of a direction where no main light stands out, and
    of everything where the photo is unfit, nothing is known."""
    return {
        name: "not known"
        if warnings or name in vague or (name == "direction" and not has_direction)
        else "roughly known"
        for name in UNITS
    }


def warnings_of(pixels: UInt8[np.ndarray, "height width 3"]) -> tuple[str, ...]:
    """What makes a photo unfit to estimate light from, in words."""
    small = pixels[:: max(1, len(pixels) // 64), :: max(1, pixels.shape[1] // 64)].astype(float)
    grey = small.mean(-1)
    if grey.std() < _BLANK_LEVELS:
        kind = "black" if grey.mean() < 16 else "white" if grey.mean() > 239 else "of one colour"
        return (f"the photo is {kind} all over: its light is a guess",)
    if np.percentile(grey, 90) < 16:
        return ("the photo is almost black: its light is a guess",)
    if np.percentile(grey, 10) > 250:
        return ("the photo is almost all clipped: its light is at least this bright",)
    return ()


def _cut(framing: Framing, size: float, right: float) -> Framing:
    """The framing of a smaller view, as if it were the trained one."""
    height, width = framing.bottom - framing.top, framing.right - framing.left
    down, across = height * (1 - size) / 2, width * (1 - size) / 2
    shift = right * width
    return replace(
        framing,
        top=framing.top + down,
        bottom=framing.bottom - down,
        left=framing.left + across + shift,
        right=framing.right - across + shift,
    )


def _spread(first: Lighting, others: Sequence[Lighting], warnings: tuple[str, ...]) -> Confidence:
    lights = [dominant_light(lighting) for lighting in (first, *others)]
    powers = np.stack([lighting.power() for lighting in (first, *others)])
    direction = [_angle_deg(lights[0].direction, light.direction) for light in lights[1:]]
    colour = [_angle_deg(powers[0], power) for power in powers[1:]]
    luminous = np.log2(np.maximum(powers @ LUMINANCE, 1e-12))
    return Confidence(
        float(np.mean(direction)),
        float(luminous.std()),
        float(np.mean(colour)),
        lights[0].share > FAINT_SHARE,
        warnings,
    )


def _angle_deg(one: Float[np.ndarray, "3"], other: Float[np.ndarray, "3"]) -> float:
    cosine = one @ other / max(float(np.linalg.norm(one) * np.linalg.norm(other)), 1e-12)
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))
