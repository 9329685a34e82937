"""Read and write radiance: OpenEXR, Radiance .hdr and floating-point TIFF."""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType

import numpy as np
import OpenImageIO as oiio
from jaxtyping import Float32

from deeplight.errors import ImageFileError
from deeplight.io.boundary import reads
from deeplight.io.colour import (
    ACES_AP0,
    ACES_AP1,
    ADOBE_RGB,
    BT709,
    BT2020,
    CIE_XYZ,
    CIE_XYZ_D65,
    DISPLAY_P3,
    Matrix,
    bt709_from_primaries,
)
from deeplight.io.colour_profile import bt709_from_icc
from deeplight.io.exif import upright
from deeplight.io.image_file import check_size, damaged, opened, write_image
from deeplight.io.radiance_header import read_radiance_header
from deeplight.io.radiance_layers import choose_layer

MAX_HDR_PIXELS = 16_384 * 8_192
"""Largest panorama that is read: "16k", which takes 1.6 GB."""

FLOATING_POINT = ("half", "float", "double")
NAMED_SPACES = {  # of colorInteropID, by the Color Interop Forum, and names of other programs
    "lin_ap0_scene": ACES_AP0,
    "lin_ap1_scene": ACES_AP1,
    "lin_adobergb_scene": ADOBE_RGB,
    "lin_ciexyzd65_scene": CIE_XYZ_D65,
    "lin_p3d65_scene": DISPLAY_P3,
    "lin_rec2020_scene": BT2020,
    "aces2065-1": ACES_AP0,
    "acescg": ACES_AP1,
}
NO_METADATA: Mapping[str, str | int | float] = MappingProxyType({})


@reads
def read_hdr(path: Path | str, layer: str | None = None) -> Float32[np.ndarray, "height width 3"]:
    """Read linear radiance upright, in the file's own units and sRGB's primaries.

    Every EXR compression and pixel type, Radiance .hdr and floating-point TIFF. What the file says
    is obeyed: orientation and all eight resolution lines, EXPOSURE, COLORCORR and GAMMA, PRIMARIES
    and chromaticities (white stays white), the display window (the data window is cropped to it,
    and black where it does not reach). Of several layers `radiance_layers` chooses, or asks.
    A grey file gives three equal channels; alpha and other channels are left out.

    Negative values are kept: published panoramas carry negative ringing next to the sun, and it
    belongs to the energy there. Average to the working size first, then clamp at 0.

    Args:
        path: the file.
        layer: of an EXR, by the name that the error of a file with several gives; left out,
            the one that is the light.

    Raises:
        OSError: there is no such file, it is a folder, or reading it is not permitted.
        ImageFileError: not an image, damaged, of integer pixels, too large, without colour
            channels, deep, with several layers that could be the light, or holding NaN or infinity.
    """
    path = Path(path)
    with opened(path, MAX_HDR_PIXELS) as file:
        if not is_floating_point(file):
            raise _integer(path, str(file.spec().format))
        radiance = read_radiance(file, path, MAX_HDR_PIXELS, layer)
        return np.ascontiguousarray(upright(radiance, orientation_of(file, path)))


def _integer(path: Path, kind: str) -> ImageFileError:
    expected = "linear radiance (.exr, .hdr or floating-point .tif)"
    return ImageFileError(expected, f"{path} with {kind} pixels", "give an HDR image")


def is_floating_point(file: oiio.ImageInput) -> bool:
    """Return whether an opened file holds radiance rather than encoded pixels.

    An EXR does, though its first part may be numbers of objects: see `read_radiance`.
    """
    return file.format_name() == "openexr" or str(file.spec().format) in FLOATING_POINT


def counts_down(spec: oiio.ImageSpec) -> bool:
    """Whether 0 is white and nobody has turned it round; OpenImageIO does so with 8 bits alone."""
    white_is_zero = spec.get_int_attribute("tiff:PhotometricInterpretation", 1) == 0
    return white_is_zero and spec.nchannels == 1 and str(spec.format) != "uint8"


def orientation_of(file: oiio.ImageInput, path: Path) -> int:
    """EXIF's number for how the stored rows of an opened file are turned upright."""
    if file.format_name() == "hdr":  # of which OpenImageIO swaps two
        return read_radiance_header(path).orientation
    return int(file.spec().get_int_attribute("Orientation", 1))


def read_radiance(
    file: oiio.ImageInput, path: Path, max_pixels: int, layer: str | None = None
) -> Float32[np.ndarray, "height width 3"]:
    """Read the light of an opened file as `read_hdr` does, but for its orientation.

    Of an integer file the values, 1.0 the largest it can hold.
    """
    channels = choose_layer(file, path, layer).channels
    spec = file.spec()
    kinds = [str(kind) for kind in spec.channelformats] or [str(spec.format)] * spec.nchannels
    whole = [kinds[channel] for channel in channels if kinds[channel] not in FLOATING_POINT]
    if file.format_name() == "openexr" and whole:
        raise _integer(path, whole[0])
    check_size(path, spec.width, spec.height, max_pixels)
    check_size(path, spec.full_width, spec.full_height, max_pixels)
    first, last = min(channels), max(channels)
    pixels = file.read_image(file.current_subimage(), 0, first, last + 1, oiio.FLOAT)
    if pixels is None or file.has_error:
        raise damaged(path, file.geterror())
    radiance = pixels.reshape(pixels.shape[0], pixels.shape[1], -1)
    if counts_down(spec):
        radiance = 1 - radiance
    picked = [channel - first for channel in channels]
    if picked != list(range(radiance.shape[2])):
        radiance = np.ascontiguousarray(radiance[..., picked])
    if file.format_name() == "openexr":
        radiance = _displayed(radiance, spec)
    bad = radiance.size - int(np.count_nonzero(np.isfinite(radiance)))
    if bad:
        got = f"{path} with {bad} values that are NaN or infinite"
        raise ImageFileError("finite radiance", got, "repair or replace the file")
    return _in_srgb(radiance, file, path) if is_floating_point(file) else radiance


