"""One frame to fuse: a photo or a clip's still made small, with what its file says."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from deeplight.frames import Rotation
from deeplight.fuse.track import WORKING_SIDE
from deeplight.io.exif import ExifDirectories, number
from deeplight.io.photos import Photo
from deeplight.io.pictures_aside import PictureAside
from deeplight.preprocess import frame_photo

_SAME_RAD = math.radians(1)  # a field of view given that is off by less is not worth a word


@dataclass(frozen=True, eq=False)
class SourceFrame:
    """One frame to fuse.

    Attributes:
        name: what it is called in messages.
        picture: upright, at most `WORKING_SIDE` on its longer side; `pixels` in memory.
        number: in its clip, or in the list of photos.
        time_s: in its clip; 0 for photos.
        vertical_fov_rad: if its file says; None if not.
        log_exposure: ln of exposure from EXIF data; nan if not there.
        world_from_camera: if its file says, as a panorama does.
        notes: what reading had to decide.
        up: against gravity, in the upright camera; None if its file does not say.
    """

    name: str
    picture: UInt8[np.ndarray, "height width 3"] | PictureAside
    number: int
    time_s: float = 0.0
    vertical_fov_rad: float | None = None
    log_exposure: float = math.nan
    world_from_camera: Rotation | None = None
    notes: tuple[str, ...] = ()
    up: Float[np.ndarray, "3"] | None = None

    @property
    def pixels(self) -> UInt8[np.ndarray, "height width 3"]:
        """The picture, read from the disk where it was put aside."""
        return np.asarray(self.picture)


def frame_of(photo: Photo, name: str, number: int, time_s: float = 0.0) -> SourceFrame:
    """A photo as a frame: made small, its exposure read."""
    return SourceFrame(
        name,
        shrunk(photo.pixels),
        number,
        time_s,
        photo.vertical_fov_rad,
        log_exposure_of(photo.exif),
        notes=photo.notes,
        up=None if photo.tilt is None else photo.tilt.up,
    )


def with_fields_of_view(
    frames: Sequence[SourceFrame], fov_rad: float | None = None
) -> list[SourceFrame]:
    """Frames of which all know their vertical field of view, or none does.

    A frame keeps what its own file says. One that says nothing is of the same camera as the first
    that does, which may have been held the other way: as wide along the longer side.

    Args:
        frames: in the order given.
        fov_rad: of the first, if somebody gives it; then all but parts of panoramas are its
            camera's, and a note says where a frame's own file says otherwise.
    """
    if not frames:
        return []
    if fov_rad is None:
        own = [frame.vertical_fov_rad for frame in frames]
        first = next((k for k, fov in enumerate(own) if fov is not None), 0)
        fov_rad = own[first]
    else:
        own = [f.vertical_fov_rad if f.world_from_camera is not None else None for f in frames]
        first = 0
    if fov_rad is None:
        return list(frames)
    shape = frames[first].picture.shape
    longer = max(shape) / shape[0]
    alike = [scaled(fov_rad, longer * f.picture.shape[0] / max(f.picture.shape)) for f in frames]
    used = [said or same for said, same in zip(own, alike, strict=True)]
    notes = _overruled(frames, used)
    return [
        replace(frame, vertical_fov_rad=fov, notes=(*frame.notes, *notes))
        for frame, fov in zip(frames, used, strict=True)
    ]


def _overruled(frames: Sequence[SourceFrame], used_rad: Sequence[float]) -> tuple[str, ...]:
    """What to say where files say another field of view than is used."""
    differ = [
        (frame.name, math.degrees(used), math.degrees(frame.vertical_fov_rad))
        for frame, used in zip(frames, used_rad, strict=True)
        if frame.vertical_fov_rad and abs(used - frame.vertical_fov_rad) > _SAME_RAD
    ]
    if not differ:
        return ()
    name, used, said = differ[0]
    others = f" (and {len(differ) - 1} more differ)" if len(differ) > 1 else ""
    return (f"field of view {used:.0f} degrees as given, not {said:.0f} as {name} says{others}",)


def field_of_view(frame: SourceFrame) -> float:
    """The vertical field of view that a frame's file says, else the assumed one."""
    return frame.vertical_fov_rad or frame_photo(*frame.picture.shape[:2]).vertical_fov_rad


def scaled(fov_rad: float, factor: float) -> float:
    """A field of view of which the half's tangent is multiplied by a factor."""
    return 2 * math.atan(math.tan(fov_rad / 2) * factor)


def unknown_fov(fov_rad: float, found: bool) -> str:
    """What to say where no file knew the vertical field of view."""
    way = "found" if found else "assumed"
    return (
        f"field of view unknown, {way} {math.degrees(fov_rad):.0f} degrees vertically: give --fov"
    )


def shrunk(pixels: UInt8[np.ndarray, "height width 3"]) -> UInt8[np.ndarray, "rows columns 3"]:
    """The picture averaged down to `WORKING_SIDE` pixels on its longer side."""
    scale = WORKING_SIDE / max(pixels.shape[:2])
    upright = np.ascontiguousarray(pixels)
    if scale >= 1:
        return upright
    return np.asarray(cv2.resize(upright, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA))


def log_exposure_of(exif: ExifDirectories) -> float:
    """ln of exposure time times ISO over the f-number squared, from EXIF data; nan without them."""
    camera = exif.camera
    iso = camera.get(0x8827)
    speed = iso[0] if isinstance(iso, tuple) and iso else iso
    values = [number(value) for value in (camera.get(0x829A), camera.get(0x829D), speed)]
    seconds, aperture, sensitivity = (value or 0.0 for value in values)
    if min(seconds, aperture, sensitivity) <= 0:
        return math.nan  # missing, unknown or nonsense
    return math.log(seconds) + math.log(sensitivity) - 2 * math.log(aperture)
