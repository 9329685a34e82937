"""A phone's camera at work: metering, white balance, tone curve, lens, noise, compression.

Everything a video camera decides by itself, and imperfectly: the paper's training data is
automatically exposed and white-balanced video, "providing a prior to help disambiguate
color, reflectance, and illumination" (section 3.1). All constants here are our choice.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, UInt8

from deeplight.camera import TRAINED_VERTICAL_FOV_RAD
from deeplight.camera_response import GAMMA, LUMINANCE, encode

Colour = Float[np.ndarray, "3"]


@dataclass(frozen=True)
class Phone:
    """A camera preset: what differs between phones.

    Attributes:
        name: what examples call it.
        vertical_fov_rad: of the upright 9:16 video frame.
        gamma_spread: standard deviation of the tone curve's exponent around 2.2.
        max_contrast: strongest S-curve the image-dependent tone mapping adds.
        max_vignette: greatest loss of light in the frame's corners.
    """

    name: str
    vertical_fov_rad: float = TRAINED_VERTICAL_FOV_RAD
    gamma_spread: float = 0.06
    max_contrast: float = 0.15
    max_vignette: float = 0.20


PHONES = {
    phone.name: phone
    for phone in (
        Phone("paper"),
        Phone("wide", float(np.radians(73.0))),
        Phone("narrow", float(np.radians(58.0))),
        Phone("ideal", gamma_spread=0.0, max_contrast=0.0, max_vignette=0.0),
    )
}


@dataclass(frozen=True)
class CameraAutomatics:
    """How one take's automatics err, drawn once per take.

    Attributes:
        brightness: mean pixel value the meter aims at.
        bias_stops: exposure compensation.
        highlight_share: part of the picture the meter lets saturate.
        adaptation: share of the illuminant's colour that white balance removes.
        picture_share: how much of its estimate is the picture's average (grey world), the
            rest being the scene's illuminant. Pure grey world turns green rooms purple.
        tint: lasting error of white balance, as logarithms of the gains.
        speed: part of the way to the new setting that one frame goes.
        gamma, contrast, vignette: see `Phone`.
        noise: variance per unit of radiance of one sensor pixel.
        jpeg_quality: of the stored background.
    """

    brightness: float
    bias_stops: float
    highlight_share: float
    adaptation: float
    picture_share: float
    tint: tuple[float, float, float]
    speed: float
    gamma: float
    contrast: float
    vignette: float
    noise: float
    jpeg_quality: int


def draw_automatics(phone: Phone, rng: np.random.Generator) -> CameraAutomatics:
    """The automatics of one take."""
    return CameraAutomatics(
        brightness=rng.uniform(0.38, 0.50),
        bias_stops=rng.normal(0.0, 0.25),
        highlight_share=rng.uniform(0.04, 0.15),
        adaptation=rng.uniform(0.65, 0.98),
        picture_share=rng.uniform(0.1, 0.4),
        tint=tuple(rng.normal(0.0, (0.03, 0.015, 0.03)).tolist()),
        speed=rng.uniform(0.4, 0.9),
        gamma=rng.normal(GAMMA, phone.gamma_spread),
        contrast=rng.uniform(0.0, phone.max_contrast),
        vignette=rng.uniform(0.0, phone.max_vignette),
        noise=10 ** rng.uniform(-4.0, -2.5),
        jpeg_quality=int(rng.integers(88, 98)),
    )


@dataclass(frozen=True)
class Setting:
    """What the automatics have settled on: the gain of each colour channel."""

    log_gain: tuple[float, float, float]

    @property
    def gain(self) -> Colour:
        return np.exp(np.array(self.log_gain, np.float32))


def metered(
    pixels: Float[np.ndarray, "n 3"], illuminant: Colour, automatics: CameraAutomatics
) -> Setting:
    """The setting the automatics would choose for this picture alone.

    Args:
        pixels: scene radiance at places spread over the frame, spheres included; unbounded.
        illuminant: colour of the light that falls on things in the scene.
        automatics: how they err.
    """
    colour = np.log(_chromaticity(illuminant)) * (1 - automatics.picture_share)
    colour = colour + np.log(_chromaticity(_grey_world(pixels))) * automatics.picture_share
    log_balance = np.clip(-automatics.adaptation * colour, -1.0, 1.0) + np.array(automatics.tint)
    balanced = pixels * np.exp(log_balance)
    exposure = np.log(_exposure(balanced, automatics)) + automatics.bias_stops * np.log(2)
    return Setting(tuple((exposure + log_balance).tolist()))


def follow(previous: Setting | None, wanted: Setting, speed: float) -> Setting:
    """The next frame's setting: the camera moves part of the way towards what it wants."""
    if previous is None:
        return wanted
    old, new = np.array(previous.log_gain), np.array(wanted.log_gain)
    return replace(wanted, log_gain=tuple((old + speed * (new - old)).tolist()))


def develop(
    radiance: Float[np.ndarray, "height width 3"],
    gain: Float[np.ndarray, "*#shape"],
    automatics: CameraAutomatics,
    pixels_averaged: int,
    rng: np.random.Generator,
) -> UInt8[np.ndarray, "height width 3"]:
    """The 8-bit picture: gain, sensor noise, clip at white, gamma and tone curve.

    Args:
        radiance: scene radiance.
        gain: per colour channel, or per pixel with vignetting.
        automatics: of the take.
        pixels_averaged: sensor pixels behind each pixel of the result, which thin the noise.
        rng: source of the noise.
    """
    linear = radiance * gain
    deviation = np.sqrt(automatics.noise * np.clip(linear, 0.01, 1) / pixels_averaged)
    noisy = linear + rng.standard_normal(linear.shape, np.float32) * deviation
    pixel = encode(np.clip(noisy, 0, 1), automatics.gamma)
    pixel = pixel + automatics.contrast * pixel * (1 - pixel) * (2 * pixel - 1)
    return np.round(pixel * 255).astype(np.uint8)


def vignetting(
    row: Float[np.ndarray, "*#n"], column: Float[np.ndarray, "*#n"], automatics: CameraAutomatics
) -> Float[np.ndarray, "*n"]:
    """Share of light the lens passes at places (-1 to 1) of the full frame."""
    return 1 - automatics.vignette * (row * row + column * column) / 2


def _exposure(pixels: Float[np.ndarray, "n 3"], automatics: CameraAutomatics) -> float:
    """Gain that brings the mean pixel to the habit, short of blowing too much out."""
    luminance = pixels @ LUMINANCE
    low, high = -40.0, 40.0
    for _ in range(30):
        middle = (low + high) / 2
        shown = encode(np.minimum(luminance * np.exp(middle), 1))
        mean = np.add.reduce(shown) / len(shown)  # as .mean(), which takes as long as the rest
        low, high = (middle, high) if mean < automatics.brightness else (low, middle)
    white = np.quantile(pixels.max(axis=1), 1 - automatics.highlight_share)
    limit = np.log(2.0 / max(float(white), 1e-30))  # a stop over is let through
    return float(np.exp(min(low, limit)))


def _grey_world(pixels: Float[np.ndarray, "n 3"]) -> Colour:
    """Average colour of the picture, each pixel limited to a few times the mean."""
    mean: np.ndarray = np.minimum(pixels, 3 * pixels.mean()).mean(axis=0)
    return mean


def _chromaticity(colour: Colour) -> Colour:
    """Colour with its geometric mean at 1, so that taking it out leaves brightness alone."""
    safe = np.maximum(colour, 1e-3 * max(float(colour.max()), 1e-30))
    ratio: np.ndarray = safe / np.exp(np.log(safe).mean())
    return ratio
