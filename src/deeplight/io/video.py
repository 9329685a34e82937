"""Video files as a stream of upright pictures."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path
from threading import get_ident
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import UInt8, UInt16

from deeplight.camera_response import LUMINANCE
from deeplight.errors import ImageFileError, MissingExtraError
from deeplight.io import video_colour
from deeplight.io.image_file import check_size, damaged, first_bytes
from deeplight.io.photos import MIN_SIDE, Photo

if TYPE_CHECKING:
    import av

MAX_VIDEO_PIXELS = 36_000_000
"""Of a frame: 8K has 33 million. Some frames are in memory at once, so less than of a photo."""

VIDEO_SUFFIXES = frozenset(".avi .m4v .mkv .mov .mp4 .mpg .webm".split())

ITU601, ITU709, UNSPECIFIED, BT2020 = 5, 1, 2, 9  # FFmpeg's AVCOL_SPC numbers
HDR_TRANSFERS = {16: "PQ", 18: "HLG"}  # FFmpeg's AVCOL_TRC numbers
TRANSFERS = {1: "BT.709", 6: "BT.601", 13: "sRGB", **HDR_TRANSFERS}
FULL_RANGE = 2  # FFmpeg's AVCOL_RANGE numbers

# FFmpeg's SWS_BILINEAR, _ACCURATE_RND and _FULL_CHR_H_INT: its faster ways are up to 2 levels dark.
_EXACT = 2 | 0x40000 | 0x2000
_TIMED_PACKETS = 900  # how far `facts` looks for an uneven frame rate
# Bits of a luma sample and how far up in its 16 they lie, by the pixel format's name.
_PLANAR = {f"yuv{j}{s}p": (8, 0) for j in ("", "j") for s in ("420", "422", "444")}
_PLANAR |= {f"yuv{s}p{b}le": (b, 0) for s in ("420", "422", "444") for b in (10, 12)}
_PLANAR |= {"nv12": (8, 0), "nv21": (8, 0), "p010le": (10, 6), "gray": (8, 0)}


@dataclass(frozen=True, eq=False)
class Still:
    """One frame of a video, upright.

    Attributes:
        number: position in the file, from 0.
        time_s: when it is shown.
    """

    number: int
    time_s: float
    _frame: "av.VideoFrame" = field(repr=False)

    @cached_property
    def luma(self) -> UInt8[np.ndarray, "height width"]:
        """Grey, gamma-encoded, full range, row by row in memory; HDR is brought to SDR."""
        return np.ascontiguousarray(_upright(_luma(self._frame), self._frame))

    def averaged_luma(
        self, average: Callable[[np.ndarray], np.ndarray]
    ) -> UInt8[np.ndarray, "h w"]:
        """Give `average(luma)`, but for rounding, without the cost of all of `luma`.

        Means of pixels are taken of the samples as they are stored; of HDR that is before it is
        brought to SDR.
        """
        raw = _raw_luma(self._frame)
        if raw is None:
            return average(self.luma)
        samples, table, shift = raw
        return table[(average(_upright(samples, self._frame)) >> shift) & (len(table) - 1)]

    def rgb(self) -> UInt8[np.ndarray, "height width 3"]:
        """The colours, gamma-encoded; converted when asked for.

        HLG and PQ become SDR on the scale of `io.video_colour`.
        """
        return _upright(_pixels(self._frame), self._frame)

    def channels(self) -> tuple[UInt8[np.ndarray, "height width"], ...]:
        """Red, green and blue of `rgb`, one array each, in two thirds of the time."""
        return tuple(_upright(channel, self._frame) for channel in _channels(self._frame))


@dataclass(frozen=True)
class VideoFacts:
    """What a video's header and first frames say.

    Attributes:
        width, height: of the upright picture.
        rate_hz: frames a second, on average; None if unknown.
        frames: the file's claim; None if it makes none.
        duration_s: None if unknown.
        codec: its name, "h264".
        transfer: "BT.709", "HLG", ..., "unspecified".
        rotation_deg: anticlockwise turn that brings stored frames upright.
        variable_rate: frames are unevenly spaced; None if times are missing.
    """

    width: int
    height: int
    rate_hz: float | None
    frames: int | None
    duration_s: float | None
    codec: str
    transfer: str
    rotation_deg: int
    variable_rate: bool | None


def is_video(path: Path | str) -> bool:
    """Tell by the suffix whether `path` is a video."""
    return Path(path).suffix.lower() in VIDEO_SUFFIXES


def frames(path: Path | str) -> Iterator[Photo]:
    """Decode a video frame by frame into photos; memory does not grow with its length.

    As `stills`, which says what is honoured and what is raised. `Photo.notes` says where HDR
    was brought to SDR.
    """
    for still in stills(path):
        transfer = HDR_TRANSFERS.get(int(still._frame.color_trc))
        notes = (f"{transfer} video, brought to SDR: reference white is 1.0",) if transfer else ()
        yield Photo(pixels=still.rgb(), source=Path(path), notes=notes)


def stills(path: Path | str) -> Iterator[Still]:
    """Decode a video frame by frame; memory does not grow with its length.

    Rotation metadata is honoured (phones film portrait lying down), and so are limited and full
    range, 10 bits, and presentation times. A file that does not name its colour matrix gets
    BT.709 from 720 lines on and BT.601 below, as players do.

    Raises:
        OSError: there is no such file, it is a folder, or reading it is not permitted.
        ImageFileError: no video in it, truncated, or frames too small or too large; a fault in the
            middle is raised where it is met, after the frames before it.
        MissingExtraError: the `capture` extra is not installed.
    """
    path = Path(path)
    count, size = 0, None
    with _opened(path) as container:
        rate = container.streams.video[0].average_rate
        for frame in _decoded(container, path):
            _check(path, frame.width, frame.height)
            size = size or (frame.width, frame.height)
            if size != (frame.width, frame.height):
                raise damaged(path, "its frames change their size")
            time_s = count / float(rate or 30) if frame.pts is None else frame.time
            yield Still(count, time_s, frame)
            count += 1
    if not count:
        raise _no_video(path)


def facts(path: Path | str) -> VideoFacts:
    """Size, rate and kind of a video, without decoding more than its first frame.

    Raises:
        OSError, ImageFileError, MissingExtraError: as `stills`.
    """
    path = Path(path)
    with _opened(path) as container:
        frame = next(_decoded(container, path), None)
        if frame is None:
            raise _no_video(path)
        _check(path, frame.width, frame.height)
        stream = container.streams.video[0]
        rate, ticks = stream.average_rate, stream.duration
        length = ticks * stream.time_base if ticks and stream.time_base else None
        claimed, codec = stream.frames or None, stream.codec_context.name
    with _opened(path) as container:  # again: the first frame has consumed packets
        uneven = _uneven(container)
    height, width = _upright(np.empty((frame.height, frame.width, 0)), frame).shape[:2]
    return VideoFacts(
        width=width,
        height=height,
        rate_hz=float(rate) if rate else None,
        frames=claimed,
        duration_s=float(length) if length else None,
        codec=codec,
        transfer=TRANSFERS.get(int(frame.color_trc), "unspecified"),
        rotation_deg=int(frame.rotation) % 360,
        variable_rate=uneven,
    )


@contextmanager
def _opened(path: Path) -> Iterator["av.container.InputContainer"]:
    """The file's container, which holds video; everything FFmpeg says becomes one error."""
    first_bytes(path)
    try:
        import av
    except ImportError as error:
        raise MissingExtraError("capture", f"reading {path.name}") from error
    # FFmpeg looks into a few frames already when it opens a file, and a header may lie.
    limit = {"max_pixels": str(MAX_VIDEO_PIXELS)}
    try:
        with av.open(str(path), options=limit) as container:
            if not container.streams.video:
                raise _no_video(path)
            stream = container.streams.video[0]
            check_size(path, stream.width, stream.height, MAX_VIDEO_PIXELS)
            if not stream.width:
                expected = f"a video of at most {MAX_VIDEO_PIXELS / 1e6:.0f} megapixels a frame"
                raise ImageFileError(expected, f"{path}, larger or damaged", "make it smaller")
            stream.codec_context.options = limit
            stream.thread_type = "AUTO"
            # 0 is as many as there are cores; a worker beside others is told to keep to one.
            stream.codec_context.thread_count = int(os.environ.get("OMP_NUM_THREADS") == "1")
            yield container
    except av.error.FFmpegError as error:
        raise damaged(path, error.strerror or "decoding failed") from error


