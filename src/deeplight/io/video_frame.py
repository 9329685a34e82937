"""From a decoded frame to upright pixels: its colours, its turn, the shape of its pixels."""

from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property, lru_cache
from threading import get_ident
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from jaxtyping import UInt8, UInt16

from deeplight.camera_response import LUMINANCE
from deeplight.io.colour import (
    HDR_TRANSFERS,
    SIGNAL_MAX,
    ColourSpace,
    from_cicp,
    over_grey,
    sdr_luma,
)
from deeplight.io.exif import upright

if TYPE_CHECKING:
    import av

# ITU-T H.273's numbers, which are FFmpeg's AVCOL_SPC, _PRI and _TRC
ITU601, ITU709, UNSPECIFIED, BT2020, LINEAR = 5, 1, 2, 9, 8
CONVERTED = frozenset((*range(8), BT2020))
"""Matrices that FFmpeg turns into RGB: not YCgCo, ICtCp and BT.2020 of constant luminance."""
TRANSFERS = {1: "BT.709", 6: "BT.601", 13: "sRGB", **HDR_TRANSFERS}
FULL_RANGE = 2  # FFmpeg's AVCOL_RANGE numbers, of which 0 is "unspecified"

MAX_STRETCH = 4
"""A pixel longer than this is a damaged header, not a shape."""

# FFmpeg's SWS_BILINEAR, _ACCURATE_RND and _FULL_CHR_H_INT: its faster ways are up to 2 levels dark.
_EXACT = 2 | 0x40000 | 0x2000
# Bits of a luma sample and how far up in its 16 they lie, by the pixel format's name.
_PLANAR = {f"yuv{j}{s}p": (8, 0) for j in ("", "j") for s in ("420", "422", "444")}
_PLANAR |= {f"yuv{s}p{b}le": (b, 0) for s in ("420", "422", "444") for b in (10, 12)}
_PLANAR |= {"nv12": (8, 0), "nv21": (8, 0), "p010le": (10, 6), "gray": (8, 0)}

# EXIF's orientation of a display matrix a b, c d: a stored (x, y) is shown at (ax + cy, bx + dy).
_ORIENTATIONS = {
    (1, 0, 0, 1): 1,
    (-1, 0, 0, 1): 2,
    (-1, 0, 0, -1): 3,
    (1, 0, 0, -1): 4,
    (0, 1, 1, 0): 5,
    (0, 1, -1, 0): 6,
    (0, -1, -1, 0): 7,
    (0, -1, 1, 0): 8,
}
_TURNS = {1: 0, 2: 0, 3: 180, 4: 180, 5: 90, 6: 270, 7: 270, 8: 90}


