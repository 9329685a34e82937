"""A mesh made ready for transfer: one clean surface, its vertices dense enough for shadows."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from deeplight.compose.mesh import Mesh, standing
from deeplight.errors import ImageFileError

MAX_VERTICES = 100_000
_SPLITS = 10  # rounds of halving edges


@dataclass(frozen=True, eq=False)
class TransferSurface:
    """Triangles with a normal at each vertex; +Y is up.

    Attributes:
        vertices: the longest side of their box is 1; it stands on y = 0, its middle over x = z = 0.
        normals: unit.
        triangles: anticlockwise seen from outside.
        colours: linear, of the vertices: the mesh's own, or its finish's.
    """

    vertices: Float[np.ndarray, "n 3"]
    normals: Float[np.ndarray, "n 3"]
    triangles: Int[np.ndarray, "m 3"]
    colours: Float[np.ndarray, "n 3"]


def prepared(
    meshes: Sequence[Mesh], longest_edge: float
) -> tuple[TransferSurface, tuple[str, ...]]:
    """Join meshes into one surface, leave out what has no area, split edges that are too long.

    Args:
        meshes: as `mesh.load` gives them.
        longest_edge: as a share of the longest side of the box; longer edges are halved.

    Returns:
        The surface, and a line for each thing that was changed.

    Raises:
        ImageFileError: nothing is left, or more than MAX_VERTICES.
    """
    surface = _joined(standing(meshes, np.zeros(3), 1.0))
    before, notes = len(surface.vertices), []
    surface, flat = _without_degenerate(surface)
    if not len(surface.triangles):
        raise ImageFileError("a mesh with surface", "triangles without area", "repair the mesh")
    dropped = before - len(surface.vertices)
    if flat or dropped:
        notes.append(f"left out {flat:,} triangles without area, {dropped:,} unused vertices")
    _require_few(surface)
    before = len(surface.triangles)
    surface = _dense(surface, longest_edge)
    if len(surface.triangles) != before:
        notes.append(f"split {before:,} triangles into {len(surface.triangles):,}")
    return surface, tuple(notes)


def _joined(meshes: Sequence[Mesh]) -> TransferSurface:
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    triangles = [mesh.faces + start for mesh, start in zip(meshes, starts[:-1], strict=True)]
    return TransferSurface(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([_normals(mesh) for mesh in meshes]),
        np.concatenate(triangles).astype(np.int64),
        np.concatenate([_colours(mesh) for mesh in meshes]),
    )


def _colours(mesh: Mesh) -> Float[np.ndarray, "n 3"]:
    """The mesh's own colour at each vertex, linear; textures are looked up at the vertex."""
    finish = mesh.finish
    if mesh.colours is not None:
        return mesh.colours
    if finish.colour_map is None or mesh.uv is None:
        return np.tile(np.array(finish.colour), (len(mesh.vertices), 1))
    height, width, _ = finish.colour_map.shape
    uv = np.nan_to_num(mesh.uv) % 1.0
    column = np.minimum((uv[:, 0] * width).astype(int), width - 1)
    row = np.minimum(((1 - uv[:, 1]) * height).astype(int), height - 1)
    result: np.ndarray = (finish.colour_map[row, column] / 255.0) ** 2.2
    return result


