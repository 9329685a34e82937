"""Read meshes from files: glTF by our own reader, .obj and .ply by trimesh."""

import io
import logging
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from deeplight.compose import gltf_mesh
from deeplight.compose.gltf_file import GltfFile
from deeplight.compose.gltf_look import MIXED, REPEAT, MaterialLook
from deeplight.compose.mesh_text import LIBRARY, PLACED, plain_mtl, plain_obj, plain_ply
from deeplight.compose.textures import Pixels, Textures
from deeplight.compose.triangles import Finish, Mesh
from deeplight.errors import ImageFileError, MissingExtraError
from deeplight.io.boundary import reading
from deeplight.io.neighbour import neighbour

MAX_TEXTURE_BYTES = 200_000_000
MAX_TEXT_BYTES = 200_000_000  # an .obj takes about ten times its size while it is read

SHARP_RAD = float(np.radians(40))  # an edge of more is not smooth
FOLDED = -0.3  # cosine between a face and the normal of its corner
FLAT_SHARE = 0.1  # of the surface: a flat part of more stays flat up to its rim


def read_meshes(path: Path, max_triangles: int) -> list[Mesh]:
    """Read every mesh of a file, each where its scene puts it.

    Raises:
        OSError: the file, or one of its buffers, cannot be read.
        ImageFileError: no mesh, a broken or far too large one.
        MissingExtraError: the `render` extra is not installed.
    """
    try:
        import trimesh  # noqa: F401
    except ImportError as error:
        raise MissingExtraError("render", f"reading {path.name}") from error
    with reading(path), warnings.catch_warnings(action="ignore"), np.errstate(all="ignore"):
        if path.suffix.lower() in (".glb", ".gltf"):
            return _of_gltf(path, max_triangles)
        return _of_text(path)


def _of_gltf(path: Path, max_triangles: int) -> list[Mesh]:
    file = GltfFile(path)
    parts = gltf_mesh.read(file, max_triangles)
    looks = {id(part.look): part.look for part in parts}
    textures = Textures(path, 2 * len(looks))
    finishes = {key: _finish_of(look, file, textures) for key, look in looks.items()}
    meshes = []
    for part in parts:
        finish = replace(finishes[id(part.look)], notes=part.notes)
        given = (part.vertices, part.faces, part.normals, part.uv, part.colours)
        meshes.append(_shaded(Mesh(*given, finish)))
    return meshes


def _of_text(path: Path) -> list[Mesh]:
    """Read an .obj or .ply file with trimesh."""
    with _losses() as lost:
        pieces, notes = _pieces(path, cut=False)
        if any(map(_folds_back, pieces)):  # cutting takes as long as reading, and few files need it
            lost.clear()
            pieces, notes = _pieces(path, cut=True)
        textures = Textures(path, len(pieces))
        return [_shaded(_mesh(piece, textures, bool(lost), notes)) for piece in pieces]


def _pieces(path: Path, cut: bool) -> tuple[list[Any], tuple[str, ...]]:
    """Give trimesh's meshes, concave faces cut if asked to, and what could not be applied."""
    import trimesh

    suffix = path.suffix.lower().removeprefix(".")
    content, libraries = _whole(path, suffix, cut)
    neighbours = _Neighbours(path, libraries)
    scene = trimesh.load_scene(
        io.BytesIO(content), file_type=suffix, resolver=neighbours, process=False
    )
    if neighbours.fault is not None:
        raise neighbours.fault
    pieces = [
        piece for piece in scene.dump(concatenate=False) if isinstance(piece, trimesh.Trimesh)
    ]
    return pieces, (PLACED,) if neighbours.has_placed else ()


def _folds_back(piece: Any) -> bool:
    """Whether a face looks away from the normals at its corners, as a wrong fan's triangles do."""
    return len(piece.faces) > 0 and _has_off(piece, piece.vertex_normals, FOLDED)


def _whole(path: Path, suffix: str, cut: bool) -> tuple[bytes, list[str]]:
    """Give what trimesh is to read, and the material files that it names."""
    if path.stat().st_size > MAX_TEXT_BYTES and suffix == "obj":
        got = f"{path} of {path.stat().st_size / 1e6:.0f} MB"
        raise ImageFileError(
            f"an .obj of at most {MAX_TEXT_BYTES / 1e6:.0f} MB", got, "save a .glb"
        )
    content = path.read_bytes()
    return plain_obj(content, cut) if suffix == "obj" else (plain_ply(content, cut), [])


