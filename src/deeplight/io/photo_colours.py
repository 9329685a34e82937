"""What the colours of a photo's file need to become sRGB, whoever decodes it."""

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
from PIL import Image

from deeplight.io.colour import (
    ADOBE_RGB,
    HDR_TRANSFERS,
    ColourSpace,
    bt709_from_primaries,
    from_cicp,
    from_gamma,
    power_curve,
)
from deeplight.io.colour_profile import LookUpProfile, from_icc
from deeplight.io.exif import exif_of_pillow

ADOBE = ColourSpace("Adobe RGB", bt709_from_primaries(ADOBE_RGB), power_curve(563 / 256))

_UNCALIBRATED = 0xFFFF  # EXIF's ColorSpace where it is not sRGB

Conversion = ColourSpace | LookUpProfile


def conversion_of(
    spec: oiio.ImageSpec, facts: dict[Any, Any], path: Path
) -> tuple[Conversion | None, tuple[str, ...]]:
    """What the colours need, by PNG's order: code points, profile, gamma; then EXIF's."""
    cicp = spec.getattribute("CICP")
    if cicp is not None:
        return from_cicp(int(cicp[0]), int(cicp[1]), bool(cicp[3])), ()
    profile = spec.getattribute("ICCProfile")
    if profile is not None:
        return colours_of(None, np.asarray(profile, np.uint8).tobytes())
    if ("gamma" in facts or "chromaticity" in facts) and "srgb" not in facts:
        gamma = float(facts.get("gamma", 1 / 2.2))  # primaries alone: sRGB's curve
        return from_gamma(gamma, *_chromaticities(facts)), ()
    if spec.get_int_attribute("Exif:ColorSpace") == _UNCALIBRATED:
        with Image.open(path) as picture:  # OpenImageIO leaves this entry out
            return (ADOBE if exif_of_pillow(picture.getexif).is_adobe_rgb else None), ()
    return None, ()


def _chromaticities(facts: dict[Any, Any]) -> tuple[tuple[float, ...], ...]:
    """PNG's cHRM as `io.colour` orders it, or nothing; Pillow has white first."""
    found = facts.get("chromaticity")
    return ((*found[2:8], *found[:2]),) if found else ()


def colours_of(
    cicp: tuple[int, int] | None, profile: bytes | None
) -> tuple[Conversion | None, tuple[str, ...]]:
    """What code points and an ICC profile ask for: the profile, but for HDR, which it cannot say.

    Encoders that are given a profile leave the code points at any default.
    """
    space = from_cicp(*cicp) if cicp else None
    if not profile or (space and space.is_radiance):
        return space, ()
    try:
        return from_icc(profile), ()
    except ValueError:
        return None, ("damaged colour profile: read as sRGB",)


def fitting(
    conversion: Conversion | None, is_grey: bool
) -> tuple[Conversion | None, tuple[str, ...]]:
    """The conversion if it is for RGB or grey, as the picture is; else none and a note."""
    modes = ("RGB", "L") if is_grey else ("RGB",)
    if not isinstance(conversion, LookUpProfile) or conversion.mode in modes:
        return conversion, ()
    return None, (f"colour profile '{conversion.name}' does not fit the picture: read as sRGB",)


def notes_on(conversion: Conversion | None, see_through: bool = False) -> tuple[str, ...]:
    """What was decided, for the user."""
    notes = ("transparent parts taken as mid-grey",) if see_through else ()
    if conversion is None:
        return notes
    if any(name in conversion.name.split() for name in HDR_TRANSFERS.values()):
        said = f"{conversion.name} picture, brought to SDR: reference white is 1.0"
    elif conversion.is_radiance:
        said = "linear picture: 1.0 taken as white"
    else:
        said = f"{conversion.name} converted to sRGB"
    return (said, *notes)


def is_encoded(file: oiio.ImageInput) -> bool:
    """Whether a floating-point TIFF holds encoded pixels: its profile has a curve, and none is > 1.

    darktable, RawTherapee and GIMP write such files; a bare one, or a linear profile, is linear.
    """
    profile = file.spec().getattribute("ICCProfile")
    if profile is None:
        return False
    try:
        space = from_icc(np.asarray(profile, np.uint8).tobytes())
    except ValueError:
        return False
    if space is not None and space.is_radiance:
        return False
    values = file.read_image(oiio.FLOAT)
    return values is not None and bool(values.max() <= 1)