def _normals(mesh: Mesh) -> Float[np.ndarray, "n 3"]:
    """Unit normals: the mesh's own, else the mean of the triangles around each vertex."""
    corners = mesh.vertices[mesh.faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    found = np.zeros_like(mesh.vertices)
    for corner in range(3):
        np.add.at(found, mesh.faces[:, corner], across)
    own = found if mesh.normals is None else mesh.normals
    for choice in (found, np.tile([0.0, 1.0, 0.0], (len(found), 1))):
        length = np.linalg.norm(own, axis=-1, keepdims=True)
        own = np.where(length > 1e-12, own, choice)
    result: np.ndarray = own / np.linalg.norm(own, axis=-1, keepdims=True)
    return result


def _without_degenerate(surface: TransferSurface) -> tuple[TransferSurface, int]:
    corners = surface.vertices[surface.triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    whole = np.linalg.norm(across, axis=-1) > 1e-12  # the surface's size is 1
    return _kept(surface, surface.triangles[whole]), int((~whole).sum())


def _kept(surface: TransferSurface, triangles: Int[np.ndarray, "k 3"]) -> TransferSurface:
    """These triangles, and of the vertices only theirs."""
    used, renumbered = np.unique(triangles, return_inverse=True)
    parts = surface.vertices[used], surface.normals[used], renumbered.reshape(-1, 3)
    return TransferSurface(*parts, surface.colours[used])


def _require_few(surface: TransferSurface) -> None:
    if len(surface.vertices) > MAX_VERTICES:
        expected = f"a mesh of at most {MAX_VERTICES:,} vertices"
        raise ImageFileError(expected, f"one of {len(surface.vertices):,}", "simplify it first")


def _dense(surface: TransferSurface, longest_edge: float) -> TransferSurface:
    """Halve every edge that is too long until none is, or until there are enough vertices."""
    for _ in range(_SPLITS):
        edges, of_triangle = _edges(surface.triangles)
        length = np.linalg.norm(np.diff(surface.vertices[edges], axis=1)[:, 0], axis=-1)
        long = length > longest_edge
        if not long.any() or len(surface.vertices) + long.sum() > MAX_VERTICES:
            break
        surface = _halved(surface, edges, of_triangle, long)
    return surface


def _edges(triangles: Int[np.ndarray, "m 3"]) -> tuple[np.ndarray, np.ndarray]:
    """Every edge once, and the three of each triangle: edge k runs from corner k to the next."""
    both = np.stack([triangles, np.roll(triangles, -1, axis=1)], -1).reshape(-1, 2)
    edges, of_triangle = np.unique(np.sort(both, axis=1), axis=0, return_inverse=True)
    return edges, of_triangle.reshape(-1, 3)


def _halved(
    surface: TransferSurface, edges: np.ndarray, of_triangle: np.ndarray, long: np.ndarray
) -> TransferSurface:
    """A vertex in the middle of each long edge; neighbours agree, so no gap opens."""
    number = np.full(len(edges), -1)
    number[long] = len(surface.vertices) + np.arange(long.sum())
    ends = edges[long]
    normals = surface.normals[ends].sum(1)
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    normals = np.where(
        length > 1e-6, normals / np.maximum(length, 1e-6), surface.normals[ends[:, 0]]
    )
    return TransferSurface(
        np.concatenate([surface.vertices, surface.vertices[ends].mean(1)]),
        np.concatenate([surface.normals, normals]),
        _subdivided(surface.triangles, number[of_triangle]),
        np.concatenate([surface.colours, surface.colours[ends].mean(1)]),
    )


def _subdivided(triangles: np.ndarray, middle: np.ndarray) -> np.ndarray:
    """One to four triangles for each, by how many of its edges have a middle vertex."""
    count = (middle >= 0).sum(1)
    # Turned so that one split edge is the first, and of two split edges the first two are.
    first = np.where(count == 1, middle.argmax(1), 0)
    first = np.where(count == 2, (middle.argmin(1) + 1) % 3, first)
    turn = (first[:, None] + np.arange(3)) % 3
    a, b, c = np.take_along_axis(triangles, turn, 1).T
    ab, bc, ca = np.take_along_axis(middle, turn, 1).T
    pieces = {
        0: [(a, b, c)],
        1: [(a, ab, c), (ab, b, c)],
        2: [(ab, b, bc), (a, ab, bc), (a, bc, c)],
        3: [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)],
    }
    parts = [np.stack(p, -1)[count == n] for n, made in pieces.items() for p in made]
    return np.concatenate(parts)
