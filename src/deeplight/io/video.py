"""Video files as a stream of upright pictures."""

import math
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jaxtyping import UInt8

from deeplight.errors import ImageFileError, MissingExtraError
from deeplight.io.boundary import reading
from deeplight.io.exif import camera_name
from deeplight.io.image_file import check_size, damaged, first_bytes
from deeplight.io.photo_decoders import MIN_SIDE
from deeplight.io.photos import Photo
from deeplight.io.video_frame import TRANSFERS, Appearance, Picture

if TYPE_CHECKING:
    import av

MAX_VIDEO_PIXELS = 36_000_000
"""Of a frame: 8K has 33 million. Some frames are in memory at once, so less than of a photo."""

VIDEO_SUFFIXES = frozenset(".avi .m4v .mkv .mov .mp4 .mpg .webm".split())

PLAYABLE = (
    "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpeg,mpegts,mpegvideo,m4v,h264,hevc,av1,obu,ivf,"
    "asf,flv,ogg,mxf,dv,nut,rm,wtv,yuv4mpegpipe"
)
"""FFmpeg's readers of films. Its others read lists of files (ffconcat, HLS, DASH, numbered
pictures): a "film" that opens what lies next to it, or an address."""

_OF_PICTURES = frozenset("bmp gif jpeg2000 jpegls mjpeg png tiff webp".split())
"""Codecs of still pictures: such a stream is the film only where there is no other."""

_WITH_ALPHA = {"vp8": "libvpx", "vp9": "libvpx-vp9"}
"""FFmpeg's decoders that give a WebM's alpha, of those it takes by itself."""

_CAMERAS = (
    ("com.apple.quicktime.make", "com.apple.quicktime.model"),
    ("com.android.manufacturer", "com.android.model"),
    ("make", "model"),
)
"""Entries with a camera's make and model: iPhone's, Android's, others'."""

_DEFAULT, _PICTURES = 1, 1024 | 2048  # FFmpeg's AV_DISPOSITION: default; cover, thumbnails
_TIMED_PACKETS = 900  # how far `facts` looks for an uneven frame rate


