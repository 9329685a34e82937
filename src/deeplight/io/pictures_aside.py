"""Pictures in a file without a name, for more of them than memory should hold."""

from dataclasses import dataclass
from math import prod
from pathlib import Path
from tempfile import TemporaryFile, gettempdir
from typing import Any

import numpy as np
from jaxtyping import UInt8


class PicturesAside:
    """A file that is gone with the process, however that ends.

    Args:
        folder: on whose disk; left out, where temporary files go.

    Raises:
        OSError: it cannot be made.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._file = TemporaryFile(dir=folder)  # noqa: SIM115 (as long as its pictures)
        self._where = f"temporary file in {folder or gettempdir()}"
        self._end = 0

    def add(self, pixels: UInt8[np.ndarray, "height width 3"]) -> "PictureAside":
        """Write a picture behind the others.

        Raises:
            OSError: the disk is full; it says which.
        """
        aside = PictureAside(self, self._end, (len(pixels), pixels.shape[1], 3))
        try:
            self._file.seek(self._end)
            self._file.write(np.ascontiguousarray(pixels).tobytes())
            self._file.flush()
        except OSError as error:  # a file without a name gives none to its errors
            error.filename = self._where
            raise
        self._end = self._file.tell()
        return aside

    def read(self, begin: int, size: int) -> bytearray:
        """Give bytes that were written."""
        content = bytearray(size)
        self._file.seek(begin)
        if self._file.readinto(content) != size:
            raise OSError("a temporary file was cut off: give it room on the disk")
        return content


@dataclass(frozen=True, eq=False)
class PictureAside:
    """One of them; `np.asarray` reads it again.

    Attributes:
        shape: of its pixels.
    """

    _file: PicturesAside
    _begin: int
    shape: tuple[int, int, int]

    def __array__(self, *_: Any, **__: Any) -> UInt8[np.ndarray, "height width 3"]:
        content = self._file.read(self._begin, prod(self.shape))
        return np.frombuffer(content, np.uint8).reshape(self.shape)