@dataclass(frozen=True)
class Appearance:
    """How a stream's frames are to be shown; what a frame says itself goes first.

    Attributes:
        primaries, transfer, matrix: H.273's numbers; 2 where neither frame nor container says.
        full_range: luma goes from 0 to the top.
        orientation: EXIF's 1 to 8, of the display matrix.
        pixel_aspect: width over height of a stored pixel.
    """

    primaries: int = UNSPECIFIED
    transfer: int = UNSPECIFIED
    matrix: int = UNSPECIFIED
    full_range: bool = False
    orientation: int = 1
    pixel_aspect: Fraction = Fraction(1)

    @classmethod
    def of_stream(cls, stream: "av.VideoStream") -> Self:
        """What the container says; to be asked before the first frame is decoded."""
        context = stream.codec_context
        return cls(
            int(context.color_primaries),
            int(context.color_trc),
            int(context.colorspace),
            int(context.color_range) == FULL_RANGE,
            pixel_aspect=_aspect(stream.sample_aspect_ratio or context.sample_aspect_ratio),
        )

    def with_frame(self, frame: "av.VideoFrame") -> "Appearance":
        """The same with what the frame says."""
        said = int(frame.color_range)
        return Appearance(
            _said(int(frame.color_primaries), self.primaries),
            _said(int(frame.color_trc), self.transfer),
            _said(int(frame.colorspace), self.matrix),
            said == FULL_RANGE if said else self.full_range,
            _orientation(frame),
            self.pixel_aspect,
        )

    def is_converted(self, frame: "av.VideoFrame") -> bool:
        """Whether a frame's colours can be turned into RGB."""
        matrix = _said(int(frame.colorspace), self.matrix)
        return matrix in CONVERTED or frame.format.is_rgb or len(frame.format.components) < 3

    @property
    def hdr(self) -> str | None:
        """ "HLG" or "PQ"; None for SDR."""
        return HDR_TRANSFERS.get(self.transfer)

    @property
    def colour_space(self) -> ColourSpace | None:
        """What the pixels mean; None if they are sRGB's. Players show all SDR curves as one."""
        if self.hdr:
            return from_cicp(
                BT2020 if self.primaries == UNSPECIFIED else self.primaries, self.transfer
            )
        return from_cicp(self.primaries, LINEAR if self.transfer == LINEAR else UNSPECIFIED)

    @property
    def rotation_deg(self) -> int:
        """The anticlockwise turn that brings stored frames, mirrored first, upright."""
        return _TURNS[self.orientation]

    @property
    def mirrored(self) -> bool:
        """Stored frames are mirror images."""
        return self.orientation in (2, 4, 5, 7)

    def square(self, width: int, height: int) -> tuple[int, int]:
        """Width and height of stored frames once their pixels are square; never fewer pixels."""
        if self.pixel_aspect >= 1:
            return round(width * self.pixel_aspect), height
        return width, round(height / self.pixel_aspect)

    def upright(self, values: np.ndarray) -> np.ndarray:
        """Stored values with square pixels and upright."""
        height, width = values.shape[:2]
        size = self.square(width, height)
        if size != (width, height):
            import cv2

            values = cv2.resize(values, size, interpolation=cv2.INTER_LINEAR)
        return upright(values, self.orientation)


@dataclass(frozen=True, eq=False)
class Picture:
    """The pixels of one frame; converted when asked for.

    Attributes:
        frame: as decoded.
        look: of its stream.
    """

    frame: "av.VideoFrame"
    stream: Appearance

    @cached_property
    def look(self) -> Appearance:
        """How this frame is to be shown."""
        return self.stream.with_frame(self.frame)

    @property
    def has_alpha(self) -> bool:
        """Parts of the frame may be transparent."""
        return any(component.is_alpha for component in self.frame.format.components)

    def channels(self) -> tuple[UInt8[np.ndarray, "height width"], ...]:
        """Red, green and blue, upright, gamma-encoded sRGB."""
        return tuple(self.look.upright(channel) for channel in self._stored_channels())

    def rgb(self) -> UInt8[np.ndarray, "height width 3"]:
        """The same in one array."""
        import cv2

        return self.look.upright(np.asarray(cv2.merge(self._stored_channels())))

    def luma(self) -> UInt8[np.ndarray, "height width"]:
        """Grey at full range, upright; cheap, because colours are left alone."""
        raw = self.raw_luma()
        if raw is None:  # RGB and rarities
            return np.round(self.rgb() @ LUMINANCE).astype(np.uint8)
        rows, table, shift = raw
        if rows.itemsize > 1:
            return self.look.upright(table[(rows >> shift) & (len(table) - 1)])
        import cv2

        return self.look.upright(
            np.asarray(cv2.LUT(rows, table))
        )  # three times as fast as an index

    def raw_luma(self) -> tuple[np.ndarray, np.ndarray, int] | None:
        """The Y plane as stored, the grey of each sample, and how far up a sample's bits lie."""
        name = self.frame.format.name
        layout = _PLANAR.get(name)
        if layout is None:
            return None
        bits, shift = layout
        rows = _samples(self.frame, 0, np.uint8 if bits == 8 else np.dtype("<u2"))
        full = self.look.full_range or name.startswith(("yuvj", "gray"))
        return rows, _luma_table(bits, full, self.look.transfer if self.look.hdr else None), shift

    def _stored_channels(self) -> tuple[UInt8[np.ndarray, "height width"], ...]:
        frame, look, space = self.frame, self.look, self.look.colour_space
        matrix = look.matrix
        if matrix == UNSPECIFIED:
            tall = min(frame.width, frame.height) >= 720
            matrix = BT2020 if look.hdr else ITU709 if tall else ITU601
        source: dict[str, Any] = {"src_colorspace": matrix}
        if look.full_range:
            source["src_color_range"] = FULL_RANGE
        convert = _converter(get_ident()).reformat
        if space is not None:
            signal = convert(frame, format="rgb48le", **source).to_ndarray()
            channels = tuple(np.moveaxis(space.pixels(signal), -1, 0))
        else:
            # In planes FFmpeg's exact way takes less than half of what it takes for packed RGB.
            planar = convert(frame, format="gbrp", interpolation=_EXACT, **source)
            channels = tuple(_samples(planar, plane, np.uint8) for plane in (2, 0, 1))
        if not self.has_alpha:
            return channels
        cover = _samples(convert(frame, format="gbrap", **source), 3, np.uint8)
        return tuple(over_grey(channel, cover) for channel in channels)


