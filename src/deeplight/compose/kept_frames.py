"""Composed frames of a video kept on the disk until it is whole, so that a killed run goes on.

Only the part of a frame that the objects change is kept; the rest is the video's own. Fusing light
and following the surface are repeated, which costs little next to rendering.
"""

from io import BytesIO
from pathlib import Path

import numpy as np
from jaxtyping import UInt8
from PIL import Image

from deeplight.compose.composite import Composite
from deeplight.errors import ImageFileError
from deeplight.io.atomic import fitted, replacing
from deeplight.io.boundary import reading
from deeplight.io.kept_folder import KeptFolder


class KeptFrames(KeptFolder):
    """A folder next to the video that is being written, gone when that is done.

    Args:
        out: the video.
        key: what the frames are made of; those of another key are thrown away.

    Raises:
        OSError: the folder cannot be made or read.
    """

    def __init__(self, out: Path, key: bytes) -> None:
        super().__init__(out.with_name(f".{fitted(out.name)}.frames"), key)

    def find(
        self, number: int, plate: UInt8[np.ndarray, "height width 3"]
    ) -> UInt8[np.ndarray, "height width 3"] | None:
        """A frame that was composed before, over its own pixels; None where there is none whole."""
        for path in self.folder.glob(f"{number:06d}_*.png"):
            _, left, top = path.stem.split("_")
            try:
                with reading(path), Image.open(path) as picture:
                    part = np.asarray(picture.convert("RGB"))
            except (OSError, ImageFileError):  # the machine stopped while it was written
                return None
            result = np.array(plate)
            result[int(top) : int(top) + len(part), int(left) : int(left) + part.shape[1]] = part
            return result
        return None

    def keep_frame(self, number: int, made: Composite) -> None:
        """Write what changed in a frame, whole or not at all."""
        left, top, right, bottom = made.layers.crop
        if right <= left or bottom <= top:
            return
        buffer = BytesIO()
        part = np.ascontiguousarray(made.pixels[top:bottom, left:right])
        Image.fromarray(part).save(buffer, "PNG", compress_level=1)
        with replacing(self.folder / f"{number:06d}_{left}_{top}.png") as temporary:
            temporary.write_bytes(buffer.getvalue())
