"""Damage a file as its format allows: what a reader trusts changes, its checksums stay right."""

import io
import json
import struct
import zipfile
import zlib
from collections.abc import Callable
from typing import Any

import numpy as np

from lab.fuzz.seeds import glb

Random = np.random.Generator
NUMBERS = (0, 1, 2, 0x7F, 0x80, 0xFF, 0x7FFF, 0x8000, 0xFFFF, 2**31 - 1, 2**31, 2**32 - 1, 60_000)
VALUES: tuple[Any, ...] = (
    None, True, -1, 0, 1, 2**31, 2**63, 10**400, 1e308, -1e-308, "", "x" * 300, "NaN", "\ud800",
    "../../etc/passwd", [], {}, [[[[]]]], {"a": {"b": 1}}, 0.5,
)  # fmt: skip
WORDS = (b"nan", b"inf", b"-1", b"0", b"99999999999", b"1e999", b"", b"\xff", b"\0", b"../x")


def mutated(content: bytes, kind: str, rng: Random) -> bytes:
    """Damage a file of a format in one to four places."""
    structured = _STRUCTURED.get(kind.rpartition(".")[2])
    for _ in range(int(rng.integers(1, 5))):
        change = structured if rng.random() < 0.6 else None
        try:
            content = (change or _bytes)(content, rng)
        except Exception:  # damaged too much already to be taken apart
            content = _bytes(content, rng)
    return content


def _bytes(content: bytes, rng: Random) -> bytes:
    return _CHANGES[rng.integers(len(_CHANGES))](bytearray(content or b"\0"), rng)


def _flip(content: bytearray, rng: Random) -> bytes:
    for _ in range(int(rng.integers(1, 9))):
        content[rng.integers(len(content))] ^= 1 << int(rng.integers(8))
    return bytes(content)


def _number(content: bytearray, rng: Random) -> bytes:
    """Write an extreme whole number, where formats keep sizes: near the start mostly."""
    near = rng.random() < 0.5
    at = int(rng.integers(min(len(content), 200) if near else len(content)))
    width, order = int(rng.choice([1, 2, 4, 8])), str(rng.choice(["little", "big"]))
    value = int(NUMBERS[rng.integers(len(NUMBERS))])
    content[at : at + width] = (value % 256**width).to_bytes(width, order)
    return bytes(content)


def _cut(content: bytearray, rng: Random) -> bytes:
    return bytes(content[: int(rng.integers(len(content)))])


def _drop(content: bytearray, rng: Random) -> bytes:
    at, size = int(rng.integers(len(content))), int(rng.integers(1, 64))
    return bytes(content[:at] + content[at + size :])


def _again(content: bytearray, rng: Random) -> bytes:
    at, size = int(rng.integers(len(content))), int(rng.integers(1, 200))
    return bytes(content[:at] + content[at : at + size] * int(rng.integers(2, 20)) + content[at:])


def _fill(content: bytearray, rng: Random) -> bytes:
    at, size = int(rng.integers(len(content))), int(rng.integers(1, 64))
    content[at : at + size] = bytes([int(rng.choice([0, 255, 65]))]) * size
    return bytes(content)


_CHANGES = (_flip, _number, _number, _cut, _drop, _again, _fill)


def _png(content: bytes, rng: Random) -> bytes:
    """Change one chunk and give it its checksum."""
    chunks, at = [], 8
    while at < len(content):
        (size,) = struct.unpack(">I", content[at : at + 4])
        chunks.append([content[at + 4 : at + 8], content[at + 8 : at + 8 + size]])
        at += 12 + size
    chosen = chunks[rng.integers(len(chunks))]
    if chosen[0] == b"IDAT" and rng.random() < 0.5:
        chosen[1] = zlib.compress(_bytes(zlib.decompress(chosen[1]), rng))
    elif rng.random() < 0.1:
        chunks.append(chosen)
    else:
        chosen[1] = _bytes(chosen[1], rng)
    parts = [content[:8]]
    for name, data in chunks:
        parts.append(struct.pack(">I", len(data)) + name + data)
        parts.append(struct.pack(">I", zlib.crc32(name + data)))
    return b"".join(parts)


