"""From a bracket of photographs to the environment at the place of a mirror ball or 360 camera."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float, Float32

from deeplight.bracket.ball import Circle, find_circle, unwrapped
from deeplight.bracket.card import Corners, Rectangle, grey_patches, mean_colour
from deeplight.bracket.exposures import Exposure, exposure_amount, read_frames
from deeplight.bracket.merge import Merged, aligned, merged
from deeplight.bracket.response import Response, recovered
from deeplight.brdf import REFLECTIVITY
from deeplight.camera_response import LUMINANCE
from deeplight.environment import Environment, Unit
from deeplight.errors import ConfigError
from deeplight.mappings import latlong

ENOUGH_FRAMES = 3  # to recover a response from


@dataclass(frozen=True)
class ProbeSettings:
    """How photographs become an environment.

    Attributes:
        shows: a mirror ball, or all directions at once as 360 cameras give them.
        times: exposure of each photo, if EXIF does not say it.
        gamma: of the stored values; left out, the response is recovered from 3 or more 8-bit
            photos and is 2.2 for fewer. 1 is linear.
        align: shift frames onto each other.
        ball: x, y and radius in pixels; left out, it is looked for.
        focal_px: focal length in pixels; left out, EXIF's, else the ball is taken to be far away.
        reflectivity: of the ball.
        card: x, y, width, height of a grey card in pixels.
        card_reflectance: of it.
        chart: x and y of a 24-patch chart's corners: dark skin, bluish green, black, white.
        like: the photo for which this is the true light; 1.0 is then its camera's white.
    """

    shows: Literal["mirror-ball", "panorama"] = "mirror-ball"
    times: tuple[float, ...] = ()
    gamma: float | None = None
    align: bool = False
    ball: tuple[float, float, float] | None = None
    focal_px: float | None = None
    reflectivity: float = REFLECTIVITY["mirror"]
    card: Rectangle | None = None
    card_reflectance: float = 0.18
    chart: Corners = ()
    like: Path | None = None

    def __post_init__(self) -> None:
        if not 0 < self.reflectivity <= 1 or not 0 < self.card_reflectance <= 1:
            got = f"{self.reflectivity} and {self.card_reflectance}"
            raise ConfigError("reflectances over 0, up to 1", got, "correct them")
        if self.gamma is not None and not 0.2 <= self.gamma <= 5:
            raise ConfigError("a gamma of 0.2 to 5", f"{self.gamma}", "correct it")


@dataclass(frozen=True, eq=False)
class Probe:
    """The measured light and how it was found.

    Attributes:
        facts: sentences to read.
        ball: where the ball was.
        picture: the merged picture, linear.
    """

    environment: Environment
    picture: Float32[np.ndarray, "height width 3"]
    ball: Circle | None = None
    facts: list[str] = field(default_factory=list)


def measure(paths: Sequence[Path], settings: ProbeSettings) -> Probe:
    """Merge, scale and unwrap a bracket.

    Raises:
        OSError, ImageFileError: a photo cannot be read, or says nothing of its exposure.
        ConfigError: times, frames, ball, card or chart that cannot be, in one line.
    """
    frames = aligned(read_frames(paths, settings.times), settings.align)
    response = _response(frames, settings)
    found = merged(frames, response)
    facts = [_exposures(frames), f"response: {response.name}", *_limits(found)]
    scale, unit, fact = _scale(found, frames, settings)
    facts.append(fact)
    picture = (found.radiance * scale).astype(np.float32)
    if settings.shows == "panorama":
        return Probe(Environment(_whole(picture), unit=unit), picture, None, facts)
    middle = frames[len(frames) // 2].pixels
    circle = Circle(*settings.ball) if settings.ball else find_circle(middle)
    focal = settings.focal_px or frames[0].focal_px
    radiance, seen = unwrapped(picture, circle, focal)
    facts.append(_ball_fact(circle, focal, seen))
    environment = Environment(radiance / np.float32(settings.reflectivity), seen, unit=unit)
    return Probe(environment, picture, circle, facts)


def _response(frames: Sequence[Exposure], settings: ProbeSettings) -> Response:
    if settings.chart:
        return recovered(frames, grey_patches(frames, settings.chart))
    if frames[0].linear:
        return Response.gamma(1.0)
    if settings.gamma is not None or len(frames) < ENOUGH_FRAMES:
        return Response.gamma(settings.gamma or 2.2)
    return recovered(frames)


def _scale(
    found: Merged, frames: Sequence[Exposure], settings: ProbeSettings
) -> tuple[Float[np.ndarray, "3"], Unit, str]:
    """Factor of each channel, the unit that it gives, and a sentence on it.

    The card makes its own colour neutral. The photo of `like` sets the unit; without one the card
    does: 1.0 is then a white card in its place; without either it is the middle exposure's white.
    """
    gain = np.ones(3)
    if settings.card is not None:
        colour = mean_colour(found.radiance, settings.card)
        gain = float(colour @ LUMINANCE) / colour
    if settings.like is not None:
        amount = exposure_amount(settings.like)
        return gain * amount, "camera_white", f"unit: the white of {settings.like.name}"
    if settings.card is not None:
        brightness = float(colour @ LUMINANCE)
        fact = "unit: a white card where the grey one is"
        return gain * settings.card_reflectance / brightness, "file", fact
    middle = frames[len(frames) // 2]
    return gain * middle.amount, "file", f"unit: the white of {middle.path.name}"


def _whole(picture: Float32[np.ndarray, "height width 3"]) -> np.ndarray:
    height, width, _ = picture.shape
    if width != 2 * height:
        got = f"{width} x {height}"
        raise ConfigError("a panorama twice as wide as high", got, "give --shows mirror-ball")
    return picture


def _exposures(frames: Sequence[Exposure]) -> str:
    span = np.log2(frames[-1].amount / frames[0].amount)
    return f"{len(frames)} exposures over {span:.1f} stops"


def _limits(found: Merged) -> list[str]:
    facts = []
    if found.clipped:
        facts.append(
            f"{found.clipped:.3%} white in the shortest exposure: that light is brighter than "
            "written; add shorter exposures"
        )
    if found.dark > 0.01:
        facts.append(f"{found.dark:.1%} black in the longest exposure: add longer ones")
    return facts


def _ball_fact(
    circle: Circle, focal: float | None, seen: Float32[np.ndarray, "height width"]
) -> str:
    weight = latlong.solid_angles(*seen.shape)
    share = float(np.average(seen, weights=weight))
    place = f"ball at {circle.x:.1f} {circle.y:.1f}, radius {circle.radius:.1f} pixels"
    lens = "far away" if focal is None else f"focal length {focal:.0f} pixels"
    return f"{place} ({lens}); {share:.1%} of all directions seen"
