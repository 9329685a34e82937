"""Video files as a stream of upright photos."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from deeplight.errors import ImageFileError, MissingExtraError
from deeplight.io.image import MAX_PHOTO_PIXELS, MIN_SIDE, Photo
from deeplight.io.image_file import check_size, damaged, first_bytes

if TYPE_CHECKING:
    import av

VIDEO_SUFFIXES = frozenset(".avi .m4v .mkv .mov .mp4 .mpg .webm".split())

ITU601, ITU709, UNSPECIFIED = 5, 1, 2  # FFmpeg's AVCOL_SPC numbers
HDR_TRANSFERS = {16: "PQ", 18: "HLG"}  # FFmpeg's AVCOL_TRC numbers


def is_video(path: Path | str) -> bool:
    """Tell by the suffix whether `path` is a video."""
    return Path(path).suffix.lower() in VIDEO_SUFFIXES


def frames(path: Path | str) -> Iterator[Photo]:
    """Decode a video frame by frame; memory does not grow with its length.

    Rotation metadata is honoured (phones film portrait lying down), and so are limited and full
    range. A file that does not name its colour matrix gets BT.709 from 720 lines on and BT.601
    below, as players do. HLG and PQ are not tone-mapped; `Photo.notes` says so.

    Raises:
        OSError: there is no such file, it is a folder, or reading it is not permitted.
        ImageFileError: no video in it, truncated, or frames too small or too large; a fault in the
            middle is raised where it is met, after the frames before it.
        MissingExtraError: the `capture` extra is not installed.
    """
    path = Path(path)
    first_bytes(path)
    try:
        import av
    except ImportError as error:
        raise MissingExtraError("capture", f"reading {path.name}") from error
    count = 0
    try:
        with av.open(str(path)) as container:
            if not container.streams.video:
                raise _no_video(path)
            stream = container.streams.video[0]
            stream.thread_type = "AUTO"
            for frame in container.decode(stream):
                yield _photo(frame, path)
                count += 1
    except av.error.FFmpegError as error:
        raise damaged(path, f"after {count} frames: {error.strerror}") from error
    if not count:
        raise _no_video(path)


def _no_video(path: Path) -> ImageFileError:
    return ImageFileError("a video", f"{path} without video frames", "give another file")


def _photo(frame: "av.VideoFrame", path: Path) -> Photo:
    check_size(path, frame.width, frame.height, MAX_PHOTO_PIXELS)
    if min(frame.width, frame.height) < MIN_SIDE:
        expected = f"a video of at least {MIN_SIDE} pixels a side"
        got = f"{path} of {frame.width} x {frame.height}"
        raise ImageFileError(expected, got, "use a larger video")
    matrix = int(frame.colorspace)
    if matrix == UNSPECIFIED:
        matrix = ITU709 if min(frame.width, frame.height) >= 720 else ITU601
    pixels = frame.reformat(format="rgb24", src_colorspace=matrix).to_ndarray()
    # The turn that brings the frame upright, in degrees anticlockwise: what rot90 takes.
    turned = np.rot90(pixels, round(frame.rotation / 90))
    transfer = HDR_TRANSFERS.get(int(frame.color_trc))
    notes = (f"{transfer} video, not tone-mapped",) if transfer else ()
    return Photo(pixels=turned, source=path, notes=notes)
