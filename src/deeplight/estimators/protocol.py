"""What estimates light, and what it may be given."""

from pathlib import Path
from typing import Any, Protocol, cast

import numpy as np
from jaxtyping import Float32
from PIL import Image, ImageOps

from deeplight.errors import ImageFileError, ShapeError
from deeplight.io.photos import MIN_SIDE, Photo, read_photo
from deeplight.lighting import Lighting

PhotoLike = Photo | Path | str | np.ndarray | Image.Image
"""A photo: read already, a file, upright RGB pixels (uint8 or float in [0, 1]), or Pillow's."""


class Estimator(Protocol):
    """Anything that gives the light of a photo: the network, and each baseline."""

    @property
    def name(self) -> str:
        """What tables call it."""

    def estimate(self, photo: PhotoLike) -> Lighting:
        """Estimate the light of one photo of any size, in the photo's camera frame."""

    def estimate_inputs(
        self, inputs: Float32[np.ndarray, "batch 3 height width"]
    ) -> Float32[np.ndarray, "batch size size 3"]:
        """Give ln radiance for pictures already brought to the trained view and to [-0.5, 0.5]."""


def as_photo(photo: PhotoLike) -> Photo:
    """Bring whatever was given to an upright 8-bit RGB `Photo`.

    Raises:
        OSError: there is no such file, it is a folder, or reading it is not permitted.
        ImageFileError: the file is not a usable photo.
        ShapeError: the pixels are no RGB picture of a usable size, type and range.
    """
    if isinstance(photo, Photo):
        return photo
    if isinstance(photo, str | Path):
        return read_photo(photo)
    if isinstance(photo, Image.Image):
        return Photo(_checked(_pixels_of_pillow(photo)))
    return Photo(_checked(photo))


def _pixels_of_pillow(picture: Image.Image) -> np.ndarray:
    try:
        # Pillow's lazily read files fail here, and for a damaged one with an OSError.
        return np.asarray(ImageOps.exif_transpose(picture).convert("RGB"))
    except (OSError, SyntaxError, ValueError) as error:
        got = f"a Pillow image that fails: {error}"
        raise ImageFileError("a complete image", got, "check the file it came from") from error


def _checked(pixels: np.ndarray) -> np.ndarray:
    """Check pixels made in memory; 8-bit ones are passed on as they are."""
    if pixels.ndim != 3 or pixels.shape[2] != 3 or min(pixels.shape[:2]) < MIN_SIDE:
        expected = f"RGB pixels of shape (height, width, 3), each side {MIN_SIDE} or more"
        raise ShapeError(expected, f"shape {pixels.shape}", "convert the photo first")
    if pixels.dtype == np.uint8:
        return pixels
    in_range = np.issubdtype(pixels.dtype, np.floating) and pixels.min() >= 0 and pixels.max() <= 1
    if not in_range:  # NaN compares false and ends here too
        got = f"{pixels.dtype} outside it" if pixels.dtype.kind == "f" else f"{pixels.dtype}"
        raise ShapeError("uint8 pixels or floats in [0, 1]", got, "encode the photo first")
    return cast("np.ndarray[Any, Any]", np.floor(pixels * 255 + 0.5).astype(np.uint8))
