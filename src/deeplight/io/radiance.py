"""Read and write radiance: OpenEXR, Radiance .hdr and floating-point TIFF."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
import OpenImageIO as oiio
from jaxtyping import Float32

from deeplight.errors import ImageFileError
from deeplight.io.boundary import reads
from deeplight.io.image_file import damaged, opened, write_image

MAX_HDR_PIXELS = 16_384 * 8_192
"""Largest panorama that is read: "16k", which takes 1.6 GB."""

FLOATING_POINT = ("half", "float", "double")
NO_METADATA: Mapping[str, str | int | float] = MappingProxyType({})


@reads
def read_hdr(path: Path | str) -> Float32[np.ndarray, "height width 3"]:
    """Read linear radiance as it is stored, in the file's own units, rows from the top.

    Every EXR compression and pixel type, Radiance .hdr and floating-point TIFF. A grey file gives
    three equal channels; alpha and other channels are left out. Of several parts the first is read.

    Negative values are kept: published panoramas carry negative ringing beside the sun, and it
    belongs to the energy there. Average to the working size first, then clamp at 0.

    Raises:
        OSError: there is no such file, it is a folder, or reading it is not permitted.
        ImageFileError: not an image, damaged, of integer pixels, too large, without colour
            channels, or holding NaN or infinity.
    """
    path = Path(path)
    with opened(path, MAX_HDR_PIXELS) as file:
        if not is_floating_point(file):
            expected = "linear radiance (.exr, .hdr or floating-point .tif)"
            got = f"{path} with {file.spec().format} pixels"
            raise ImageFileError(expected, got, "give an HDR image")
        return read_radiance(file, path)


def is_floating_point(file: oiio.ImageInput) -> bool:
    """Tell whether an opened file holds radiance rather than encoded pixels."""
    return str(file.spec().format) in FLOATING_POINT


def read_radiance(file: oiio.ImageInput, path: Path) -> Float32[np.ndarray, "height width 3"]:
    """Read the colour channels of an opened floating-point file; see `read_hdr`."""
    channels = _colour_channels(tuple(file.spec().channelnames), path)
    first, last = min(channels), max(channels)
    pixels = file.read_image(0, 0, first, last + 1, oiio.FLOAT)
    if pixels is None or file.has_error:
        raise damaged(path, file.geterror())
    radiance = pixels.reshape(pixels.shape[0], pixels.shape[1], -1)
    picked = [channel - first for channel in channels]
    if picked != list(range(radiance.shape[2])):
        radiance = np.ascontiguousarray(radiance[..., picked])
    bad = radiance.size - int(np.count_nonzero(np.isfinite(radiance)))
    if bad:
        got = f"{path} with {bad} values that are NaN or infinite"
        raise ImageFileError("finite radiance", got, "repair or replace the file")
    return radiance


def _colour_channels(names: tuple[str, ...], path: Path) -> tuple[int, int, int]:
    """Give the places of red, green and blue; three times the same one for a grey file."""
    layers = [name[: -len("R")] for name in names if name == "R" or name.endswith(".R")]
    for layer in sorted(layers, key=len):  # the plain R, G, B before any layer's
        wanted = [layer + colour for colour in "RGB"]
        if all(name in names for name in wanted):
            red, green, blue = (names.index(name) for name in wanted)
            return red, green, blue
    has_chroma = "RY" in names or "BY" in names
    for index, name in enumerate(names):
        if (name == "Y" and not has_chroma) or len(names) == 1:
            return index, index, index
    got = f"{path} with channels {', '.join(names[:8])}"
    raise ImageFileError("channels R, G, B or one grey channel", got, "export it as RGB")


def write_exr(
    path: Path | str,
    radiance: Float32[np.ndarray, "height width 3"],
    metadata: Mapping[str, str | int | float] = NO_METADATA,
    channels: Mapping[str, Float32[np.ndarray, "height width"]] | None = None,
) -> None:
    """Write 32-bit float RGB, zip-compressed, whole or not at all.

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
    _write(Path(path), values, header, ("R", "G", "B", *more))


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
) -> None:
    height, width, count = radiance.shape
    spec = oiio.ImageSpec(width, height, count, oiio.FLOAT)
    spec.channelnames = names
    for name, value in header.items():
        spec.attribute(name, value)
    write_image(path, spec, np.asarray(radiance, np.float32))
