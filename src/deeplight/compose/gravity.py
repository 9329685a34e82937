"""How the camera stood: above which surface, how tilted, where the photo's EXIF data says so."""

from dataclasses import dataclass
from math import degrees, radians
from pathlib import Path

from deeplight.camera import PinholeCamera
from deeplight.compose.ground import DEFAULT_PITCH_RAD, Viewpoint
from deeplight.io.tilt import tilt_of
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
    source: Path | str | None, framing: Framing, placement: CameraPlacement
) -> tuple[Viewpoint, list[str]]:
    """The camera above the surface, and notes on what EXIF said or had to be assumed."""
    tilt, notes = tilt_of(source), []
    pitch, roll = DEFAULT_PITCH_RAD, 0.0
    if tilt is not None:
        pitch, roll = tilt.pitch_rad, tilt.roll_rad
        if placement.pitch_deg is None:
            notes.append(f"camera pitch from {tilt.source}: {degrees(pitch):.0f} degrees")
    elif placement.pitch_deg is None:
        notes.append(f"camera tilt unknown, assumed {degrees(pitch):.0f} degrees: give --pitch")
    pitch = pitch if placement.pitch_deg is None else radians(placement.pitch_deg)
    roll = roll if placement.roll_deg is None else radians(placement.roll_deg)
    camera = PinholeCamera(framing.photo_width, framing.photo_height, framing.vertical_fov_rad)
    return Viewpoint(camera, placement.height_m, pitch, roll), notes
