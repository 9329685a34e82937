"""Faces of four corners and more, cut so that no triangle reaches out of its polygon.

trimesh fans every polygon out from its first corner, which is wrong where the polygon is not seen
whole from there: a letter, a floor plan, the side of a staircase.
"""

import re
from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

FLAT = 1e-9  # share of a polygon's area by which rounding may turn a triangle over

Faces = Sequence[Sequence[int]] | Int[np.ndarray, "faces corners"]
"""The numbers of each face's vertices."""

_FACE = re.compile(rb"^f((?: +\S+){4,})[ \r]*$", re.MULTILINE)
_VERTEX = re.compile(rb"^v +(\S+ +\S+ +\S+)", re.MULTILINE)


def fans_out(polygons: Float[np.ndarray, "m n 3"]) -> Bool[np.ndarray, "m"]:
    """Whether the fan from a polygon's first corner covers it and nothing else.

    So it does if all triangles of the fan turn the way that the polygon as a whole does.
    """
    turns = _turns(polygons)
    whole = turns.sum(1)
    along = np.einsum("mtc,mc->mt", turns, whole)
    return np.all(along >= -FLAT * (whole**2).sum(-1, keepdims=True), axis=1)


def ears(polygon: Float[np.ndarray, "n 3"]) -> Int[np.ndarray, "m 3"]:
    """Cut a polygon of any shape into triangles that turn the way it does.

    Returns:
        Numbers of corners. The polygon is looked at along the axis nearest to its normal; where it
        crosses itself there, it is fanned out from its first corner.
    """
    from mapbox_earcut import triangulate_float64

    normal = _turns(polygon[None])[0].sum(0)
    axis = int(np.abs(normal).argmax())
    plane = np.delete(np.roll(polygon, -axis, 1), 0, 1)  # the next two axes, right-handed
    if normal[axis] < 0:
        plane = plane[:, ::-1]
    found = triangulate_float64(np.ascontiguousarray(plane), np.array([len(plane)], np.uint32))
    triangles: Int[np.ndarray, "m 3"] = found.astype(int).reshape(-1, 3)
    return triangles if len(triangles) == len(polygon) - 2 else _fan(len(polygon))


def _turns(polygons: Float[np.ndarray, "m n 3"]) -> Float[np.ndarray, "m triangles 3"]:
    """Twice the areas of a fan's triangles, along their normals."""
    spokes = polygons[:, 1:] - polygons[:, :1]
    return np.cross(spokes[:, :-1], spokes[:, 1:])


def _fan(count: int) -> Int[np.ndarray, "m 3"]:
    step = np.arange(1, count - 1)
    return np.stack([0 * step, step, step + 1], -1)


def triangles_of(places: Float[np.ndarray, "n 3"], faces: Faces) -> Int[np.ndarray, "m 3"]:
    """Cut faces of three corners and more, given by the numbers of their vertices."""
    cut = [np.zeros((0, 3), int)]
    for corners in _alike(faces):
        plain = fans_out(places[corners])
        cut.append(corners[plain][:, _fan(corners.shape[1])].reshape(-1, 3))
        cut += [face[ears(places[face])] for face in corners[~plain]]
    return np.concatenate(cut)


def all_fan_out(places: Float[np.ndarray, "n 3"], faces: Faces) -> bool:
    """Whether `fans_out` is so of all faces, given by the numbers of their vertices."""
    return all(fans_out(places[corners]).all() for corners in _alike(faces))


def _alike(faces: Faces) -> Iterator[Int[np.ndarray, "some corners"]]:
    """The faces of three corners, of four, and so on."""
    for count in sorted({len(face) for face in faces} - {0, 1, 2}):
        yield np.array([face for face in faces if len(face) == count], int)


def cut_obj(text: bytes) -> bytes:
    """Give an .obj whose polygons trimesh's fan is right for."""
    faces = list(_FACE.finditer(text))
    if not faces:
        return text
    found = list(_VERTEX.finditer(text))
    places = _numbers(b" ".join(vertex[1] for vertex in found), float).reshape(-1, 3)
    starts = np.array([vertex.start() for vertex in found])
    counts = np.array([len(face[1].split()) for face in faces])
    cut: dict[int, bytes] = {}
    for count in np.unique(counts):
        alike = np.flatnonzero(counts == count)
        corners = _numbers(b" ".join(faces[at][1] for at in alike), int).reshape(-1, count)
        seen = np.searchsorted(starts, [faces[at].start() for at in alike])
        polygons = places[np.where(corners < 0, corners + seen[:, None], corners - 1)]
        for at in np.flatnonzero(~fans_out(polygons)):
            cut[alike[at]] = _lines(faces[alike[at]][1].split(), polygons[at])
    return _replaced(text, [(faces[at].span(), cut[at]) for at in sorted(cut)])


def _numbers(text: bytes, kind: type) -> np.ndarray:
    """Read numbers, of "3/1/2" the first; as far as they are numbers."""
    plain = re.sub(rb"/\S*", b"", text) if kind is int else text
    return np.fromstring(plain, kind, sep=" ")


def _lines(corners: list[bytes], polygon: Float[np.ndarray, "n 3"]) -> bytes:
    return b"\n".join(
        b"f " + b" ".join(corners[corner] for corner in triangle) for triangle in ears(polygon)
    )


def _replaced(text: bytes, parts: list[tuple[tuple[int, int], bytes]]) -> bytes:
    pieces, at = [], 0
    for (start, end), new in parts:
        pieces += [text[at:start], new]
        at = end
    return b"".join([*pieces, text[at:]])
