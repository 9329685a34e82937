"""Pictures of a mesh file, brought to a size that fits the memory."""

import io
from collections.abc import Callable, Hashable
from pathlib import Path

import numpy as np
from jaxtyping import UInt8
from PIL import Image

from deeplight.errors import ImageFileError

MAX_TEXTURE_PX = 8192
KEPT_TEXTURE_PX = 4096  # larger ones are reduced: Mitsuba keeps 12 bytes for each texel
KEPT_TEXELS = 128_000_000  # of all pictures of a file together
MAX_DECODED_PX = 600_000_000

Pixels = UInt8[np.ndarray, "height width 3"]


class Textures:
    """The pictures of one file, each decoded once.

    Args:
        path: the mesh file, for errors.
        count: textures that will be asked for; many are kept smaller.
    """

    def __init__(self, path: Path, count: int) -> None:
        self.path = path
        self._side = min(KEPT_TEXTURE_PX, int((KEPT_TEXELS / max(count, 1)) ** 0.5))
        self._kept: dict[Hashable, Pixels | None] = {}
        self._decoded = 0

    def pixels(self, key: Hashable, content: Callable[[], bytes | Image.Image]) -> Pixels | None:
        """Give a picture's pixels, sRGB; None if it is missing or cannot be read.

        Raises:
            ImageFileError: it is far too large, or no regular file.
        """
        if key not in self._kept:
            try:
                found = content()
                formats = ("PNG", "JPEG", "WEBP", "TIFF", "BMP", "TGA")
                if isinstance(found, bytes):
                    found = Image.open(io.BytesIO(found), formats=formats)
                self._kept[key] = self._reduced(found)
            except ImageFileError:
                raise
            except (Image.DecompressionBombError, MemoryError) as error:
                raise self._too_large("one of more") from error
            except Exception:  # Pillow's decoders raise errors of every kind
                self._kept[key] = None
        return self._kept[key]

    def _reduced(self, picture: Image.Image) -> Pixels:
        width, height = picture.size
        self._decoded += width * height
        if max(width, height) > MAX_TEXTURE_PX:
            raise self._too_large(f"one of {width} x {height}")
        if self._decoded > MAX_DECODED_PX:
            raise self._too_large(f"{self._decoded / 1e6:.0f} million pixels of them")
        return np.array(picture.convert("RGB").reduce(-(-max(width, height) // self._side)))

    def _too_large(self, got: str) -> ImageFileError:
        expected = f"textures of at most {MAX_TEXTURE_PX} pixels a side"
        return ImageFileError(expected, f"{self.path} with {got}", "make them smaller")
