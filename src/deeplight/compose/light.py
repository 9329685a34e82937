"""The light to render with, from a file."""

from pathlib import Path

import numpy as np
from jaxtyping import Float32

from deeplight.errors import ImageFileError
from deeplight.io.image_file import opened
from deeplight.io.lighting_file import LATLONG_HEIGHT, VIEW_U, load_lighting
from deeplight.io.radiance import read_hdr
from deeplight.mappings.resample import shrink_latlong

MAX_HEIGHT = 512


def environment(path: Path) -> Float32[np.ndarray, "height width 3"]:
    """Read light as a latlong whose centre is the photo's view: a .json of ours, or a panorama.

    A panorama keeps its own detail, up to 512 rows: a sun stays as sharp as it is. One that was
    turned for a tool is turned back; a foreign one's centre column is taken as the view and its
    unit as the camera's white.

    Raises:
        OSError: there is no such file.
        ImageFileError: no light in it, or no full panorama.
    """
    if path.suffix.lower() == ".json":
        return load_lighting(path).latlong(LATLONG_HEIGHT)
    radiance = read_hdr(path)
    height, width, _ = radiance.shape
    if width != 2 * height:
        got = f"{path} of {width} x {height}"
        raise ImageFileError("a panorama twice as wide as high", got, "give the full sphere")
    with opened(path, max_pixels=10**9) as file:
        view_u = float(file.spec().get_float_attribute(VIEW_U, 0.5))
    radiance = np.roll(radiance, round((0.5 - view_u) * width), axis=1)
    if height > MAX_HEIGHT:
        radiance = shrink_latlong(radiance, MAX_HEIGHT)
    radiance = np.maximum(radiance, 0)
    if not radiance.max() > 0:
        raise ImageFileError("a panorama with light in it", f"{path}, all black", "replace it")
    return radiance
