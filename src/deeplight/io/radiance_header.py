"""The text header of a Radiance .hdr: what its pixels have to be divided by, turned and made of.

Greg Ward, "Radiance File Formats"; OpenImageIO reads the pixels and leaves most of this alone.
"""

from dataclasses import dataclass
from math import isfinite
from pathlib import Path

import numpy as np

MAX_HEADER = 65_536
MAX_GAMMA = 10.0
STARTS = (b"#?RADIANCE", b"#?RGBE", b"#?")

_ORIENTATIONS = {  # EXIF's, of the resolution line: first row and first column of what is stored
    ("-Y", "+X"): 1,
    ("-Y", "-X"): 2,
    ("+Y", "-X"): 3,
    ("+Y", "+X"): 4,
    ("+X", "-Y"): 5,
    ("-X", "-Y"): 6,
    ("-X", "+Y"): 7,
    ("+X", "+Y"): 8,
}


@dataclass(frozen=True)
class RadianceHeader:
    """What a header says.

    Attributes:
        orientation: EXIF's number of the resolution line.
        gain: of red, green and blue, all EXPOSURE and COLORCORR lines together; pixels divided by
            it are radiance again.
        primaries: chromaticities of red, green, blue and white; None where it names none.
        is_xyz: pixels are CIE XYZ.
        gamma: pixels are radiance to the power of one over it.
    """

    orientation: int = 1
    gain: tuple[float, float, float] = (1.0, 1.0, 1.0)
    primaries: tuple[float, ...] | None = None
    is_xyz: bool = False
    gamma: float = 1.0


def read_radiance_header(path: Path) -> RadianceHeader:
    """Read the header; lines that make no sense count as missing, as Radiance's tools have it.

    Raises:
        OSError: the file cannot be read.
    """
    with path.open("rb") as file:
        text = file.read(MAX_HEADER).decode("latin-1")
    head, _, rest = text.replace("\r\n", "\n").partition("\n\n")
    gain, primaries, is_xyz, gamma = np.ones(3), None, False, 1.0
    for line in head.split("\n"):
        name, _, value = line.partition("=")  # behind a tab is the header of what it was made of
        numbers = _numbers(value)
        if name == "EXPOSURE" and len(numbers) == 1 and numbers[0] > 0:
            gain = gain * numbers[0]
        elif name == "COLORCORR" and len(numbers) == 3 and min(numbers) > 0:
            gain = gain * numbers
        elif name == "PRIMARIES" and len(numbers) == 8:
            primaries = numbers
        elif name == "GAMMA" and len(numbers) == 1 and 1 / MAX_GAMMA <= numbers[0] <= MAX_GAMMA:
            gamma = numbers[0]  # Bruce Walter's rgbe.c, "Real Pixels"
        elif name == "FORMAT":
            is_xyz = value.strip() == "32-bit_rle_xyze"
    words = rest.partition("\n")[0].split()
    turn = _ORIENTATIONS.get((words[0], words[2]), 1) if len(words) == 4 else 1
    red, green, blue = (float(value) for value in gain)
    known = (red, green, blue) if all(map(isfinite, (red, green, blue))) else (1.0, 1.0, 1.0)
    return RadianceHeader(turn, known, primaries, is_xyz, gamma)


def _numbers(text: str) -> tuple[float, ...]:
    try:
        found = tuple(float(word) for word in text.split())
    except ValueError:
        return ()
    return found if all(map(isfinite, found)) else ()
