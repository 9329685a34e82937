"""How the camera stood: above which surface, how tilted, where the photo's EXIF data says so."""

from dataclasses import dataclass
from math import degrees, radians

import numpy as np
from jaxtyping import UInt8

from deeplight.camera import PinholeCamera
from deeplight.compose.ground import DEFAULT_PITCH_RAD, Viewpoint
from deeplight.compose.horizon import tilt_of_photo
from deeplight.io.tilt import Tilt, with_given


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


def camera_tilt(
    known: Tilt | None,
    camera: PinholeCamera,
    placement: CameraPlacement,
    photo: UInt8[np.ndarray, "height width 3"] | None = None,
    guess: Tilt | None = None,
) -> Tilt | None:
    """The camera's tilt as given, else EXIF's, which is known, else what upright edges in the photo
    say, else the guess; None where nothing says what the pitch is."""
    tilt = known
    if tilt is None and photo is not None and placement.pitch_deg is None:
        seen = tilt_of_photo(photo, camera)
        if seen is not None:
            tilt = Tilt(seen.pitch_rad, seen.roll_rad, "upright edges in the photo")
    return with_given(tilt or guess, placement.pitch_deg, placement.roll_deg)


def viewpoint_of(
    camera: PinholeCamera, placement: CameraPlacement, tilt: Tilt | None
) -> tuple[Viewpoint, list[str]]:
    """The camera above the surface, and notes on what its tilt was taken from.

    Args:
        camera: of the upright photo.
        placement: what is given of how it stood.
        tilt: of `camera_tilt`; without one the pitch is assumed.
    """
    if tilt is None:
        roll = radians(placement.roll_deg or 0.0)
        assumed = f"{degrees(DEFAULT_PITCH_RAD):.0f} degrees"
        note = f"camera tilt unknown, assumed {assumed}: give --pitch"
        return Viewpoint(camera, placement.height_m, DEFAULT_PITCH_RAD, roll), [note]
    notes = []
    if placement.pitch_deg is None:
        notes.append(f"camera pitch from {tilt.source}: {degrees(tilt.pitch_rad):.0f} degrees")
    return Viewpoint(camera, placement.height_m, tilt.pitch_rad, tilt.roll_rad), notes
