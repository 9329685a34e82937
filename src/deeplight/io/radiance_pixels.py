"""Radiance .hdr files brought to what OpenImageIO reads: RGBE, a short header, no old run lengths.

Radiance's own programs go on reading what they wrote in the eighties, where a pixel (1, 1, 1, n)
repeats the one before it n times; and each program adds a line to the header.
"""

import re
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from deeplight.io.radiance_header import MAX_HEADER

_MOST_LINES = 64  # of a header, which OpenImageIO reads to its hundredth line
_PIXELS = re.compile(rb"\r?\n\r?\n([-+][XY] +(\d{1,6}) +[-+][XY] +(\d{1,6}) *\r?\n)")


def plain_hdr(path: Path, max_pixels: int) -> bytes | None:
    """Give the same stored pixels as a file that OpenImageIO reads; None if it reads this one.

    What the header says of them stays in the file itself: see `read_radiance_header`.

    Raises:
        OSError: the file cannot be read.
    """
    with path.open("rb") as file:
        start = file.read(MAX_HEADER)
    found = _PIXELS.search(start)
    if found is None or b"FORMAT=" not in start[: found.start()]:
        return None
    rows, columns = int(found[2]), int(found[3])
    if not 0 < rows * columns <= max_pixels:
        return None
    head, at = start[: found.start()], found.end()
    is_today = start[at : at + 4] == b"\2\2" + columns.to_bytes(3)[1:]
    pixels = None
    if not is_today and path.stat().st_size - at < 4 * rows * columns:
        pixels = _repeated(path.read_bytes()[at:], rows * columns)
    if pixels is None:
        if b"32-bit_rle_xyze" not in head and head.count(b"\n") < _MOST_LINES:
            return None
        pixels = path.read_bytes()[at:]
    return b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + found[1] + pixels


def _repeated(stored: bytes, count: int) -> bytes | None:
    """Write out old run lengths; None if that does not give so much as `count` pixels."""
    pixels: UInt8[np.ndarray, "n 4"] = np.frombuffer(stored[: len(stored) // 4 * 4], np.uint8)
    pixels = pixels.reshape(-1, 4)
    is_run = (pixels[:, :3] == 1).all(axis=1)
    if not is_run.any() or is_run[0]:
        return None
    number = np.arange(len(pixels), dtype=np.int32)
    own = np.maximum.accumulate(np.where(is_run, 0, number))  # the pixel that a run repeats
    place = number - own - 1  # of one run behind another, which counts 256 times as much
    if place.max() > 2:
        return None
    runs = pixels[:, 3].astype(np.int64) << (8 * np.maximum(place, 0))
    times = np.where(is_run, runs, 1)
    return pixels[np.repeat(own, times)].tobytes() if times.sum() == count else None
