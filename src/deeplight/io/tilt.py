"""How the camera was tilted, where the photo's EXIF data says."""

import struct
from dataclasses import dataclass, replace
from math import asin, atan2, hypot, isfinite, radians

import numpy as np
from jaxtyping import Float

from deeplight.frames import Rotation, world_from_camera
from deeplight.io.exif import ExifDirectories, number

_MAKER_NOTE, _ELEVATION = 0x927C, 0x9405
_APPLE = b"Apple iOS\0"
_APPLE_IFD, _ACCELERATION, _SIGNED_RATIONAL = 14, 8, 10


@dataclass(frozen=True)
class Tilt:
    """Pitch (positive looks up) and roll (positive is counter-clockwise), and who says so.

    `scale_rad`: two of three such pitches are less off; 0 where the tilt is known.
    """

    pitch_rad: float
    roll_rad: float
    source: str
    scale_rad: float = 0.0

    @property
    def level_from_camera(self) -> Rotation:
        """To the frame whose +Y is against gravity, the view above or below -Z."""
        return world_from_camera(0.0, self.pitch_rad, self.roll_rad)

    @property
    def up(self) -> Float[np.ndarray, "3"]:
        """Against gravity, unit length, in the camera frame."""
        return self.level_from_camera[1]


def with_given(tilt: Tilt | None, pitch_deg: float | None, roll_deg: float | None) -> Tilt | None:
    """A tilt with what somebody says of it; None where nothing says what the pitch is."""
    if pitch_deg is not None:
        roll_rad = 0.0 if tilt is None else tilt.roll_rad
        tilt = Tilt(radians(pitch_deg), roll_rad, "the pitch as given")
    if tilt is not None and roll_deg is not None:
        tilt = replace(tilt, roll_rad=radians(roll_deg))
    return tilt


def tilt_of(exif: ExifDirectories) -> Tilt | None:
    """The tilt that EXIF gives: an iPhone's acceleration, else CameraElevationAngle.

    None where it has neither, or says that it is unknown, or nonsense.
    """
    camera = exif.camera
    note, elevation = camera.get(_MAKER_NOTE), number(camera.get(_ELEVATION))
    if isinstance(note, bytes) and note.startswith(_APPLE):
        orientation = int(number(exif.main.get(0x0112)) or 1)
        found = _from_acceleration(_apple_acceleration(note), orientation)
        if found:
            return found
    if elevation is not None and abs(elevation) < 89:
        return Tilt(radians(elevation), 0.0, "EXIF camera elevation")
    return None


def _apple_acceleration(note: bytes) -> tuple[float, float, float] | None:
    """The AccelerationVector of Apple's maker note: three signed fractions, in g."""
    try:
        order = "<" if note[12:14] == b"II" else ">"
        (count,) = struct.unpack_from(f"{order}H", note, _APPLE_IFD)
        for entry in range(count):
            at = _APPLE_IFD + 2 + 12 * entry
            tag, kind, values, offset = struct.unpack_from(f"{order}HHII", note, at)
            if (tag, kind, values) == (_ACCELERATION, _SIGNED_RATIONAL, 3):
                n = struct.unpack_from(f"{order}6i", note, offset)
                return n[0] / n[1], n[2] / n[3], n[4] / n[5]
    except (struct.error, ZeroDivisionError):
        return None
    return None


def _from_acceleration(vector: tuple[float, float, float] | None, orientation: int) -> Tilt | None:
    """Tilt of the upright picture; the vector is in the phone's axes, whose +Y is its top."""
    if vector is None:
        return None
    x, y, z = (-value for value in vector)  # up: a phone at rest feels 1 g upwards
    length = hypot(x, y, z)
    turned = {1: (-y, x), 3: (y, -x), 6: (x, y), 8: (-x, -y)}.get(orientation)
    if turned is None or not isfinite(length) or not 0.7 < length < 1.3:
        return None  # mirrored, or shaken
    right, up = turned
    if up < 0.2 * length:
        return None  # not upright: straight down, or another convention
    return Tilt(asin(-z / length), atan2(right, up), "EXIF acceleration")