def changed_value(value: Any, rng: Random) -> Any:
    """Change one thing somewhere in a JSON value."""
    if isinstance(value, dict) and value and rng.random() < 0.9:
        key = list(value)[rng.integers(len(value))]
        if rng.random() < 0.1:
            return {k: v for k, v in value.items() if k != key}
        return {**value, key: changed_value(value[key], rng)}
    if isinstance(value, list) and value and rng.random() < 0.9:
        at = int(rng.integers(len(value)))
        if rng.random() < 0.1:
            return value[:at] + value[at:] * int(rng.integers(2, 50))
        return [*value[:at], changed_value(value[at], rng), *value[at + 1 :]]
    if isinstance(value, int) and rng.random() < 0.5:
        return int(NUMBERS[rng.integers(len(NUMBERS))])
    return VALUES[rng.integers(len(VALUES))]


def _json(content: bytes, rng: Random) -> bytes:
    if rng.random() < 0.05:
        return b"[" * 50_000
    text = json.dumps(changed_value(json.loads(content), rng))
    return text.replace("1e+308", str(rng.choice(["1e308", "1e999", "NaN", "Infinity"]))).encode()


def _glb(content: bytes, rng: Random) -> bytes:
    size = int.from_bytes(content[12:16], "little")
    document, buffer = json.loads(content[20 : 20 + size]), content[28 + size :]
    if rng.random() < 0.8:
        return glb(changed_value(document, rng), buffer)
    return glb(document, _bytes(buffer, rng))


def _npz(content: bytes, rng: Random) -> bytes:
    """Change one member and pack it whole."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = list(members)[rng.integers(len(members))]
    head = members[name][:128]
    if rng.random() < 0.5:
        head = head.replace(b"(", rng.choice([b"(999999999999,", b"(-1,", b"((", b"(True,"]), 1)
    else:
        head = _bytes(head, rng)
    members[name] = head + members[name][128:]
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for key, data in members.items():
            archive.writestr(key, data)
    return file.getvalue()


def _words(content: bytes, rng: Random) -> bytes:
    """Change one word of a text, or of a text that stands before binary data."""
    head, end, rest = content.partition(b"end_header")
    words = head.split(b" ")
    words[rng.integers(len(words))] = WORDS[rng.integers(len(WORDS))]
    return b" ".join(words) + end + rest


def _cells(content: bytes, rng: Random) -> bytes:
    """Change one cell of a table."""
    rows = [line.split(b",") for line in content.split(b"\n")]
    row = rows[rng.integers(len(rows))]
    words = (*WORDS, b'"', b"a,b", b"\r\n", b"x" * 200_000)
    row[rng.integers(len(row))] = words[rng.integers(len(words))]
    return b"\n".join(b",".join(row) for row in rows)


def _sealed(content: bytes, rng: Random) -> bytes:
    """Change a transfer and put its checksum right."""
    changed = _bytes(content, rng)
    return changed[:12] + struct.pack("<I", zlib.crc32(changed[16:])) + changed[16:]


def _headed(content: bytes, rng: Random) -> bytes:
    """Change the JSON at the head of a safetensors file and put its length right."""
    size = int.from_bytes(content[:8], "little")
    head = json.dumps(changed_value(json.loads(content[8 : 8 + size]), rng)).encode()
    return len(head).to_bytes(8, "little") + head + content[8 + size :]


def _same_size(content: bytes, rng: Random) -> bytes:
    """Change bytes of a tar, which a wrong size alone would refuse."""
    change = (_flip, _number, _fill)[rng.integers(3)]
    return change(bytearray(content), rng)[: len(content)].ljust(len(content), b"\0")


def _boxes(content: bytes, rng: Random) -> bytes:
    """Change a size or a field behind the name of a box of MP4, HEIF or AVIF."""
    names = b"moov trak mdia stbl stsd stts stsz stco avcC hvcC colr pasp tkhd meta iprp ipco ispe"
    places = [
        at for name in (names + b" iloc iinf pitm irot av1C ftyp mdat elst ctts").split()
        for at in [content.find(name)] if at >= 4
    ]  # fmt: skip
    at = places[rng.integers(len(places))]
    where = at - 4 if rng.random() < 0.3 else at + 4 + int(rng.integers(24))
    value = int(NUMBERS[rng.integers(len(NUMBERS))]) % 2**32
    return content[:where] + value.to_bytes(4, "big") + content[where + 4 :]


_STRUCTURED: dict[str, Callable[[bytes, Random], bytes]] = {
    "png": _png, "json": _json, "gltf": _json, "glb": _glb, "npz": _npz, "obj": _words,
    "ply": _words, "csv": _cells, "mp4": _boxes, "mov": _boxes, "heic": _boxes, "avif": _boxes,
    "transfer": _sealed, "safetensors": _headed, "tar": _same_size,
}  # fmt: skip
