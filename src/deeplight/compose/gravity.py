"""How the camera stood: above which surface, how tilted, where the photo's EXIF data says so."""

from dataclasses import dataclass
from math import degrees, pi, radians

from deeplight.camera import PinholeCamera
from deeplight.compose.ground import DEFAULT_PITCH_RAD, Viewpoint
from deeplight.io.tilt import Tilt


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
    camera: PinholeCamera, placement: CameraPlacement, tilt: Tilt | None
) -> tuple[Viewpoint, list[str]]:
    """The camera above the surface, and notes on what its tilt was taken from.

    Args:
        camera: of the upright photo.
        placement: what is given of how it stood.
        tilt: of `tilt_of_estimate`; without one the pitch is assumed.
    """
    height_m = placement.height_m
    if tilt is None:
        roll = radians(placement.roll_deg or 0.0)
        assumed = f"{degrees(DEFAULT_PITCH_RAD):.0f} degrees"
        note = f"camera tilt unknown, assumed {assumed}: give --pitch"
        return Viewpoint(camera, height_m, DEFAULT_PITCH_RAD, roll, doubt_rad=pi / 2), [note]
    notes = []
    if placement.pitch_deg is None:
        rolled = round(degrees(tilt.roll_rad))
        leaning = f", rolled by {rolled}" if abs(rolled) > 1 and placement.roll_deg is None else ""
        pitch = f"{degrees(tilt.pitch_rad):.0f} degrees"
        notes.append(f"camera pitch from {tilt.source}: {pitch}{leaning}")
    held = tilt.pitch_rad, tilt.roll_rad
    return Viewpoint(camera, height_m, *held, doubt_rad=tilt.scale_rad), notes
