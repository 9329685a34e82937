"""The text of .obj, .mtl and .ply files, brought to what trimesh reads of it."""

import re
from collections.abc import Callable
from itertools import pairwise
from struct import Struct, calcsize

import numpy as np

_LIBRARY = re.compile(rb"^[ \t]*mtllib[ \t]+(.*?)[ \t\r]*$", re.MULTILINE)
_ONE_NAME = re.compile(rb"\S.*?\.mtl(?=\s|$)", re.IGNORECASE)
_MAP = re.compile(rb"^([ \t]*map_kd)[ \t]+(.*?)[ \t\r]*$", re.IGNORECASE | re.MULTILINE)
_NUMBER = rb"[ \t]+[-+]?[\d.]+(?:e[-+]?\d+)?"
_OPTION = re.compile(
    rb"-(?:(?P<placed>[ost](?:"
    + _NUMBER
    + rb"){1,3})|mm"
    + _NUMBER
    + _NUMBER
    + rb"|[a-z]+[ \t]+\S+)"
    rb"[ \t]+",
    re.IGNORECASE,
)
_GREY = re.compile(rb"^([ \t]*K[ads])[ \t]+([\d.]+)[ \t\r]*$", re.MULTILINE)
_COLOUR = re.compile(
    rb"^(property[ \t]+\w+[ \t]+)(?:diffuse_)?(r|g|b)(?:ed|reen|lue)?(?=\s*$)", re.MULTILINE
)
_TYPES = {
    name: kind
    for names, kind in (
        ((b"char", b"int8"), "i1"), ((b"uchar", b"uint8"), "u1"), ((b"short", b"int16"), "i2"),
        ((b"ushort", b"uint16"), "u2"), ((b"int", b"int32"), "i4"), ((b"uint", b"uint32"), "u4"),
        ((b"float", b"float32"), "f4"), ((b"double", b"float64"), "f8"),
    )
    for name in names
}  # fmt: skip
_LETTERS = {"i1": "b", "u1": "B", "i2": "h", "u2": "H", "i4": "i", "u4": "I", "f4": "f", "f8": "d"}
_NAMES = {b"r": b"red", b"g": b"green", b"b": b"blue"}

LIBRARY = "deeplight-materials.mtl"
"""What `plain_obj` has an .obj name instead of its own material files."""
PLACED = "the place and scale of a texture were left out"


def unicode(text: bytes) -> bytes:
    """Give text of unknown encoding as UTF-8: what is not UTF-8 is taken for Latin-1."""
    if text[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return text.decode("utf-16", "replace").encode()
    try:
        return text.decode("utf-8-sig").encode()
    except UnicodeDecodeError:
        return text.decode("latin-1").encode()


def plain_ply(content: bytes) -> bytes:
    """Give a .ply whose header is UTF-8 and calls its colours red, green and blue."""
    head, end, rest = content.partition(b"end_header")  # the rest may be binary
    head = _COLOUR.sub(lambda found: found[1] + _NAMES[found[2]], unicode(head))
    return _of_triangles(head, rest) or head + end + rest


def _of_triangles(head: bytes, rest: bytes) -> bytes | None:
    """Give a binary .ply of faces with 3, 4 and more corners with triangles only.

    trimesh reads binary faces of one number of corners; Blender and others write them mixed.

    Returns:
        None where trimesh reads the file as it is, or the file is none of vertices, then faces.
    """
    order = {b"little": "<", b"big": ">"}.get(
        head.partition(b"format binary_")[2].partition(b"_")[0]
    )
    elements = [part.split(b"\n") for part in re.split(rb"(?m)^element[ \t]+", head)[1:]]
    kinds = [[at.split() for at in lines if at.startswith(b"property")] for lines in elements]
    names = [lines[0].split()[0] for lines in elements]
    if order is None or names[:2] != [b"vertex", b"face"] or any(p[1] == b"list" for p in kinds[0]):
        return None
    body = rest[rest.index(b"\n") + 1 :]
    counts = [int(lines[0].split()[1]) for lines in elements[:2]]
    vertices = counts[0] * sum(np.dtype(_TYPES[kind[1]]).itemsize for kind in kinds[0])
    corners = _corners(body[vertices:], counts[1], kinds[1], order)
    if len({len(face) for face in corners}) < 2:
        return None
    around = (v for f in corners for a, b in pairwise(f[1:]) for v in (f[0], a, b))
    triangles = np.fromiter(around, np.int64).reshape(-1, 3)
    faces = np.empty(len(triangles), [("count", "u1"), ("corners", f"{order}i4", 3)])
    faces["count"], faces["corners"] = 3, triangles
    start = head[: re.search(rb"(?m)^element[ \t]+face", head).start()]  # type: ignore[union-attr]
    said = b"element face %d\nproperty list uchar int vertex_indices\nend_header\n"
    return start + said % len(faces) + body[:vertices] + faces.tobytes()


def _corners(
    body: bytes, count: int, kinds: list[list[bytes]], order: str
) -> list[tuple[int, ...]]:
    """Give the vertices of each face of a binary .ply; none where all have one number of them."""
    wanted, before, after = None, 0, 0
    for kind in kinds:
        if kind[1] == b"list" and wanted is None:
            wanted = kind
        elif kind[1] == b"list":
            return []
        elif wanted is None:
            before += np.dtype(_TYPES[kind[1]]).itemsize
        else:
            after += np.dtype(_TYPES[kind[1]]).itemsize
    if wanted is None or wanted[4] not in (b"vertex_indices", b"vertex_index") or not count:
        return []
    number = Struct(order + _LETTERS[_TYPES[wanted[2]]])
    each = _LETTERS[_TYPES[wanted[3]]]
    one = number.unpack_from(body, before)[0]
    if before + after + number.size + one * calcsize(order + each) == len(body) / count:
        return []
    found, at, faces = [], 0, {n: Struct(f"{order}{n}{each}") for n in range(256)}
    for _ in range(count):
        (length,) = number.unpack_from(body, at + before)
        face = faces.get(length) or Struct(f"{order}{length}{each}")
        at += before + number.size
        found.append(face.unpack_from(body, at))
        at += face.size + after
    return found


def plain_obj(content: bytes) -> tuple[bytes, list[str]]:
    """Give an .obj in UTF-8 that names one material file, `LIBRARY`, and the files it named.

    It may name several on one line or on many, and their names may hold spaces.
    """
    text = unicode(content).replace(b"\t", b" ")  # trimesh finds no faces behind tabs
    lines = _LIBRARY.findall(text)
    names = [name.decode() for line in lines for name in _ONE_NAME.findall(line) or [line]]
    if not names:
        return text, []
    return b"mtllib " + LIBRARY.encode() + b"\n" + _LIBRARY.sub(b"", text), names


def plain_mtl(content: bytes, placed: Callable[[], None]) -> bytes:
    """Give a material file in UTF-8 without the options of textures; a lone number is grey.

    Args:
        content: of the file.
        placed: called if an option moves, scales or shakes a texture.
    """

    def bare(found: re.Match[bytes]) -> bytes:
        rest = found[2]
        while option := _OPTION.match(rest):
            numbers = re.findall(rb"[-+.\de]+", (option["placed"] or b"")[1:])
            plain = {b"o": 0.0, b"t": 0.0, b"s": 1.0}.get((option["placed"] or b"o")[:1].lower())
            if any(float(number) != plain for number in numbers):
                placed()
            rest = rest[option.end() :]
        return found[1] + b" " + rest.strip(b'"')

    return _GREY.sub(rb"\1 \2 \2 \2", _MAP.sub(bare, unicode(content)))
