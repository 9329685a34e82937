"""One clip, from video to examples: find the rig, choose frames, cut them, report.

Two passes over the file, so that memory does not grow with its length: the first measures every
frame and finds the spheres, the second converts only the frames that are kept.
"""

import re
from collections.abc import Generator, Iterator
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from deeplight.camera import PinholeCamera
from deeplight.capture.catalogue import Clip
from deeplight.capture.choice import ChoiceSettings, Chooser, causes_by_log
from deeplight.capture.locate import locate
from deeplight.capture.located import Located, LocateSettings, NotLocated
from deeplight.capture.quality import QualityLog
from deeplight.capture.reproject import background_of, crops, reprojections
from deeplight.capture.truth import true_lighting
from deeplight.contract import ModelContract
from deeplight.dataset import Example, ExampleMeta
from deeplight.dataset.splits import TRAINING_SPLITS
from deeplight.errors import DataSetError, InputError
from deeplight.io.video import VideoFacts, VideoFrame, facts, video_frames
from deeplight.preprocess import ASSUMED_LONG_SIDE_FOV_RAD, Framing, frame_photo
from deeplight.sphere import Rig

Picture = UInt8[np.ndarray, "height width 3"]

_UNSAFE = re.compile(r"[^A-Za-z0-9_-]")  # in keys; the clip's number keeps them apart
_SHOWN = 12  # crops kept for the report, at least, if there are that many; at most twice


@dataclass(frozen=True)
class CaptureSettings:
    """What decides every byte made of a clip.

    Attributes:
        locate: how to find the spheres.
        choice: which frames to keep.
        vertical_fov_rad: of the upright full frame; None if nobody said so.
    """

    locate: LocateSettings = field(default_factory=LocateSettings)
    choice: ChoiceSettings = field(default_factory=ChoiceSettings)
    vertical_fov_rad: float | None = None


@dataclass(eq=False)
class ClipRecord:
    """What a report says of a clip, gathered while it is worked on.

    Attributes:
        clip, video: which, and what its header says.
        camera: of the upright frame, as it was taken.
        log: a row for each frame that was read.
        chooser: the fate of each frame.
        located: the rig, if it was found; `rig_name` is its name in the data set.
        shown: frame number and the three crops of a few kept frames, evenly spread.
        warnings: what a person should look at.
        reason: why it failed; empty if it did not.
        overlay: the picture of what was found or seen.
    """

    clip: Clip
    video: VideoFacts | None = None
    camera: PinholeCamera | None = None
    log: QualityLog = field(default_factory=QualityLog)
    chooser: Chooser | None = None
    located: Located | None = None
    rig_name: str = ""
    shown: list[tuple[int, dict[str, Picture]]] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    reason: str = ""
    overlay: Picture | None = None

    @property
    def kept(self) -> int:
        return self.chooser.kept if self.chooser and not self.reason else 0


def capture_clip(
    record: ClipRecord, settings: CaptureSettings, number: int
) -> Iterator[Example | Rig]:
    """Give the rig of a clip and then its examples, and fill in `record` on the way.

    Args:
        record: of the clip.
        settings: how to work.
        number: of the clip in its split; part of the examples' keys.

    Raises:
        InputError: the clip cannot be used, whenever that shows; `record.reason` says why.
    """
    try:
        camera = _look_through(record, settings)
        assert record.located is not None
        take = f"{_UNSAFE.sub('_', record.clip.stem)[:60]}-{number:05d}"
        rig = replace(record.located.rig, name=take)
        record.rig_name = take
        yield rig
        yield from _examples(record, camera, rig)
    except InputError as error:
        line = " ".join(str(error).split())
        record.reason = line.replace(str(record.clip.path), record.clip.path.name)
        if isinstance(error, NotLocated):
            record.overlay = error.overlay
        raise


def _read(path: Path) -> Generator[VideoFrame]:
    """The clip's frames; what the system says against reading it is the clip's fault."""
    try:
        yield from video_frames(path)
    except OSError as error:
        raise _unreadable(path, error) from error


def _unreadable(path: Path, error: OSError) -> DataSetError:
    return DataSetError("a readable clip", f"{path}: {error.strerror or error}", "correct the path")


def _look_through(record: ClipRecord, settings: CaptureSettings) -> PinholeCamera:
    """The first pass: measure every frame, find the spheres, decide what to leave out."""
    path, choice = record.clip.path, settings.choice
    try:
        record.video = video = facts(path)
    except OSError as error:
        raise _unreadable(path, error) from error
    fov_rad = settings.vertical_fov_rad or frame_photo(video.height, video.width).vertical_fov_rad
    record.camera = camera = PinholeCamera(video.width, video.height, fov_rad)
    if video.width > video.height and not settings.vertical_fov_rad:
        record.warnings.append(
            f"a clip wider than high, taken to see {np.degrees(ASSUMED_LONG_SIDE_FOV_RAD):.0f} "
            f"degrees from left to right, {np.degrees(fov_rad):.1f} vertically; else give --fov"
        )
    record.located = locate(record.log.watch(_read(path)), camera, settings.locate)
    record.overlay = record.located.overlay
    record.warnings += record.located.warnings
    record.chooser = Chooser(causes_by_log(record.log, choice), choice.alike)
    if record.kept < choice.least_kept:
        dropped = ", ".join(f"{n} {cause}" for cause, n in record.chooser.dropped.items())
        got = f"{record.kept} good ones of {len(record.log)} ({dropped})"
        raise DataSetError(f"at least {choice.least_kept} good frames", got, "film it again")
    return camera


def _examples(record: ClipRecord, camera: PinholeCamera, rig: Rig) -> Iterator[Example]:
    """The second pass: cut the frames that are kept."""
    assert record.chooser is not None
    clip, framing = record.clip, background_framing(camera)
    cuts = reprojections(rig, camera)
    lighting = {} if clip.split in TRAINING_SPLITS else true_lighting(clip.path)
    step = 1
    with closing(_read(clip.path)) as reading:
        for count, still in enumerate(record.chooser.keep(reading)):
            channels = still.channels()
            spheres = crops(channels, cuts)
            if count % step == 0:
                record.shown.append((still.number, spheres))
                if len(record.shown) >= 2 * _SHOWN:
                    record.shown, step = record.shown[::2], 2 * step
            yield Example(
                f"{rig.name}-{still.number:06d}",
                background_of(channels, framing),
                spheres,
                _meta(record, still, rig),
                lighting.get(still.number),
            )


def background_framing(camera: PinholeCamera) -> Framing:
    """The network's view of a frame: the portrait one, or the landscape one of a wide frame."""
    wide = camera.width > camera.height
    contract = ModelContract.landscape() if wide else ModelContract()
    fov = camera.vertical_fov_rad
    return frame_photo(camera.height, camera.width, fov, "given", contract)


def _meta(record: ClipRecord, still: VideoFrame, rig: Rig) -> ExampleMeta:
    clip, log = record.clip, record.log
    details: dict[str, float | str] = {
        "time_s": round(still.time_s, 6),
        "mean": round(log.at("mean", still.number), 5),
        "sharpness": round(log.at("sharpness", still.number), 6),
    }
    if record.video is not None and record.video.camera:
        details["camera"] = record.video.camera
    return ExampleMeta(
        place=clip.place,
        take=rig.name,
        frame=still.number,
        scene=clip.scene,
        split=clip.split,
        rig=rig.name,
        camera="phone",
        licence=clip.licence,
        source=clip.path.name,
        details=details,
    )
