"""The faces of .ply files as triangles, where trimesh would read them wrongly or not at all."""

import re
from dataclasses import dataclass
from itertools import islice
from struct import Struct

import numpy as np
from jaxtyping import Float, Int

from deeplight.compose.polygons import Faces, all_fan_out, triangles_of

_TYPES = {
    name: kind
    for names, kind in (
        ((b"char", b"int8"), "i1"), ((b"uchar", b"uint8"), "u1"), ((b"short", b"int16"), "i2"),
        ((b"ushort", b"uint16"), "u2"), ((b"int", b"int32"), "i4"), ((b"uint", b"uint32"), "u4"),
        ((b"float", b"float32"), "f4"), ((b"double", b"float64"), "f8"),
    )
    for name in names
}  # fmt: skip
_ORDERS = {b"binary_little_endian": "<", b"binary_big_endian": ">", b"ascii": ""}
_LISTS = (b"vertex_indices", b"vertex_index")

Places = Float[np.ndarray, "n 3"]


@dataclass(frozen=True)
class _Layout:
    """What a header says of its vertices and faces.

    Attributes:
        order: of bytes, as numpy has it; empty for text.
        vertices, faces: how many.
        vertex: one vertex.
        before, after: names and types of a face's numbers around the list of its corners.
        count, corner: types of the list's length and of its items.
    """

    order: str
    vertices: int
    faces: int
    vertex: np.dtype
    before: np.dtype
    count: np.dtype
    corner: np.dtype
    after: np.dtype


def of_triangles(head: bytes, rest: bytes, cut: bool = False) -> bytes | None:
    """Give a .ply whose faces trimesh would misread with triangles only.

    trimesh reads binary faces of one number of corners, where Blender and others write them mixed,
    and fans every polygon out from its first corner.

    Args:
        head: the header as far as its last word, `end_header`.
        rest: what follows that word.
        cut: look for polygons, too, that no fan is right for.

    Returns:
        None where trimesh reads the file as it is, or the file is none of vertices, then faces.

    Raises:
        ValueError, IndexError, struct.error: the file is damaged.
    """
    layout = _layout(head)
    if layout is None or not (cut or layout.order):
        return None
    body = rest[rest.index(b"\n") + 1 :]
    vertices, places, faces = (_from_bytes if layout.order else _from_text)(body, layout)
    counts = {len(face) for face in faces}
    is_mixed = layout.order and len(counts) > 1
    if counts <= {3} or not (is_mixed or (cut and not all_fan_out(places, faces))):
        return None
    triangles = triangles_of(places, faces)
    start = head[: re.search(rb"(?m)^element[ \t]+face", head).start()]  # type: ignore[union-attr]
    said = b"element face %d\nproperty list uchar int vertex_indices\nend_header\n"
    return start + said % len(triangles) + vertices + _written(triangles, layout.order)


def _layout(head: bytes) -> _Layout | None:
    form = re.search(rb"(?m)^format[ \t]+(\w+)", head)
    order = _ORDERS.get(form[1]) if form else None
    elements = [part.split(b"\n") for part in re.split(rb"(?m)^element[ \t]+", head)[1:]]
    kinds = [[at.split() for at in lines if at.startswith(b"property")] for lines in elements]
    names = [lines[0].split()[:2] for lines in elements]
    if order is None or [name[0] for name in names[:2]] != [b"vertex", b"face"]:
        return None
    lists = [at for at, kind in enumerate(kinds[1]) if kind[1] == b"list"]
    if any(kind[1] == b"list" for kind in kinds[0]) or len(lists) != 1:
        return None
    around, listed = kinds[1], kinds[1][lists[0]]
    vertex = _record(kinds[0], order)
    if listed[4] not in _LISTS or not {"x", "y", "z"} <= set(vertex.names or ()):
        return None
    return _Layout(
        order,
        int(names[0][1]),
        int(names[1][1]),
        vertex,
        _record(around[: lists[0]], order),
        np.dtype(order + _TYPES[listed[2]]),
        np.dtype(order + _TYPES[listed[3]]),
        _record(around[lists[0] + 1 :], order),
    )


def _record(kinds: list[list[bytes]], order: str) -> np.dtype:
    return np.dtype([(kind[2].decode("latin-1"), order + _TYPES[kind[1]]) for kind in kinds])


def _from_bytes(body: bytes, layout: _Layout) -> tuple[bytes, Places, Faces]:
    size = layout.vertices * layout.vertex.itemsize
    rows = np.frombuffer(body, layout.vertex, layout.vertices)
    places = np.stack([rows[axis] for axis in "xyz"], -1).astype(float)
    faces = body[size:]
    before, after = layout.before.itemsize, layout.after.itemsize
    if not layout.faces:
        return body[:size], places, []
    length = int(np.frombuffer(faces, layout.count, 1, before)[0])
    alike = np.dtype(
        [
            ("before", f"V{before}"),
            ("count", layout.count),
            ("corners", layout.corner, (length,)),
            ("after", f"V{after}"),
        ]
    )
    if layout.faces * alike.itemsize == len(faces):
        return body[:size], places, np.frombuffer(faces, alike)["corners"].astype(int)
    return body[:size], places, _mixed(faces, layout)


def _mixed(body: bytes, layout: _Layout) -> Faces:
    """Give the corners of faces of several numbers of them, which no dtype reads."""
    number = Struct(layout.order + layout.count.char)
    before, after = layout.before.itemsize, layout.after.itemsize
    kinds: dict[int, Struct] = {}
    found, at = [], 0
    for _ in range(layout.faces):
        (length,) = number.unpack_from(body, at + before)
        face = kinds.setdefault(length, Struct(f"{layout.order}{length}{layout.corner.char}"))
        at += before + number.size
        found.append(face.unpack_from(body, at))
        at += face.size + after
    return found


def _from_text(body: bytes, layout: _Layout) -> tuple[bytes, Places, Faces]:
    lines = [line for line in body.split(b"\n") if line.strip()]
    rows = np.array([line.split() for line in lines[: layout.vertices]], "S").astype(float)
    columns = [(layout.vertex.names or ()).index(axis) for axis in "xyz"]
    skipped = len(layout.before.names or ())
    faces = []
    for line in islice(lines, layout.vertices, layout.vertices + layout.faces):
        words = line.split()[skipped:]
        faces.append([int(word) for word in words[1 : 1 + int(words[0])]])
    vertices = b"\n".join(lines[: layout.vertices]) + b"\n"
    return vertices, rows[:, columns].reshape(-1, 3), faces


def _written(triangles: Int[np.ndarray, "m 3"], order: str) -> bytes:
    if not order:
        return b"".join(b"3 %d %d %d\n" % (a, b, c) for a, b, c in triangles.tolist())
    faces = np.empty(len(triangles), [("count", "u1"), ("corners", f"{order}i4", 3)])
    faces["count"], faces["corners"] = 3, triangles
    return faces.tobytes()