@dataclass(frozen=True, eq=False)
class VideoFrame:
    """One frame of a video, upright, with square pixels.

    Attributes:
        number: position in the file, from 0.
        time_s: when it is shown.
        lost: damaged frames right before it, which are left out and not counted.
    """

    number: int
    time_s: float
    _picture: Picture = field(repr=False)
    lost: int = 0

    @cached_property
    def luma(self) -> UInt8[np.ndarray, "height width"]:
        """Grey, gamma-encoded, full range, row by row in memory; HDR is brought to SDR."""
        return np.ascontiguousarray(self._picture.luma())

    def averaged_luma(
        self, average: Callable[[np.ndarray], np.ndarray]
    ) -> UInt8[np.ndarray, "h w"]:
        """Give `average(luma)`, but for rounding, without the cost of all of `luma`.

        Means of pixels are taken of the samples as they are stored; of HDR that is before it is
        brought to SDR.
        """
        raw = self._picture.raw_luma()
        if raw is None:
            return average(self.luma)
        samples, table, shift = raw
        upright = self._picture.look.upright(samples)
        return table[(average(upright) >> shift) & (len(table) - 1)]

    def rgb(self) -> UInt8[np.ndarray, "height width 3"]:
        """The colours, gamma-encoded sRGB; converted when asked for.

        HLG and PQ become SDR on the scale of `io.colour`, wide gamuts sRGB's.
        """
        return self._picture.rgb()

    def channels(self) -> tuple[UInt8[np.ndarray, "height width"], ...]:
        """Red, green and blue of `rgb`, one array each, in two thirds of the time."""
        return self._picture.channels()

    @property
    def notes(self) -> tuple[str, ...]:
        """What had to be decided about its colours, one short line each."""
        look, space = self._picture.look, self._picture.look.colour_space
        lost = (f"damaged frames before it, left out: {self.lost}",) if self.lost else ()
        seen = ("transparent parts taken as mid-grey",) if self._picture.has_alpha else ()
        notes = (*lost, *seen)
        if look.hdr:
            return (*notes, f"{look.hdr} video, brought to SDR: reference white is 1.0")
        return (*notes, f"{space.name} video, converted to sRGB") if space else notes


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
        mirrored: stored frames are mirror images, to be mirrored before that turn.
        variable_rate: frames are unevenly spaced; None if times are missing.
        camera: make and model, where its metadata name them; else empty.
        sound: whether it has any.
    """

    width: int
    height: int
    rate_hz: float | None
    frames: int | None
    duration_s: float | None
    codec: str
    transfer: str
    rotation_deg: int
    mirrored: bool
    variable_rate: bool | None
    camera: str = ""
    sound: bool = False


class Film(NamedTuple):
    """An opened file, the stream that is the film, its decoder, and how it is to be shown."""

    container: "av.container.InputContainer"
    stream: "av.VideoStream"
    decoder: Any
    look: Appearance


def is_video(path: Path | str) -> bool:
    """Return whether, by its suffix, `path` is a video."""
    return Path(path).suffix.lower() in VIDEO_SUFFIXES


def frames(path: Path | str) -> Iterator[Photo]:
    """Decode a video frame by frame into photos; memory does not grow with its length.

    As `video_frames`, which says what is honoured and what is raised. `Photo.notes` says where HDR
    was brought to SDR.
    """
    for still in video_frames(path):
        with reading(path):
            pixels = still.rgb()
        yield Photo(pixels=pixels, source=Path(path), notes=still.notes)


def video_frames(path: Path | str, from_s: float = -math.inf) -> Iterator[VideoFrame]:
    """Decode a video frame by frame; memory does not grow with its length.

    From a time on (`from_s`) the same frames are given as without it, but counted from the first of
    them; what lies before is sprung over where the file allows that.

    Honoured are the display matrix (phones film portrait lying down, front cameras mirrored),
    pixels that are not square, limited and full range, 10 bits, and presentation times. Colours are
    what the frames say, else what the container says (`io.colour`); without a colour matrix it is
    BT.709 from 720 lines on and BT.601 below, as players do. A cover picture is not the film.

    Raises:
        OSError: there is no such file, it is a folder, or reading it is not permitted.
        ImageFileError: no video in it, truncated, frames too small or too large, or a list of other
            files; a fault in the middle is raised where it is met, after the frames before it.
        MissingExtraError: the `capture` extra is not installed.
    """
    path = Path(path)
    if from_s > 0 and _lands_before(path, from_s):
        yield from _frames_from(path, from_s, spring=True)
    else:
        yield from _frames_from(path, from_s, spring=False)


def _lands_before(path: Path, from_s: float) -> bool:
    """Whether springing to a time ends at a frame before it, or at it."""
    try:
        with opened(path) as film:
            _spring(film, from_s)
            first = next(_decoded(film, path), None)
            return first is not None and first.pts is not None and first.time <= from_s
    except ImageFileError:
        return False


def _spring(film: Film, to_s: float) -> None:
    ticks = int(to_s / film.stream.time_base) if film.stream.time_base else 0
    film.container.seek(ticks, stream=film.stream, backward=True)


def _frames_from(path: Path, from_s: float, spring: bool) -> Iterator[VideoFrame]:
    count, skipped, lost, size = 0, 0, 0, None
    with opened(path) as film:
        if spring:
            _spring(film, from_s)
        rate = film.stream.average_rate
        for frame in _decoded(film, path):
            # Made up by the decoder for damaged data, or drawn from such a frame.
            if frame.is_corrupt or (lost and not frame.key_frame):
                lost += 1
                continue
            _check(path, frame, film.look)
            size = size or (frame.width, frame.height)
            if size != (frame.width, frame.height):
                raise damaged(path, "its frames change their size")
            in_all = count + skipped
            time_s = math.nan if frame.pts is None else float(frame.time)
            if not math.isfinite(time_s):  # a broken clock gives no number, too
                time_s = in_all / float(rate or 30)
            if time_s < from_s:
                skipped, lost = skipped + 1, 0
                continue
            yield VideoFrame(count, time_s, Picture(frame, film.look), lost)
            count, lost = count + 1, 0
    if not count + skipped:
        raise damaged(path, "no frame of it is whole") if lost else _no_video(path)


def facts(path: Path | str) -> VideoFacts:
    """Size, rate and kind of a video, without decoding more than its first frame.

    Raises:
        OSError, ImageFileError, MissingExtraError: as `video_frames`.
    """
    path = Path(path)
    with opened(path) as film:
        frame = next(_decoded(film, path), None)
        if frame is None:
            raise _no_video(path)
        _check(path, frame, film.look)
        look = film.look.with_frame(frame)
        stream = film.stream
        rate, ticks = stream.average_rate, stream.duration
        length = ticks * stream.time_base if ticks and stream.time_base else None
        claimed, codec = stream.frames or None, stream.codec_context.name
        camera, sound = _camera(film.container.metadata), bool(film.container.streams.audio)
    with opened(path) as film:  # again: the first frame has consumed packets
        uneven = _uneven(film)
    height, width = look.upright(np.empty((frame.height, frame.width), np.uint8)).shape
    return VideoFacts(
        width=width,
        height=height,
        rate_hz=float(rate) if rate else None,
        frames=claimed,
        duration_s=float(length) if length else None,
        codec=codec,
        transfer=TRANSFERS.get(look.transfer, "unspecified"),
        rotation_deg=look.rotation_deg,
        mirrored=look.mirrored,
        variable_rate=uneven,
        camera=camera,
        sound=sound,
    )


def _camera(metadata: Mapping[str, str]) -> str:
    """The camera that a film's own metadata name."""
    for make, model in _CAMERAS:
        if metadata.get(model):
            return camera_name(metadata.get(make), metadata[model])
    return ""


