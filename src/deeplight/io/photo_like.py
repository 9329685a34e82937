"""Anything that holds a photo as a `Photo`: the same picture gives the same pixels, whatever it is.

Files, bytes and Pillow's images go through `io.photos`, so that orientation, field of view,
transparency and colour are decided in one place.
"""

from dataclasses import replace
from functools import partial
from io import BufferedIOBase, RawIOBase
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, BinaryIO

import numpy as np
from jaxtyping import UInt8
from PIL import Image

from deeplight.errors import ImageFileError, InputError, ShapeError
from deeplight.io.photo_decoders import MIN_SIDE
from deeplight.io.photos import Photo, photo_of_pillow, read_photo

PhotoLike = Photo | Path | str | bytes | BinaryIO | np.ndarray | Image.Image
"""A photo: read already; a file's path, its bytes or an open file; Pillow's image; pixels, (height,
width), (height, width, 1), RGB or RGBA, uint8, uint16 or float in [0, 1], gamma-encoded; or a torch
tensor of such pixels, (channels, height, width)."""


def as_photo(photo: Any, max_side: int | None = None) -> Photo:
    """Bring a `PhotoLike` to an upright 8-bit RGB `Photo`.

    Args:
        photo: it.
        max_side: for files: enough pixels along the longer side; see `read_photo`.

    Raises:
        OSError: there is no such file, it is a folder, or reading it is not permitted.
        InputError: it is none of these, is damaged, or its pixels have no usable shape or range.
    """
    if isinstance(photo, Photo):
        return photo
    if isinstance(photo, str | Path):
        return read_photo(photo, max_side)
    if isinstance(photo, Image.Image):
        return photo_of_pillow(photo)
    if isinstance(photo, bytes | bytearray | memoryview):
        return _of_bytes(bytes(photo), max_side)
    if isinstance(photo, RawIOBase | BufferedIOBase) or hasattr(photo, "read"):
        content = photo.read()
        if not isinstance(content, bytes):
            raise _unusable("a file opened in binary mode", "text", 'open it with "rb"')
        return _of_bytes(content, max_side)
    if type(photo).__module__.split(".")[0] == "torch":
        photo = _of_tensor(photo)
    if isinstance(photo, np.ndarray):
        pixels = _checked(photo)
        # Transparency is laid over what files are laid over.
        return Photo(pixels) if pixels.shape[2] == 3 else photo_of_pillow(Image.fromarray(pixels))
    raise _unusable("a path, bytes, an open file, a Pillow image or pixels", _kind(photo))


def _of_bytes(content: bytes, max_side: int | None) -> Photo:
    """Read a file that is in memory; the readers know files by their content, not by their name."""
    with TemporaryDirectory(prefix="deeplight-") as folder:
        path = Path(folder) / "photo"
        path.write_bytes(content)
        return _nameless(path, partial(read_photo, max_side=max_side))


def _nameless(path: Path, read: Any) -> Photo:
    try:
        photo: Photo = read(path)
    except InputError as error:
        got = error.got.replace(str(path), "the picture")
        raise ImageFileError(error.expected, got, error.do) from error
    return replace(photo, source=None)


def _of_tensor(tensor: Any) -> np.ndarray:
    """Pixels of a torch tensor, (channels, height, width), in numpy's order."""
    pixels = np.asarray(tensor.detach().cpu().numpy())
    if pixels.ndim == 3 and pixels.shape[0] in (1, 3, 4):
        return pixels.transpose(1, 2, 0)
    if pixels.ndim == 2:
        return pixels
    do = "give one picture, channels first"
    raise ShapeError("a tensor (channels, height, width)", f"shape {pixels.shape}", do)


def _checked(pixels: np.ndarray) -> UInt8[np.ndarray, "height width channels"]:
    """8-bit RGB or RGBA of grey, RGB or RGBA pixels."""
    if pixels.ndim == 2:
        pixels = pixels[..., None]
    if pixels.ndim != 3 or pixels.shape[2] not in (1, 3, 4) or min(pixels.shape[:2]) < MIN_SIDE:
        expected = f"grey, RGB or RGBA pixels (height, width, channels), {MIN_SIDE} or more a side"
        raise ShapeError(expected, f"shape {pixels.shape}", "convert the photo first")
    eight_bit = _eight_bit(pixels)
    return np.repeat(eight_bit, 3, axis=2) if eight_bit.shape[2] == 1 else eight_bit


def _eight_bit(pixels: np.ndarray) -> UInt8[np.ndarray, "height width channels"]:
    if pixels.dtype == np.uint8:
        return pixels
    if pixels.dtype == np.uint16:
        pixels = pixels / np.float32(65535)
    in_range = pixels.dtype.kind == "f" and pixels.min() >= 0 and pixels.max() <= 1
    if not in_range:  # NaN compares false and ends here too
        got = f"{pixels.dtype}"
        if pixels.dtype.kind == "f":
            got += " outside it" if np.isfinite(pixels).all() else " with NaN or infinite values"
        expected = "uint8 or uint16 pixels, or floats in [0, 1]"
        raise ShapeError(expected, got, "encode the photo first")
    return np.floor(pixels * 255 + 0.5).astype(np.uint8)


def _kind(value: Any) -> str:
    if value is None:
        return "nothing (None)"
    name = type(value).__name__
    return f"{'an' if name[0] in 'aeiou' else 'a'} {name}"


def _unusable(expected: str, got: str, do: str = "give one of these") -> InputError:
    return InputError(expected, got, do)