class _Neighbours(Mapping[str, bytes]):
    """What trimesh may read: material files and textures next to a mesh, nothing from elsewhere.

    trimesh goes on without what it cannot get, so a fault worth refusing is kept here.
    """

    def __init__(self, path: Path, libraries: list[str]) -> None:
        self.path = path
        self._libraries = libraries
        self.has_placed = False
        self.fault: ImageFileError | None = None

    def __getitem__(self, name: str) -> bytes:
        try:
            if name == LIBRARY:
                return self._materials()
            return neighbour(self.path, name, MAX_TEXTURE_BYTES)
        except ImageFileError as error:
            self.fault = error
            raise

    def _materials(self) -> bytes:
        found = []
        for name in self._libraries:
            with suppress(OSError):
                found.append(neighbour(self.path, name, MAX_TEXTURE_BYTES))
        if not found:
            raise FileNotFoundError(2, "No such file", self._libraries[0])
        return b"\n".join(plain_mtl(content, self._placed) for content in found)

    def _placed(self) -> None:
        self.has_placed = True

    def get(self, name: str, _default: Any = None) -> Any:
        """Give a file as `[]` does: trimesh expects an error where there is none."""
        return self[name]

    def __iter__(self) -> Iterator[str]:
        return iter(())

    def __len__(self) -> int:
        return 0


@contextmanager
def _losses() -> Iterator[list[str]]:
    """Collect what trimesh says of textures and materials that it leaves out.

    It goes on without them and writes of it only to its log.
    """
    lost: list[str] = []
    handler, log = logging.Handler(), logging.getLogger("trimesh")
    level, spread = log.level, log.propagate

    def keep(record: logging.LogRecord) -> None:
        message = record.getMessage()
        if "image" in message or "material" in message:
            lost.append(message)

    handler.emit = keep  # type: ignore[method-assign]
    log.addHandler(handler)
    log.setLevel(logging.DEBUG)
    log.propagate = False
    try:
        yield lost
    finally:
        log.removeHandler(handler)
        log.setLevel(level)
        log.propagate = spread


def _mesh(piece: Any, textures: Textures, lost: bool, notes: tuple[str, ...]) -> Mesh:
    """Convert what trimesh read."""
    finish = _finish(getattr(piece.visual, "material", None), textures)
    if piece.visual.kind == "face":
        piece.unmerge_vertices()  # a colour for each vertex of each face
    uv = getattr(piece.visual, "uv", None)
    return Mesh(
        np.asarray(piece.vertices, float),
        np.asarray(piece.faces, int),
        np.asarray(piece.vertex_normals, float) if len(piece.faces) else None,
        None if uv is None else np.asarray(uv, float)[:, :2],
        _colours(piece),
        replace(finish, lost=finish.lost or lost, notes=notes),
    )


def _colours(piece: Any) -> Float[np.ndarray, "n 3"] | None:
    """Give the vertices' colours, linear; .ply and .obj files hold encoded ones."""
    if piece.visual.kind not in ("vertex", "face"):
        return None
    encoded = np.asarray(piece.visual.vertex_colors)[:, :3] / 255.0
    raw = piece.metadata.get("_ply_raw", {}).get("vertex", {})
    names = ("red", "green", "blue")
    kinds = [np.dtype(raw.get("properties", {}).get(name, "u1")) for name in names]
    if all(kind.kind == "u" and kind.itemsize > 1 for kind in kinds):
        # trimesh takes whole numbers for bytes.
        shares = [
            raw["data"][name].ravel() / np.iinfo(kind).max
            for name, kind in zip(names, kinds, strict=True)
        ]
        encoded = np.stack(shares, -1)[: len(encoded)]
    result: np.ndarray = encoded**2.2
    return result