@contextmanager
def opened(path: Path) -> Iterator[Film]:
    """The file's film; everything FFmpeg says becomes one error.

    Raises:
        OSError, ImageFileError, MissingExtraError: as `video_frames`.
    """
    start = first_bytes(path, 4096)
    try:
        import av
    except ImportError as error:
        raise MissingExtraError("capture", f"reading {path.name}") from error
    # FFmpeg looks into a few frames already when it opens a file, and a header may lie.
    limit = {"max_pixels": str(MAX_VIDEO_PIXELS)}
    only_this = {"protocol_whitelist": "file", "format_whitelist": PLAYABLE}
    with reading(path):
        try:
            # Without "file:" a name such as take:1.mp4 is taken for an address. Tags of the file
            # may be in any old encoding.
            address = f"file:{path}"
            with av.open(
                address, options=limit | only_this, metadata_errors="replace"
            ) as container:
                stream = _film_of(container)
                if stream is None:
                    raise _no_video(path)
                _check_header(path, stream)
                look = Appearance.of_stream(stream)
                decoder = _decoder_of(stream)
                decoder.options = limit
                decoder.thread_type = "AUTO"
                # 0 is as many as there are cores; a worker next to others has to keep to one.
                one = os.environ.get("OMP_NUM_THREADS") == "1"
                decoder.thread_count = int(one)
                yield Film(container, stream, decoder, look)
        except av.error.FFmpegError as error:
            if _is_text(start):
                expected, got = "a video", f"{path}, a text: a playlist or list of other files?"
                raise ImageFileError(expected, got, "give the video itself") from error
            raise damaged(path, error.strerror or "decoding failed") from error


def _film_of(container: "av.container.InputContainer") -> "av.VideoStream | None":
    """The stream to watch: not a cover or thumbnail, the one that players start with."""
    films = [
        stream
        for stream in container.streams.video
        if stream.codec_context is not None and not int(stream.disposition) & _PICTURES
    ]
    # A picture may lie there as a track like any other, in Matroska even marked as the default.
    films.sort(key=lambda stream: not int(stream.disposition) & _DEFAULT)
    films.sort(key=lambda stream: stream.codec_context.name in _OF_PICTURES)
    return next(iter(films), None)


def _decoder_of(stream: "av.VideoStream") -> Any:
    """The stream's own decoder, or the one that gives its alpha, too."""
    import av

    other = _WITH_ALPHA.get(stream.codec_context.name)
    if stream.metadata.get("alpha_mode") != "1" or other not in av.codecs_available:
        return stream.codec_context
    return av.VideoCodecContext.create(other, "r")


def _check_header(path: Path, stream: "av.VideoStream") -> None:
    check_size(path, stream.width, stream.height, MAX_VIDEO_PIXELS)
    if not stream.width:
        expected = f"a video of at most {MAX_VIDEO_PIXELS / 1e6:.0f} megapixels a frame"
        raise ImageFileError(expected, f"{path}, larger or damaged", "make it smaller")


def _is_text(start: bytes) -> bool:
    """Text in any encoding: films have control characters within their first bytes."""
    if start.startswith((b"\xff\xfe", b"\xfe\xff")):
        return True
    return not any(byte < 9 or 13 < byte < 32 for byte in start)


def _decoded(film: Film, path: Path) -> Iterator["av.VideoFrame"]:
    for packet in film.container.demux(film.stream):
        if packet.is_corrupt:  # a file cut off inside this packet
            yield from film.decoder.decode(None)  # the whole ones that the decoder still holds
            raise damaged(path, "it ends in the middle of a frame")
        yield from film.decoder.decode(packet)


def _uneven(film: Film) -> bool | None:
    """Whether the distances between frames differ by more than the clock's ticks explain."""
    times: list[int] = []
    for packet in film.container.demux(film.stream):
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


def _check(path: Path, frame: "av.VideoFrame", look: Appearance) -> None:
    if not look.is_converted(frame):
        got = f"{path} of colour matrix {int(frame.colorspace)} (H.273), as few are"
        raise ImageFileError("a video in Y'CbCr or RGB", got, "convert it to BT.709")
    width, height = look.square(frame.width, frame.height)
    check_size(path, width, height, MAX_VIDEO_PIXELS)
    if min(width, height) < MIN_SIDE:
        expected = f"a video of at least {MIN_SIDE} pixels a side"
        raise ImageFileError(expected, f"{path} of {width} x {height}", "use a larger video")
