"""Write a camera raw file: a DNG with a mosaic, small, made here.

Adobe, "Digital Negative (DNG) Specification" 1.7; TIFF 6.0.
"""

import struct
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

WHITE, BLACK = 4095, 256


Tags = dict[int, tuple[str, tuple[Any, ...]]]


def _folder(entries: Tags, at: int, following: int = 0) -> bytes:
    """Give a TIFF directory at `at`: tag -> (struct letter, values); 'r' is a signed fraction."""
    kinds = {"B": 1, "s": 2, "H": 3, "I": 4, "r": 10}
    table, body = b"", b""
    start = at + 2 + 12 * len(entries) + 4
    for tag, (letter, values) in sorted(entries.items()):
        if letter == "s":
            content, count = values[0] + b"\0", len(values[0]) + 1
        elif letter == "r":
            pairs = [pair for value in values for pair in (round(value * 10_000), 10_000)]
            content, count = struct.pack(f"<{len(pairs)}i", *pairs), len(values)
        else:
            content, count = struct.pack(f"<{len(values)}{letter}", *values), len(values)
        table += struct.pack("<HHI", tag, kinds[letter], count)
        if len(content) <= 4:
            table += content.ljust(4, b"\0")
        else:
            table += struct.pack("<I", start + len(body))
            body += content + bytes(len(content) % 2)
    return struct.pack("<H", len(entries)) + table + struct.pack("<I", following) + body


def write_dng(
    path: Path,
    scene: Float[np.ndarray, "height width 3"],
    balance: tuple[float, float, float] = (0.5, 1.0, 0.625),
    stops: float | None = None,
    orientation: int = 1,
    thumbnail: bool = False,
) -> Path:
    """Write a DNG of linear colours: RGGB, black level, as-shot neutral.

    Camera colours are linear sRGB's times `balance`. With `thumbnail` the first directory is a
    small picture and the mosaic lies in a sub-directory, as most cameras' files have it.
    """
    sensor = scene * balance
    mosaic = sensor[..., 1].copy()
    mosaic[0::2, 0::2] = sensor[0::2, 0::2, 0]
    mosaic[1::2, 1::2] = sensor[1::2, 1::2, 2]
    values = np.round(BLACK + mosaic * (WHITE - BLACK)).astype("<u2").tobytes()
    camera = _camera(balance, stops, orientation)
    raw = _mosaic(len(scene), len(scene[0]), len(values))
    exif = _folder({37386: ("r", (5.0,)), 41989: ("H", (26,))}, 8 + len(values))
    camera[34665] = ("I", (8 + len(values),))
    first = 8 + len(values) + len(exif)
    ends = _folder(camera | raw, first)
    if thumbnail:
        small = _thumbnail()
        second = first + len(_folder(camera | small, first))
        small[330] = ("I", (second,))
        ends = _folder(camera | small, first) + _folder(raw, second)
    path.write_bytes(struct.pack("<2sHI", b"II", 42, first) + values + exif + ends)
    return path


def _camera(balance: tuple[float, float, float], stops: float | None, orientation: int) -> Tags:
    xyz_to_srgb = np.linalg.inv(
        [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    )
    matrix = np.diag(balance) @ xyz_to_srgb
    tags: Tags = {
        271: ("s", (b"made",)), 272: ("s", (b"here",)), 274: ("H", (orientation,)),
        50706: ("B", (1, 4, 0, 0)), 50708: ("s", (b"made here",)),
        50721: ("r", tuple(matrix.ravel())), 50728: ("r", balance), 50778: ("H", (21,)),
    }  # fmt: skip
    return tags if stops is None else tags | {50730: ("r", (stops,))}


def _mosaic(height: int, width: int, size: int) -> Tags:
    return {
        254: ("I", (0,)), 256: ("I", (width,)), 257: ("I", (height,)), 258: ("H", (16,)),
        259: ("H", (1,)), 262: ("H", (32803,)), 273: ("I", (8,)), 277: ("H", (1,)),
        278: ("I", (height,)), 279: ("I", (size,)), 33421: ("H", (2, 2)),
        33422: ("B", (0, 1, 1, 2)), 50714: ("H", (BLACK,)), 50717: ("H", (WHITE,)),
    }  # fmt: skip


def _thumbnail() -> Tags:
    return {
        254: ("I", (1,)), 256: ("I", (48,)), 257: ("I", (32,)), 258: ("H", (8, 8, 8)),
        259: ("H", (1,)), 262: ("H", (2,)),
        273: ("I", (16,)),  # LibRaw knows directories by where their pixels are
        277: ("H", (3,)), 278: ("I", (32,)), 279: ("I", (48 * 32 * 3,)), 330: ("I", (0,)),
    }  # fmt: skip