def _shaded(mesh: Mesh) -> Mesh:
    """Give normals to a mesh that has none, and split it at sharp edges that share one."""
    import trimesh

    if not len(mesh.faces):
        return mesh
    shape = trimesh.Trimesh(
        mesh.vertices, mesh.faces, vertex_normals=mesh.normals, process=False, validate=False
    )
    normals = np.asarray(shape.vertex_normals if mesh.normals is None else mesh.normals)
    if not _rounds_its_edges(shape, normals):
        return replace(mesh, normals=normals)
    before, faces = _split_at_edges(shape)
    vertices = mesh.vertices[before]
    shape = trimesh.Trimesh(vertices, faces, process=False, validate=False)
    return replace(
        mesh,
        vertices=vertices,
        faces=faces,
        normals=np.asarray(shape.vertex_normals, float),
        uv=None if mesh.uv is None else mesh.uv[before],
        colours=None if mesh.colours is None else mesh.colours[before],
    )


def _split_at_edges(shape: Any) -> tuple[Int[np.ndarray, "n"], Int[np.ndarray, "m 3"]]:
    """Give each smooth part of a surface, and each large flat one, vertices of its own.

    Returns:
        The number that each new vertex had before, and the faces.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    count, flat = len(shape.faces), np.full(len(shape.faces), -1)
    for number in np.flatnonzero(shape.facets_area > FLAT_SHARE * shape.area):
        flat[shape.facets[number]] = number
    one, other = shape.face_adjacency.T
    smooth = (shape.face_adjacency_angles < SHARP_RAD) & (flat[one] == flat[other])
    pairs = (np.ones(smooth.sum(), bool), (one[smooth], other[smooth]))
    _, part = connected_components(coo_array(pairs, (count, count)), directed=False)
    keys = shape.faces + part[:, None].astype(np.int64) * len(shape.vertices)
    kept, faces = np.unique(keys, return_inverse=True)
    return kept % len(shape.vertices), faces.reshape(-1, 3)


def _rounds_its_edges(shape: Any, normals: Float[np.ndarray, "n 3"]) -> bool:
    """Whether one normal stands for faces that meet at a sharp edge, which would shade them dark.

    So it is in files that give no normals, where trimesh takes the mean of the faces around.
    """
    return _has_off(shape, normals, float(np.cos(SHARP_RAD)))


def _has_off(shape: Any, normals: Float[np.ndarray, "n 3"], least: float) -> bool:
    """Whether the normal at a corner of some face is at less than this cosine from the face's."""
    cosine = np.einsum("fcx,fx->fc", normals[shape.faces], shape.face_normals)
    return bool((cosine[shape.area_faces > 0] < least).any())


def _finish(material: Any, textures: Textures) -> Finish:
    """Read a Phong material of an .obj file as trimesh gives it."""
    if material is None:
        return Finish()
    image = getattr(material, "image", None)
    pixels = None if image is None else textures.pixels(id(image), lambda: image)
    diffuse = np.asarray(getattr(material, "diffuse", [153, 153, 153, 255]))[:3] / 255.0
    colour = (1.0, 1.0, 1.0) if pixels is not None else tuple(diffuse**2.2)
    lost = image is not None and pixels is None
    return replace(_coloured(colour, pixels), lost=lost)


def _finish_of(look: MaterialLook, file: GltfFile, textures: Textures) -> Finish:
    """Read a glTF material."""
    if not look.given:
        return Finish()
    colour, rough = (
        None if index is None else textures.pixels(index, partial(file.picture, index))
        for index in (look.colour_map, look.roughness_map)
    )
    lost = look.lost or (look.colour_map is not None and colour is None)
    return replace(
        _coloured(look.colour, colour),
        roughness=look.roughness,
        metallic=look.metallic,
        wrap=REPEAT if look.wrap == MIXED else look.wrap,
        roughness_map=None if rough is None else (rough[..., 1] * look.roughness).astype(np.uint8),
        metallic_map=None if rough is None else (rough[..., 2] * look.metallic).astype(np.uint8),
        lost=lost or (look.roughness_map is not None and rough is None),
    )


def _coloured(colour: tuple[float, ...], pixels: Pixels | None) -> Finish:
    red, green, blue = (float(np.clip(c, 0, 1)) for c in colour)
    if pixels is not None:
        # Factors are linear, the texture is not.
        encoded = np.array([red, green, blue], np.float32) ** np.float32(1 / 2.2)
        if encoded.min() < 1:
            pixels = (pixels * encoded).astype(np.uint8)
    return Finish((red, green, blue), pixels)