def _decoded(container: "av.container.InputContainer", path: Path) -> Iterator["av.VideoFrame"]:
    stream = container.streams.video[0]
    for packet in container.demux(stream):
        if packet.is_corrupt:  # a file cut off inside this packet
            yield from stream.decode(None)  # the whole ones that the decoder still holds
            raise damaged(path, "it ends in the middle of a frame")
        yield from packet.decode()


def _uneven(container: "av.container.InputContainer") -> bool | None:
    """Whether the distances between frames differ by more than the clock's ticks explain."""
    times: list[int] = []
    for packet in container.demux(container.streams.video[0]):
        if not packet.size:  # the end
            break
        if packet.pts is None:
            return None
        times.append(packet.pts)
        if len(times) == _TIMED_PACKETS:
            break
    # The last few are left out: frames they precede in time may not have been read yet.
    steps: np.ndarray = np.diff(np.sort(times)[: max(3, len(times) - 16)])
    return bool(steps.max() - steps.min() > max(1, 0.1 * np.median(steps))) if len(steps) else None


def _no_video(path: Path) -> ImageFileError:
    return ImageFileError("a video", f"{path} without video frames", "give another file")


def _check(path: Path, width: int, height: int) -> None:
    check_size(path, width, height, MAX_VIDEO_PIXELS)
    if min(width, height) < MIN_SIDE:
        expected = f"a video of at least {MIN_SIDE} pixels a side"
        raise ImageFileError(expected, f"{path} of {width} x {height}", "use a larger video")


