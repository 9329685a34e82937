"""Photographs as measurements: linear values at the file's full bit depth."""

from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from jaxtyping import Float32

from deeplight.camera_response import decode
from deeplight.errors import ImageFileError
from deeplight.io.boundary import reads
from deeplight.io.exif import upright
from deeplight.io.image_file import first_bytes, opened, write_image
from deeplight.io.photo_decoders import MAX_PHOTO_PIXELS, checked_facts
from deeplight.io.radiance import is_floating_point, orientation_of, read_radiance

PHOTOGRAPH_SUFFIXES = frozenset(".bmp .exr .hdr .jpeg .jpg .png .tif .tiff .webp".split())


@reads
def read_photograph(path: Path | str, gamma: float) -> Float32[np.ndarray, "height width 3"]:
    """Read linear values, 1.0 = the largest an integer file can hold; upright.

    Integers of 8 or 16 bits are decoded as x^gamma; floating-point files are linear already.

    Raises:
        OSError: there is no such file, it is a folder, or reading it is not permitted.
        ImageFileError: not an image, damaged, too large, or holding NaN or infinity.
    """
    path = Path(path)
    checked_facts(path, first_bytes(path))  # libpng reports damage on stderr otherwise
    with opened(path, MAX_PHOTO_PIXELS) as file:
        values = read_radiance(file, path, MAX_PHOTO_PIXELS)
        turned = upright(values, orientation_of(file, path))
        if not is_floating_point(file) and gamma != 1:
            turned = decode(turned, gamma)
        return np.ascontiguousarray(turned, np.float32)


def write_photograph(path: Path | str, values: Float32[np.ndarray, "height width 3"]) -> None:
    """Write linear values: .exr as they are in 32 bits, .png clipped to 0..1 in 16 bits.

    Raises:
        OSError: the file cannot be written.
        ImageFileError: another suffix.
    """
    path = Path(path)
    if path.suffix not in (".exr", ".png"):
        raise ImageFileError("a name ending in .exr or .png", f"{path}", "rename the output")
    height, width, _ = values.shape
    exact = path.suffix == ".exr"
    spec = oiio.ImageSpec(width, height, 3, oiio.FLOAT if exact else oiio.UINT16)
    pixels = values if exact else np.floor(np.clip(values, 0, 1) * 65535 + 0.5).astype(np.uint16)
    write_image(path, spec, pixels)
