"""What `deeplight fuse` is given, as frames: photos, a clip's best frames, phone panoramas."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

from deeplight.errors import ConfigError
from deeplight.frames import Rotation
from deeplight.fuse.choose import moving
from deeplight.fuse.panorama_photo import is_panorama, panorama_frames, panorama_notes
from deeplight.fuse.poses import Poses, angle_between
from deeplight.fuse.track import WORKING_SIDE
from deeplight.io.exif import exif_directories
from deeplight.io.photos import Photo, read_photo
from deeplight.io.video import VideoFrame, is_video, video_frames

MOST_FRAMES = 160
"""Of a clip; when more would be kept every other one is dropped."""
_POSED_RAD = math.radians(6)


@dataclass(frozen=True, eq=False)
class SourceFrame:
    """One frame to fuse.

    Attributes:
        name: what it is called in messages.
        pixels: upright, at most `WORKING_SIDE` on its longer side.
        number: in its clip, or in the list of photos.
        time_s: in its clip; 0 for photos.
        vertical_fov_rad: if its file says; None if not.
        log_exposure: ln of exposure from EXIF data; nan if not there.
        world_from_camera: if its file says, as a panorama does.
        notes: what reading had to decide.
    """

    name: str
    pixels: UInt8[np.ndarray, "height width 3"]
    number: int
    time_s: float = 0.0
    vertical_fov_rad: float | None = None
    log_exposure: float = math.nan
    world_from_camera: Rotation | None = None
    notes: tuple[str, ...] = ()


def read_frames(paths: Sequence[Path], poses: Poses | None) -> list[SourceFrame]:
    """Read a clip, photos or panoramas; frames that no pose places are left out if there are poses.

    Raises:
        OSError, InputError: a file cannot be read or is no photo, clip or panorama.
        ConfigError: clips and photos are mixed, or there are several clips.
    """
    clips = [path for path in paths if is_video(path)]
    if clips and len(paths) > 1:
        raise ConfigError("one clip, or photos", f"{len(paths)} files", "fuse them one by one")
    if clips:
        return thinned(_of_clip(clips[0], poses))
    found: list[SourceFrame] = []
    for path in paths:
        if is_panorama(path):
            whole = read_photo(path).pixels
            notes = panorama_notes(path, *whole.shape[:2])
            found += [
                SourceFrame(path.name, pixels, len(found) + k, 0.0, fov, 0.0, turn, notes)
                for k, (pixels, fov, turn) in enumerate(panorama_frames(path, whole))
            ]
        else:
            found.append(frame_of(read_photo(path), path.name, len(found)))
    return found


def frame_of(photo: Photo, name: str, number: int, time_s: float = 0.0) -> SourceFrame:
    """A photo as a frame: made small, its exposure read."""
    exposure = math.nan if photo.source is None else log_exposure_of(photo.source)
    return SourceFrame(
        name,
        shrunk(photo.pixels),
        number,
        time_s,
        photo.vertical_fov_rad,
        exposure,
        notes=photo.notes,
    )


def shrunk(pixels: UInt8[np.ndarray, "height width 3"]) -> UInt8[np.ndarray, "rows columns 3"]:
    """The picture averaged down to `WORKING_SIDE` pixels on its longer side."""
    scale = WORKING_SIDE / max(pixels.shape[:2])
    upright = np.ascontiguousarray(pixels)
    if scale >= 1:
        return upright
    return np.asarray(cv2.resize(upright, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA))


def log_exposure_of(path: Path) -> float:
    """ln of exposure time times ISO over the f-number squared, from EXIF data; nan without them."""
    try:
        camera = exif_directories(path).camera
        values = [float(camera.get(tag, math.nan)) for tag in (0x829A, 0x829D)]
        iso = camera.get(0x8827, math.nan)
        sensitivity = float(iso[0] if isinstance(iso, tuple) else iso)
        exposure = values[0] * sensitivity / values[1] ** 2
    except (ValueError, TypeError, ZeroDivisionError):
        return math.nan  # nonsense in its data
    return math.log(exposure) if 0 < exposure < math.inf else math.nan


def _of_clip(path: Path, poses: Poses | None) -> Iterator[SourceFrame]:
    chosen = moving(video_frames(path)) if poses is None else _posed(video_frames(path), poses)
    for still in chosen:
        photo = Photo(still.rgb(), None, notes=still.notes)
        yield frame_of(photo, f"frame {still.number}", still.number, still.time_s)


def thinned(source: Iterator[SourceFrame]) -> list[SourceFrame]:
    """At most `MOST_FRAMES`, evenly spread: memory does not grow with the clip."""
    frames: list[SourceFrame] = []
    step = 1
    for count, frame in enumerate(source):
        if count % step == 0:
            frames.append(frame)
        if len(frames) > MOST_FRAMES:
            frames, step = frames[::2], 2 * step
    return frames


def _posed(source: Iterator[VideoFrame], poses: Poses) -> Iterator[VideoFrame]:
    """Frames that have a pose, a few degrees apart."""
    last: Rotation | None = None
    for still in source:
        turn = poses.at(still.number, still.time_s)
        if turn is not None and (last is None or angle_between(last, turn) > _POSED_RAD):
            last = turn
            yield still
