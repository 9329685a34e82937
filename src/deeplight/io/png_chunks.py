"""A PNG's chunks: whether all are whole, and what those say that OpenImageIO leaves alone.

libpng would find damage late and report it on stderr, past every error handler. Pillow refuses good
files over what a text or a profile unpacks to.
"""

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

from deeplight.io.image_file import damaged, not_an_image

PNG_START = b"\x89PNG\r\n\x1a\n"
MAX_KEPT = 16_000_000  # bytes of a chunk that is looked into
_PIECE = 1 << 20
_CRITICAL = (b"IHDR", b"PLTE", b"IDAT", b"IEND")
_SAYING = (b"gAMA", b"cHRM", b"sRGB", b"eXIf", b"tEXt", b"zTXt")
_OLD_EXIF = "Raw profile type exif"  # where ImageMagick put EXIF before there was a chunk for it


def read_png_chunks(path: Path) -> tuple[tuple[int, int], dict[str, Any]]:
    """Read all of a PNG but its pixels.

    Returns:
        Width and height, and facts under Pillow's names: "gamma", "chromaticity" (white first),
        "srgb", "exif" (from before or behind the pixels) and ImageMagick's text of EXIF.

    Raises:
        ImageFileError: no PNG, cut off, or a chunk whose checksum is wrong.
    """
    size: tuple[int, int] = (0, 0)
    facts: dict[str, Any] = {}
    with path.open("rb") as file:
        is_png, behind = file.read(8) == PNG_START, False
        for kind, content in _chunks(file, path):
            if kind == b"IHDR" and len(content) == 13 and size == (0, 0):
                size = struct.unpack_from(">II", content)
            elif not is_png or not min(size):
                raise not_an_image(path, "a damaged header")
            behind |= kind == b"IDAT"
            if not behind or kind not in (b"gAMA", b"cHRM", b"sRGB"):
                facts = _said(kind, content) | facts
    if not is_png or not min(size):
        raise not_an_image(path, "a damaged header")
    if not behind:
        raise damaged(path, "no pixels in it")
    return size, facts


def _chunks(file: BinaryIO, path: Path) -> Iterator[tuple[bytes, bytes]]:
    """Every chunk up to the last, with what is in it if that is small and of use."""
    kind = b""
    while kind != b"IEND":
        head = file.read(8)
        if len(head) < 8:
            raise damaged(path, "truncated PNG file")
        length, kind = int.from_bytes(head[:4]), head[4:]
        if kind[:1].isupper() and kind not in _CRITICAL:
            raise not_an_image(path, f"it needs a PNG's unknown chunk {ascii(kind)[2:-1]}")
        keep = kind == b"IHDR" or (kind in _SAYING and length <= MAX_KEPT)
        check, content, left = zlib.crc32(kind), b"", length
        while left:
            piece = file.read(min(left, _PIECE))
            if not piece:
                raise damaged(path, "truncated PNG file")
            check, left = zlib.crc32(piece, check), left - len(piece)
            content += piece if keep else b""
        if file.read(4) != check.to_bytes(4):
            raise damaged(path, f"broken PNG file (checksum of {ascii(kind)[2:-1]})")
        yield kind, content


def _said(kind: bytes, content: bytes) -> dict[str, Any]:
    """What one chunk says; nothing if it makes no sense."""
    if kind == b"gAMA" and len(content) == 4:
        return {"gamma": int.from_bytes(content) / 100_000}
    if kind == b"cHRM" and len(content) == 32:
        return {"chromaticity": tuple(v / 100_000 for v in struct.unpack(">8I", content))}
    if kind == b"sRGB":
        return {"srgb": True}
    if kind == b"eXIf":
        return {"exif": content}
    if kind in (b"tEXt", b"zTXt") and content.startswith(_OLD_EXIF.encode() + b"\0"):
        text = content[len(_OLD_EXIF) + 1 :]
        if kind == b"zTXt":
            try:
                text = zlib.decompressobj().decompress(text[1:], MAX_KEPT)
            except zlib.error:
                return {}
        return {_OLD_EXIF: text.decode("latin-1")}
    return {}