def _said(by_frame: int, by_container: int) -> int:
    return by_container if by_frame == UNSPECIFIED else by_frame


def _aspect(ratio: Fraction | None) -> Fraction:
    """Width over height of a pixel; square if it says nothing, nonsense, or half a percent."""
    if not ratio or not 1 / MAX_STRETCH <= ratio <= MAX_STRETCH or abs(ratio - 1) < 0.005:
        return Fraction(1)
    return Fraction(ratio)


def _orientation(frame: "av.VideoFrame") -> int:
    """EXIF's number for the frame's display matrix, that of the nearest quarter turn."""
    from av.sidedata.sidedata import SideDataContainer

    # `frame.side_data` would be kept by the frame that it keeps: megabytes that wait for gc.
    found: Any = SideDataContainer(frame).get("DISPLAYMATRIX")  # type: ignore[call-arg]
    if found is None:
        return 1
    matrix = np.frombuffer(bytes(found), np.int32)[[0, 1, 3, 4]]
    if matrix.size != 4 or not matrix.any():
        return 1
    a, b, c, d = (float(value) for value in matrix)
    if abs(a) + abs(d) >= abs(b) + abs(c):
        b = c = 0.0
    else:
        a = d = 0.0
    key = tuple(int(np.sign(value)) for value in (a, b, c, d))
    return _ORIENTATIONS.get(key, 1)  # type: ignore[arg-type]


def _samples(frame: "av.VideoFrame", plane: int, kind: Any) -> np.ndarray:
    """One full-size plane of a frame, which it keeps alive; not copied."""
    rows: np.ndarray = np.frombuffer(memoryview(frame.planes[plane]), kind)
    return rows.reshape(frame.height, -1)[:, : frame.width]


@lru_cache(maxsize=16)
def _converter(thread: int) -> "av.video.reformatter.VideoReformatter":  # noqa: ARG001
    """FFmpeg's converter of one thread, kept: setting one up for every frame takes time."""
    from av.video.reformatter import VideoReformatter

    return VideoReformatter()


@lru_cache(maxsize=16)
def _luma_table(bits: int, full: bool, hdr: int | None) -> UInt8[np.ndarray, "n"]:
    """The 8-bit SDR grey of each luma sample; `hdr` is the number of an HDR curve."""
    unit = 1 << (bits - 8)
    low, span = (0, 256 * unit - 1) if full else (16 * unit, 219 * unit)
    signal = np.clip((np.arange(256 * unit) - low) / span, 0, 1)
    if hdr is None:
        return np.round(signal * 255).astype(np.uint8)
    wide: UInt16[np.ndarray, "1 n"] = np.round(signal * SIGNAL_MAX)[None].astype(np.uint16)
    return sdr_luma(wide, hdr)[0]