def _upright(values: np.ndarray, frame: "av.VideoFrame") -> np.ndarray:
    # The turn that brings the frame upright, in degrees anticlockwise: what rot90 takes.
    return np.rot90(values, round(frame.rotation / 90))


def _pixels(frame: "av.VideoFrame") -> UInt8[np.ndarray, "height width 3"]:
    import cv2

    return np.asarray(cv2.merge(_channels(frame)))


def _channels(frame: "av.VideoFrame") -> tuple[UInt8[np.ndarray, "height width"], ...]:
    """Red, green and blue, as stored."""
    transfer = HDR_TRANSFERS.get(int(frame.color_trc))
    matrix = int(frame.colorspace)
    if matrix == UNSPECIFIED:
        tall = min(frame.width, frame.height) >= 720
        matrix = BT2020 if transfer else ITU709 if tall else ITU601
    converter = _converter(get_ident())
    if transfer:
        signal = converter.reformat(frame, format="rgb48le", src_colorspace=matrix).to_ndarray()
        return tuple(np.moveaxis(video_colour.sdr_pixels(signal, transfer), -1, 0))
    # In planes FFmpeg's exact way takes less than half of what it takes for packed RGB.
    planar = converter.reformat(frame, format="gbrp", src_colorspace=matrix, interpolation=_EXACT)
    return tuple(_samples(planar, plane, np.uint8) for plane in (2, 0, 1))


def _samples(frame: "av.VideoFrame", plane: int, kind: Any) -> np.ndarray:
    """One full-size plane of a frame, which it keeps alive; not copied."""
    rows: np.ndarray = np.frombuffer(memoryview(frame.planes[plane]), kind)
    return rows.reshape(frame.height, -1)[:, : frame.width]


@lru_cache(maxsize=16)
def _converter(thread: int) -> "av.video.reformatter.VideoReformatter":  # noqa: ARG001
    """FFmpeg's converter of one thread, kept: setting one up for every frame takes time."""
    from av.video.reformatter import VideoReformatter

    return VideoReformatter()


def _luma(frame: "av.VideoFrame") -> UInt8[np.ndarray, "height width"]:
    """The Y plane at full range; cheap, because colours are left alone."""
    raw = _raw_luma(frame)
    if raw is None:  # RGB and rarities
        return np.round(_pixels(frame) @ LUMINANCE).astype(np.uint8)
    rows, table, shift = raw
    if rows.itemsize > 1:
        return table[(rows >> shift) & (len(table) - 1)]
    import cv2

    return np.asarray(cv2.LUT(rows, table))  # three times as fast as an index


def _raw_luma(frame: "av.VideoFrame") -> tuple[np.ndarray, np.ndarray, int] | None:
    """The Y plane as stored, the grey of each sample, and how far up a sample's bits lie."""
    layout = _PLANAR.get(frame.format.name)
    if layout is None:
        return None
    bits, shift = layout
    rows = _samples(frame, 0, np.uint8 if bits == 8 else np.dtype("<u2"))
    full = int(frame.color_range) == FULL_RANGE or frame.format.name.startswith(("yuvj", "gray"))
    return rows, _luma_table(bits, full, HDR_TRANSFERS.get(int(frame.color_trc))), shift


@lru_cache(maxsize=16)
def _luma_table(bits: int, full: bool, transfer: str | None) -> UInt8[np.ndarray, "n"]:
    """The 8-bit SDR grey of each luma sample."""
    unit = 1 << (bits - 8)
    low, span = (0, 256 * unit - 1) if full else (16 * unit, 219 * unit)
    signal = np.clip((np.arange(256 * unit) - low) / span, 0, 1)
    if transfer is None:
        return np.round(signal * 255).astype(np.uint8)
    wide: UInt16[np.ndarray, "1 n"] = np.round(signal * video_colour.SIGNAL_MAX)[None]
    return video_colour.sdr_luma(wide.astype(np.uint16), transfer)[0]
