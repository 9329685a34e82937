"""How the camera was turned while it filmed, from the video's own metadata track.

Two open formats are read, by the axes that their specifications give the camera: X right, Y down,
Z forward.

CAMM (Google, "Camera Motion Metadata Spec"): one little-endian packet per sample, of which those of
type 0 hold world_from_camera as an axis times its angle; the world's Y points down.

GPMF (GoPro, from HERO8 and MAX on): big-endian keys, lengths and values in nests. Per frame CORI is
a quaternion w, x, y, z: camera_from_start; IORI what stabilising turned the picture by in the
camera: picture_from_camera; GRAV the direction in which things fall, in the camera's axes.
(The specification names no axes. These are the ones with which a MAX's own film and its metadata
agree, and with which gravity stands still: see docs/fuse.md.)

A gyroscope alone (CAMM type 2, earlier GoPros) is not integrated: it drifts.
"""

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Float

from deeplight.frames import UP, exponential, from_quaternion, normalised, shortest_turn
from deeplight.io.image_file import damaged
from deeplight.io.video_data import DataPacket, data_tracks

_OURS = np.diag([1.0, -1.0, -1.0])
"""Axes X right, Y down, Z forward as ours: X right, Y up, -Z forward. Its own inverse."""
_CAMM_BYTES = {0: 16, 1: 12, 2: 16, 3: 16, 4: 16, 5: 28, 6: 60, 7: 16}
"""Of each type of CAMM packet, its four of header included."""
_NUMBERS = {"s": ">i2", "S": ">u2", "l": ">i4", "L": ">u4", "f": ">f4", "d": ">f8"}
"""GPMF's types of numbers that a quaternion, a vector or a scale may have."""
_KEYS = (b"CORI", b"IORI", b"GRAV")
_DEEPEST = 8
_UNIT = 0.05  # by which the length of a quaternion or a direction may miss 1


@dataclass(frozen=True, eq=False)
class CameraMotion:
    """The camera's rotations over time.

    Attributes:
        format: whose track it is.
        times_s: when, on the video's clock, growing.
        rotations: world_from_camera of the stored picture (which a phone may turn to stand
            upright): +X right, +Y up, -Z the view; the world's +Y is against gravity.
    """

    format: Literal["CAMM", "GPMF"]
    times_s: Float[np.ndarray, " samples"]
    rotations: Float[np.ndarray, "samples 3 3"]


def camera_motion_of(path: Path) -> CameraMotion | None:
    """Read the rotations that a video says its camera had; None where it says none.

    Raises:
        OSError, ImageFileError, MissingExtraError: the video cannot be read, or such a track of it
            is damaged.
    """
    for packets in data_tracks(path):
        try:
            if packets and packets[0].content.startswith(b"DEVC"):
                found = _of_gpmf(packets)
            elif _is_camm(packets):
                found = _of_camm(packets)
            else:
                continue
        except (ValueError, struct.error) as error:
            raise damaged(path, f"its track of camera motion: {error}") from error
        if found is not None:
            return found
    return None


def _is_camm(packets: Sequence[DataPacket]) -> bool:
    """By half of the packets: the first may be cut off."""
    ours = sum(_camm_type(packet.content) is not None for packet in packets)
    return 0 < ours >= len(packets) / 2


def _camm_type(content: bytes) -> int | None:
    """The type of a CAMM packet, None if it is none."""
    if len(content) < 4:
        return None
    reserved, kind = struct.unpack_from("<HH", content)
    return kind if reserved == 0 and _CAMM_BYTES.get(kind) == len(content) else None


def _of_camm(packets: Sequence[DataPacket]) -> CameraMotion | None:
    times, turns = [], []
    for packet in packets:
        kind = _camm_type(packet.content)
        if kind is None:
            raise ValueError(f"a CAMM packet of {len(packet.content)} bytes")
        if kind == 0:
            vector = np.array(struct.unpack_from("<3f", packet.content, 4))
            if not np.isfinite(vector).all():
                raise ValueError("an orientation that is no number")
            times.append(packet.time_s)
            turns.append(_OURS @ exponential(vector) @ _OURS)
    return _in_order("CAMM", times, turns)


