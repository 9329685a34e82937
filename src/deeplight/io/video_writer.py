"""Write a video as phones do: lying down with rotation metadata, frames at uneven times, HLG."""

import platform
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self, cast

import numpy as np
from jaxtyping import Shaped

from deeplight.errors import ConfigError, MissingExtraError
from deeplight.io.atomic import replacing

if TYPE_CHECKING:
    import av

CODECS = ("libx264", "libx265")
TICKS = 90_000  # a second; what phones use for uneven frame times

_BT709, _BT2020, _HLG, _LIMITED = 1, 9, 18, 1  # FFmpeg's numbers


def require_video(needed_for: str) -> None:
    """Raise MissingExtraError unless videos can be written."""
    try:
        import av  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("capture", needed_for) from error


class VideoWriter:
    """An .mp4 that appears whole when the `with` block ends, and not at all after an error.

    "libx264" takes 8-bit pixels and writes H.264 in BT.709, limited range. "libx265" takes the
    16-bit HLG signal in BT.2020 of `colour.hlg_pixels` and writes 10-bit HEVC. One thread:
    the same pictures give the same bytes.
    """

    def __init__(
        self,
        path: Path | str,
        width: int,
        height: int,
        rate: float,
        codec: str = "libx264",
        rotation_deg: int = 0,
        quality: int = 21,
    ) -> None:
        """Settings; nothing is opened before the `with` block.

        Args:
            path: where to.
            width, height: of the upright picture, even.
            rate: frames a second, nominally.
            codec: of `CODECS`.
            rotation_deg: 0, 90, 180 or 270: frames are stored turned clockwise by it, and the
                header has players turn them back.
            quality: the encoder's CRF; a lower number is a larger file.

        Raises:
            ConfigError: an odd or tiny size, another codec, a turn that is no quarter.
        """
        if width % 2 or height % 2 or min(width, height) < 32 or rate <= 0:
            got = f"{width} x {height} at {rate:g}"
            raise ConfigError("an even size of at least 32 pixels and a rate", got, "change it")
        if codec not in CODECS or rotation_deg % 90:
            got = f"{codec}, {rotation_deg} degrees"
            raise ConfigError(f"a codec of {', '.join(CODECS)} and quarter turns", got, "change it")
        self._rate, self._codec, self._quality = rate, codec, quality
        self._turns = rotation_deg // 90 % 4
        self._size = (width, height) if self._turns % 2 == 0 else (height, width)
        self._replacing = replacing(path)
        self._path = Path(path)
        self._count = 0

    def __enter__(self) -> Self:
        require_video(f"writing {self._path.name}")
        import av

        temporary = self._replacing.__enter__()
        try:
            self._container = av.open(str(temporary), "w", format="mp4")
            self._stream = self._add_stream()
        except BaseException as error:
            self._replacing.__exit__(type(error), error, error.__traceback__)
            raise
        return self

    def write(
        self, picture: Shaped[np.ndarray, "height width 3"], time_s: float | None = None
    ) -> None:
        """Add an upright frame, shown at `time_s`, or one frame's time after the last."""
        import av

        hdr = self._codec == "libx265"
        stored = np.ascontiguousarray(np.rot90(picture, -self._turns))
        frame = av.VideoFrame.from_ndarray(stored, format="rgb48le" if hdr else "rgb24")
        frame = frame.reformat(
            format=self._stream.pix_fmt,
            dst_colorspace=_BT2020 if hdr else _BT709,
            dst_color_range=_LIMITED,
        )
        at = self._count / self._rate if time_s is None else time_s
        frame.pts, frame.time_base = round(at * TICKS), Fraction(1, TICKS)
        self._count += 1
        self._container.mux(self._stream.encode(frame))

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            if error is None:
                self._container.mux(self._stream.encode())
            self._container.close()
        except BaseException as late:
            self._replacing.__exit__(type(late), late, late.__traceback__)
            raise
        self._replacing.__exit__(kind, error, trace)

    def _add_stream(self) -> "av.VideoStream":
        options = {"crf": str(self._quality), "preset": "veryfast", "threads": "1"}
        hdr = self._codec == "libx265"
        if not hdr and self._size[0] % 64 and platform.machine() in ("x86_64", "AMD64"):
            # x264's wider kernels read past rows of other widths, into whatever lies there:
            # the same pictures would not give the same bytes.
            options["x264-params"] = "asm=MMX2,SSE2,SSE3,SSSE3,SSE4.1,SSE4.2,AVX"
        if hdr:
            options |= {"preset": "ultrafast", "tag": "hvc1"}
            options["x265-params"] = "log-level=error:pools=none:frame-threads=1"
        rate = Fraction(self._rate).limit_denominator(1001)
        added = self._container.add_stream(self._codec, rate=rate, options=options)
        stream = cast("av.VideoStream", added)
        stream.width, stream.height = self._size
        stream.pix_fmt = "yuv420p10le" if hdr else "yuv420p"
        context = stream.codec_context
        context.time_base = Fraction(1, TICKS)
        context.color_range = _LIMITED
        context.colorspace = context.color_primaries = _BT2020 if hdr else _BT709
        context.color_trc = _HLG if hdr else _BT709
        if self._turns:
            stream.set_display_rotation(90.0 * self._turns)
        return stream