def _displayed(
    pixels: Float32[np.ndarray, "data_height data_width 3"], spec: oiio.ImageSpec
) -> Float32[np.ndarray, "height width 3"]:
    """The display window of an EXR, which is the picture; the data window may be any other."""
    window = (spec.full_x, spec.full_y, spec.full_width, spec.full_height)
    if window == (spec.x, spec.y, spec.width, spec.height) or min(window[2:]) <= 0:
        return pixels
    result = np.zeros((spec.full_height, spec.full_width, 3), np.float32)
    top, left = spec.y - spec.full_y, spec.x - spec.full_x
    bottom = min(top + spec.height, spec.full_height)
    right = min(left + spec.width, spec.full_width)
    if bottom > max(top, 0) and right > max(left, 0):
        inside = pixels[max(-top, 0) : bottom - top, max(-left, 0) : right - left]
        result[max(top, 0) : bottom, max(left, 0) : right] = inside
    return result


def _in_srgb(
    radiance: Float32[np.ndarray, "height width 3"], file: oiio.ImageInput, path: Path
) -> Float32[np.ndarray, "height width 3"]:
    """Radiance with sRGB's primaries and without the factors that a .hdr's header names."""
    matrix = np.eye(3)
    if file.format_name() == "hdr":
        header = read_radiance_header(path)
        known = CIE_XYZ if header.is_xyz else header.primaries
        matrix = _matrix(known) / np.array(header.gain)
        if header.gamma != 1:
            radiance = np.maximum(radiance, 0) ** np.float32(header.gamma)
    elif file.format_name() == "openexr":
        known = file.spec().getattribute("chromaticities")
        matrix = _matrix(tuple(known) if known is not None else _named_space(file.spec()))
    elif (profile := file.spec().getattribute("ICCProfile")) is not None:
        with suppress(ValueError):  # a damaged profile does not make light unreadable
            matrix = bt709_from_icc(np.asarray(profile, np.uint8).tobytes())
    if np.abs(matrix - np.eye(3)).max() < 2e-3:  # primaries of three digits
        return radiance
    return radiance @ matrix.T.astype(np.float32)


def _named_space(spec: oiio.ImageSpec) -> tuple[float, ...] | None:
    """The primaries of a space that an EXR calls by its name."""
    names = (spec.get_string_attribute(key) for key in ("colorInteropID", "oiio:ColorSpace"))
    return next(
        (NAMED_SPACES[name.lower()] for name in names if name.lower() in NAMED_SPACES), None
    )


def _matrix(chromaticities: tuple[float, ...] | None) -> Matrix:
    try:
        return np.eye(3) if chromaticities is None else bt709_from_primaries(chromaticities)
    except ValueError:
        return np.eye(3)


def write_exr(
    path: Path | str,
    radiance: Float32[np.ndarray, "height width 3"],
    metadata: Mapping[str, str | int | float] = NO_METADATA,
    channels: Mapping[str, Float32[np.ndarray, "height width"]] | None = None,
) -> None:
    """Write 32-bit float RGB, zip-compressed, whole or not at all; its primaries are Rec. 709's.

    Float rather than half: half ends at 65504, and the sun does not.

    Args:
        radiance: linear; written as it is.
        metadata: header attributes by name. A reader sees str, int or float again.
        channels: more channels by name, after R, G and B.

    Raises:
        OSError: the file cannot be written.
    """
    header = {"compression": "zip", **metadata}
    more = channels or {}
    values = np.dstack([radiance, *more.values()]) if more else radiance
    _write(Path(path), values, header, ("R", "G", "B", *more), BT709)


def write_hdr(path: Path | str, radiance: Float32[np.ndarray, "height width 3"]) -> None:
    """Write Radiance RGBE, top row first, whole or not at all.

    The format has a shared exponent: values step by about 1 % of the pixel's largest channel,
    and negative ones, which it cannot hold, become 0.

    Raises:
        OSError: the file cannot be written.
    """
    _write(Path(path), np.maximum(radiance, 0), {})


def _write(
    path: Path,
    radiance: Float32[np.ndarray, "height width channels"],
    header: Mapping[str, str | int | float],
    names: tuple[str, ...] = ("R", "G", "B"),
    chromaticities: tuple[float, ...] | None = None,
) -> None:
    height, width, count = radiance.shape
    spec = oiio.ImageSpec(width, height, count, oiio.FLOAT)
    spec.channelnames = names
    for name, value in header.items():
        spec.attribute(name, value)
    if chromaticities is not None:
        spec.attribute("chromaticities", "float[8]", chromaticities)
    write_image(path, spec, np.asarray(radiance, np.float32))