def _of_gpmf(packets: Sequence[DataPacket]) -> CameraMotion | None:
    times, turns, down = [], [], np.zeros(3)
    for k, packet in enumerate(packets):
        found = dict(_entries(packet.content))
        if not all(key in found for key in _KEYS):
            continue
        camera, picture, gravity = (found[key] for key in _KEYS)
        if not len(camera) == len(picture) == len(gravity):
            counts = f"{len(camera)}, {len(picture)} and {len(gravity)}"
            raise ValueError(f"{counts} orientations, corrections and directions of gravity")
        length_s = packet.length_s or _until_next(packets, k)
        for n, (own, correction, falls) in enumerate(zip(camera, picture, gravity, strict=True)):
            start_from_camera = _turn(own).T
            down += start_from_camera @ _unit(falls)
            times.append(packet.time_s + length_s * n / len(camera))
            turns.append(_OURS @ start_from_camera @ _turn(correction).T @ _OURS)
    if not np.linalg.norm(down) > 0:
        return None
    level_from_start = shortest_turn(normalised(-_OURS @ down), UP)
    return _in_order("GPMF", times, [level_from_start @ turn for turn in turns])


def _until_next(packets: Sequence[DataPacket], k: int) -> float:
    return packets[k + 1].time_s - packets[k].time_s if k + 1 < len(packets) else 1.0


def _entries(
    content: bytes, depth: int = 0
) -> Iterator[tuple[bytes, Float[np.ndarray, "samples numbers"]]]:
    """The values of `_KEYS` in nested GPMF, divided by the scale that stands before them."""
    at, scale = 0, np.ones(1)
    while at + 8 <= len(content):
        key = content[at : at + 4]
        kind, size, count = struct.unpack_from(">BBH", content, at + 4)
        body = content[at + 8 : at + 8 + size * count]
        if key == b"\0\0\0\0":  # filled up to a length
            return
        if len(body) < size * count:
            raise ValueError(f"{ascii(key)[2:-1]} longer than what holds it")
        if kind == 0 and depth < _DEEPEST:
            yield from _entries(body, depth + 1)
        elif key == b"SCAL":
            scale = _numbers(body, kind, size, count).ravel()
            if not scale.all():
                raise ValueError("a scale of 0")
        elif key in _KEYS:
            yield key, _numbers(body, kind, size, count) / scale
        at += 8 + -(-size * count // 4) * 4  # stored in fours of bytes


def _numbers(body: bytes, kind: int, size: int, count: int) -> Float[np.ndarray, "count numbers"]:
    try:
        one = np.dtype(_NUMBERS[chr(kind)])
    except KeyError:
        raise ValueError(f"numbers of an unknown type {ascii(chr(kind))}") from None
    if size % one.itemsize or not size:
        raise ValueError(f"numbers of {one.itemsize} bytes in {size}")
    return np.frombuffer(body, one).reshape(count, -1).astype(float)


def _turn(quaternion: Float[np.ndarray, "n"]) -> Float[np.ndarray, "3 3"]:
    """The rotation of w, x, y, z, of length about 1."""
    w, *vector = _unit(quaternion, 4)
    return from_quaternion(np.array([*vector, w]))


def _unit(vector: Float[np.ndarray, "n"], size: int = 3) -> Float[np.ndarray, "n"]:
    length = float(np.linalg.norm(vector))
    if len(vector) != size or not abs(length - 1) < _UNIT:
        raise ValueError(f"{len(vector)} numbers of length {length:.3g} for {size} of length 1")
    return vector / length


def _in_order(
    kind: Literal["CAMM", "GPMF"], times: list[float], turns: list[np.ndarray]
) -> CameraMotion | None:
    """By time, of samples at the same time the first; None of fewer than two."""
    at, first = np.unique(np.array(times), return_index=True)
    if len(at) < 2:
        return None
    return CameraMotion(kind, at, np.stack([turns[k] for k in first]))
