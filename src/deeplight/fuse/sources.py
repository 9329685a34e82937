"""What `deeplight fuse` is given, as frames: photos, a clip's best frames, phone panoramas."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from deeplight.errors import ConfigError, InputError
from deeplight.frames import Rotation
from deeplight.fuse.clip import clip_frames
from deeplight.fuse.frame import SourceFrame, frame_of
from deeplight.fuse.panorama_photo import is_panorama, panorama_frames, panorama_notes
from deeplight.fuse.poses import Poses, angle_between
from deeplight.io.kept_folder import KeptFolder
from deeplight.io.photos import Photo, read_photo
from deeplight.io.pictures_aside import PicturesAside
from deeplight.io.video import is_video, video_frames

MOST_FRAMES = 160
"""Of a clip; when more would be kept every other one is dropped."""
_POSED_RAD = math.radians(6)


def read_frames(
    paths: Sequence[Path],
    poses: Poses | None,
    kept: KeptFolder | None = None,
    workers: int = 1,
    on_failure: Callable[[InputError | OSError], None] | None = None,
) -> list[SourceFrame]:
    """Read a clip, photos or panoramas; frames that no pose places are left out if there are poses.

    Args:
        paths: of one clip, or of photos and panoramas.
        poses: how the camera was turned.
        kept: where a clip without poses finds what a killed run has done.
        workers: processes for a clip without poses; 0 is one per core.
        on_failure: called with why one of several photos cannot be used, which is then left out;
            the others keep their numbers.

    Raises:
        OSError, InputError: a file cannot be read or is no photo, clip or panorama.
        ConfigError: clips and photos are mixed, or there are several clips.
    """
    clips = [path for path in paths if is_video(path)]
    if clips and len(paths) > 1:
        raise ConfigError("one clip, or photos", f"{len(paths)} files", "fuse them one by one")
    if clips:
        (clip,) = clips
        if poses is not None:
            return _posed(clip, poses)
        folder = None if kept is None else kept.folder
        return thinned(clip_frames(clip, kept, workers), folder)
    found: list[SourceFrame] = []
    number = 0
    for path in paths:
        try:
            of_path = _of_photo(path, number, is_alone=poses is None and len(paths) == 1)
            if poses is None and _has_turns(found) and _has_turns(of_path):
                raise ConfigError("one panorama", f"another, {path}", "fuse them one by one")
        except (InputError, OSError) as error:
            if on_failure is None or len(paths) == 1:
                raise
            on_failure(error)
            of_path = []
        found += of_path
        number += max(len(of_path), 1)
    return found


def _of_photo(path: Path, number: int, is_alone: bool) -> list[SourceFrame]:
    """A photo, or a panorama's parts, numbered from `number`."""
    photo = read_photo(path)
    whole = photo.pixels
    # A lone photo cannot be fused: twice as wide as high, it is a sphere without metadata.
    sphere = is_alone and whole.shape[1] == 2 * whole.shape[0]
    if not is_panorama(path) and not (sphere and photo.vertical_fov_rad is None):
        return [frame_of(photo, path.name, number)]
    notes = panorama_notes(path, *whole.shape[:2])
    return [
        SourceFrame(path.name, pixels, number + k, 0.0, fov, 0.0, turn, notes)
        for k, (pixels, fov, turn) in enumerate(panorama_frames(path, whole))
    ]


def _has_turns(frames: Sequence[SourceFrame]) -> bool:
    """Whether some are parts of a panorama, whose turns are in a world of its own."""
    return any(frame.world_from_camera is not None for frame in frames)


def thinned(source: Iterator[SourceFrame], folder: Path | None = None) -> list[SourceFrame]:
    """At most `MOST_FRAMES`, evenly spread, their pictures put aside on a folder's disk: memory
    does not grow with the clip."""
    frames: list[SourceFrame] = []
    aside = PicturesAside(folder)
    step = 1
    for count, frame in enumerate(source):
        if count % step == 0:
            frames.append(replace(frame, picture=aside.add(frame.pixels)))
        if len(frames) > MOST_FRAMES:
            frames, step = frames[::2], 2 * step
    return frames


def _posed(path: Path, poses: Poses) -> list[SourceFrame]:
    """Frames that have a pose, a few degrees apart, and notes of what is not used."""
    count = without = 0

    def turning() -> Iterator[SourceFrame]:
        nonlocal count, without
        last: Rotation | None = None
        for still in video_frames(path):
            count += 1
            turn = poses.at(still.number, still.time_s)
            without += turn is None
            if turn is not None and (last is None or angle_between(last, turn) > _POSED_RAD):
                last = turn
                photo = Photo(still.rgb(), None, notes=still.notes)
                yield frame_of(photo, f"frame {still.number}", still.number, still.time_s)

    frames = thinned(turning())
    notes = poses.unused(count)
    if without:
        notes = (*notes, f"{without} of {count} frames without a pose left out")
    if len(frames) == 1 < count:
        notes = (*notes, f"the poses turn by less than {math.degrees(_POSED_RAD):.0f} degrees")
    return [replace(frame, notes=(*frame.notes, *notes)) for frame in frames]
