"""What the boxes of a HEIC or AVIF file say that decoders keep to themselves (ISO/IEC 23008-12)."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

MAX_META = 16_000_000  # bytes of the box that describes the pictures; real ones have thousands
MAX_BOXES = 10_000
AVIF_BRANDS = (b"avif", b"avis")


@dataclass(frozen=True)
class HeifHeader:
    """The header of a HEIC or AVIF file.

    Attributes:
        is_av1: its pictures are coded as AV1, so it is an AVIF, whatever its brand.
        cicp: H.273's primaries and transfer of the main picture; None where it names none.
        is_turned: a box says how to turn or mirror the main picture, and decoders have done so.
    """

    is_av1: bool = False
    cicp: tuple[int, int] | None = None
    is_turned: bool = False


def read_header(path: Path) -> HeifHeader:
    """Read the header; what is not there or makes no sense stays at its default.

    Raises:
        OSError: the file cannot be read.
    """
    with path.open("rb") as file:
        brands, meta = b"", b""
        for _ in range(64):  # top-level boxes before the one that is wanted
            head = file.read(8)
            if len(head) < 8:
                break
            size, kind = struct.unpack(">I4s", head)
            if size == 1:
                size = int.from_bytes(file.read(8)) - 8
            content = max(0, size - 8) if size else MAX_META
            if kind == b"ftyp":
                brands = file.read(min(content, 4096))
            elif kind == b"meta":
                meta = file.read(min(content, MAX_META))
                break
            else:
                file.seek(content, 1)
    found = [brands[i : i + 4] for i in range(0, len(brands), 4)]
    try:
        return _described(meta, any(brand in found for brand in AVIF_BRANDS))
    except (struct.error, IndexError):
        return HeifHeader(is_av1=any(brand in found for brand in AVIF_BRANDS))


def _described(meta: bytes, is_avif: bool) -> HeifHeader:
    boxes = dict(_boxes(meta[4:]))
    properties = dict(_boxes(boxes.get(b"iprp", b"")))
    listed = list(_boxes(properties.get(b"ipco", b"")))
    wide = boxes[b"pitm"][0] > 0 if b"pitm" in boxes else False
    main = int.from_bytes(boxes.get(b"pitm", bytes(6))[4 : 8 if wide else 6])
    mine = _associated(properties.get(b"ipma", b""), main)
    own = [listed[i - 1] for i in mine if 0 < i <= len(listed)]
    kinds = [kind for kind, _ in listed]
    named = [content[4:8] for kind, content in own if kind == b"colr" and content[:4] == b"nclx"]
    cicp = struct.unpack(">HH", named[0]) if named else None
    return HeifHeader(
        is_av1=b"av1C" in kinds or (is_avif and b"hvcC" not in kinds),
        cicp=cicp,
        is_turned=any(kind in (b"irot", b"imir") for kind, _ in own),
    )


def _boxes(content: bytes) -> Iterator[tuple[bytes, bytes]]:
    at = 0
    for _ in range(MAX_BOXES):
        if at + 8 > len(content):
            return
        size, kind = struct.unpack_from(">I4s", content, at)
        head = 8
        if size == 1:
            (size,) = struct.unpack_from(">Q", content, at + 8)
            head = 16
        end = at + size if size else len(content)
        if end < at + head:
            return
        yield kind, content[at + head : end]
        at = end


def _associated(content: bytes, item: int) -> list[int]:
    """The places, from 1, of an item's properties (box `ipma`)."""
    if not content:
        return []
    version, wide = content[0], content[3] & 1
    (count,) = struct.unpack_from(">I", content, 4)
    at = 8
    for _ in range(min(count, MAX_BOXES)):
        (number,) = struct.unpack_from(">I" if version else ">H", content, at)
        at += 4 if version else 2
        places, at = content[at], at + 1
        kind, size, mask = (">H", 2, 0x7FFF) if wide else (">B", 1, 0x7F)
        found = [struct.unpack_from(kind, content, at + size * i)[0] & mask for i in range(places)]
        if number == item:
            return found
        at += size * places
    return []
