"""How the camera stood: above which surface, how tilted, where the photo's EXIF data says so."""

from dataclasses import dataclass
from math import degrees, radians
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from deeplight.camera import PinholeCamera
from deeplight.compose.ground import DEFAULT_PITCH_RAD, Viewpoint
from deeplight.compose.horizon import tilt_of_photo
from deeplight.io.tilt import Tilt, tilt_of
from deeplight.preprocess import Framing


@dataclass(frozen=True)
class CameraPlacement:
    """What is known of how the camera stood; None is looked for in EXIF, else assumed.

    Attributes:
        height_m: from the surface up to the camera.
        pitch_deg: upwards.
        roll_deg: counter-clockwise.
        fov_deg: vertical field of view of the upright photo.
    """

    height_m: float = 1.4
    pitch_deg: float | None = None
    roll_deg: float | None = None
    fov_deg: float | None = None


def viewpoint_of(
    source: Path | str | None,
    framing: Framing,
    placement: CameraPlacement,
    photo: UInt8[np.ndarray, "height width 3"] | None = None,
    guess: Tilt | None = None,
) -> tuple[Viewpoint, list[str]]:
    """The camera above the surface, and notes on what its tilt was taken from.

    Tilt is as given, else EXIF's, else what upright edges in the photo say, else the guess, else
    assumed.
    """
    camera = PinholeCamera(framing.photo_width, framing.photo_height, framing.vertical_fov_rad)
    tilt, notes = tilt_of(source), []
    if tilt is None and photo is not None and placement.pitch_deg is None:
        seen = tilt_of_photo(photo, camera)
        if seen is not None:
            tilt = Tilt(seen.pitch_rad, seen.roll_rad, "upright edges in the photo")
    tilt = tilt or guess
    pitch, roll = DEFAULT_PITCH_RAD, 0.0
    if tilt is not None:
        pitch, roll = tilt.pitch_rad, tilt.roll_rad
        if placement.pitch_deg is None:
            notes.append(f"camera pitch from {tilt.source}: {degrees(pitch):.0f} degrees")
    elif placement.pitch_deg is None:
        notes.append(f"camera tilt unknown, assumed {degrees(pitch):.0f} degrees: give --pitch")
    pitch = pitch if placement.pitch_deg is None else radians(placement.pitch_deg)
    roll = roll if placement.roll_deg is None else radians(placement.roll_deg)
    return Viewpoint(camera, placement.height_m, pitch, roll), notes
