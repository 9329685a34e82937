"""Metadata tracks of camera motion as CAMM and GPMF lay them out, put into a clip's file."""

import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from deeplight.frames import Rotation

DOWN_AXES = np.diag([1.0, -1.0, -1.0])  # both formats': X right, Y down, Z forward
TICKS = 1000  # a second


def box(name: bytes, *parts: bytes) -> bytes:
    content = b"".join(parts)
    return struct.pack(">I4s", 8 + len(content), name) + content


def full(name: bytes, *parts: bytes) -> bytes:
    return box(name, bytes(4), *parts)


def add_track(path: Path, entry: bytes, samples: Sequence[bytes], step_s: float) -> Path:
    """Append a timed-metadata track (ISO/IEC 14496-12) to an MP4 whose moov stands last."""
    content = path.read_bytes()
    at, boxes = 0, {}
    while at < len(content):
        size, name = struct.unpack_from(">I4s", content, at)
        boxes[name], at = at, at + size
    assert max(boxes, key=lambda name: boxes[name]) == b"moov"
    moov = content[boxes[b"moov"] + 8 :]
    whole = 8 + len(moov) + len(_trak(entry, samples, step_s, 0))
    trak = _trak(entry, samples, step_s, boxes[b"moov"] + whole + 8)
    start = content[: boxes[b"moov"]]
    path.write_bytes(start + box(b"moov", moov, trak) + box(b"mdat", *samples))
    return path


def _trak(entry: bytes, samples: Sequence[bytes], step_s: float, offset: int) -> bytes:
    count, step = len(samples), round(step_s * TICKS)
    length = struct.pack(">I", count * step)
    one = struct.pack(">I", 1)
    matrix = struct.pack(">9i", 1 << 16, 0, 0, 0, 1 << 16, 0, 0, 0, 1 << 30)
    tkhd = box(
        b"tkhd", b"\0\0\0\1", bytes(8), struct.pack(">I", 9), bytes(4), length, bytes(16),
        matrix, bytes(8),
    )  # fmt: skip
    mdhd = full(b"mdhd", bytes(8), struct.pack(">I", TICKS), length, bytes(4))
    hdlr = full(b"hdlr", bytes(4), b"meta", bytes(12), b"motion\0")
    stsd = full(b"stsd", one, box(entry, bytes(6), b"\0\1"))
    stts = full(b"stts", one, struct.pack(">2I", count, step))
    stsc = full(b"stsc", one, struct.pack(">3I", 1, count, 1))
    sizes = struct.pack(f">{count}I", *(len(sample) for sample in samples))
    stsz = full(b"stsz", bytes(4), struct.pack(">I", count), sizes)
    stco = full(b"stco", one, struct.pack(">I", offset))
    url = box(b"url ", b"\0\0\0\1")
    minf = box(
        b"minf", full(b"nmhd"), box(b"dinf", full(b"dref", one, url)),
        box(b"stbl", stsd, stts, stsc, stsz, stco),
    )  # fmt: skip
    return box(b"trak", tkhd, box(b"mdia", mdhd, hdlr, minf))


def camm(turn: Rotation) -> bytes:
    """A CAMM packet of type 0: world_from_camera, of which the world's Y points down, too."""
    matrix = DOWN_AXES @ turn @ DOWN_AXES
    angle = np.arccos(np.clip((np.trace(matrix) - 1) / 2, -1, 1))
    skew = np.array([matrix[2, 1], matrix[0, 2], matrix[1, 0]]) - [
        matrix[1, 2], matrix[2, 0], matrix[0, 1],
    ]  # fmt: skip
    return struct.pack("<HH3f", 0, 0, *(skew * angle / (2 * np.sin(angle) + 1e-12)))


def entry(key: bytes, kind: str, size: int, count: int, body: bytes) -> bytes:
    return struct.pack(">4scBH", key, kind.encode(), size, count) + body + bytes(-len(body) % 4)


def nest(key: bytes, *parts: bytes) -> bytes:
    body = b"".join(parts)
    return entry(key, "\0", 1, len(body), body)


def gpmf(turns: Sequence[Rotation], corrections: Sequence[Rotation], tilt: Rotation) -> bytes:
    """A GPMF payload of cameras turned `turns` in a world that `tilt` turns from the start's.

    Args:
        turns: world_from_picture, the world's +Y being up.
        corrections: picture_from_camera, the turn that stabilising adds, in our axes.
        tilt: world_from_start.
    """
    cori, iori, grav = [], [], []
    for turn, correction in zip(turns, corrections, strict=True):
        camera_from_start = (turn @ correction).T @ tilt
        cori.append(quaternion(DOWN_AXES @ camera_from_start @ DOWN_AXES))
        iori.append(quaternion(DOWN_AXES @ correction @ DOWN_AXES))
        grav.append(DOWN_AXES @ (turn @ correction).T @ [0, -1, 0])
    streams = [
        nest(b"STRM", entry(b"STNM", "c", 1, 5, b"Shown"), _scaled(key, np.array(values)))
        for key, values in ((b"CORI", cori), (b"IORI", iori), (b"GRAV", grav))
    ]
    other = nest(b"STRM", entry(b"SCAL", "s", 2, 1, b"\1\xa1"), entry(b"ACCL", "s", 6, 1, bytes(6)))
    return nest(b"DEVC", entry(b"DVNM", "c", 1, 6, b"Camera"), other, *streams)


def _scaled(key: bytes, values: np.ndarray) -> bytes:
    whole = np.round(values * 32767).astype(">i2").tobytes()
    scale = entry(b"SCAL", "s", 2, 1, struct.pack(">h", 32767))
    return scale + entry(key, "s", 2 * values.shape[1], len(values), whole)


def quaternion(matrix: Rotation) -> list[float]:
    """w, x, y, z of a rotation by less than half a turn."""
    w = np.sqrt(max(0.0, 1 + np.trace(matrix))) / 2
    skew = [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]
    return [float(w), *(float(part / (4 * w)) for part in skew)]
