"""Objects to put into a photo: triangle meshes from files or built in, brought to size."""

import logging
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int, UInt8

from deeplight.compose import shapes
from deeplight.compose.pot import pot
from deeplight.errors import ImageFileError, MissingExtraError
from deeplight.frames import rotation
from deeplight.io.image_file import first_bytes

BUILT_IN: dict[str, Callable[[], Any]] = {"bunny": shapes.bunny, "sphere": shapes.ball, "pot": pot}
SUFFIXES = (".glb", ".gltf", ".obj", ".ply")
MAX_BYTES = 500_000_000
MAX_TRIANGLES = 5_000_000
MAX_TEXTURE_PX = 8192
KEPT_TEXTURE_PX = 4096  # larger ones are reduced: Mitsuba keeps 12 bytes for each texel

SHARP_RAD = float(np.radians(40))  # an edge of more is not smooth

Texture = UInt8[np.ndarray, "height width channels"]


@dataclass(frozen=True, eq=False)
class Finish:
    """How a mesh's own material reflects: glTF's metallic-roughness model.

    Attributes:
        colour: base colour, linear.
        colour_map: base colour texture, sRGB; multiplied by `colour` when the file is read.
        roughness, metallic: 0 to 1; each may have a map of one channel.
        lost: the file names a texture or a material that could not be read.
    """

    colour: tuple[float, float, float] = (0.6, 0.6, 0.6)
    colour_map: UInt8[np.ndarray, "height width 3"] | None = None
    roughness: float = 0.6
    metallic: float = 0.0
    roughness_map: UInt8[np.ndarray, "rows columns"] | None = None
    metallic_map: UInt8[np.ndarray, "rows columns"] | None = None
    lost: bool = False


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles with one finish; +Y is up.

    Attributes:
        vertices, faces: as usual; a face's vertices run anticlockwise seen from outside.
        normals: of the vertices; None for flat triangles.
        uv: texture coordinates of the vertices, (0, 0) the texture's lower left.
        colours: linear, of the vertices, instead of the finish's.
        finish: what the file says of the surface.
    """

    vertices: Float[np.ndarray, "n 3"]
    faces: Int[np.ndarray, "m 3"]
    normals: Float[np.ndarray, "n 3"] | None = None
    uv: Float[np.ndarray, "n 2"] | None = None
    colours: Float[np.ndarray, "n 3"] | None = None
    finish: Finish = Finish()


def load(name: str, up: str = "y") -> tuple[Mesh, ...]:
    """Read an object: a name of `BUILT_IN` or a file.

    Args:
        name: "bunny", "sphere", "pot", or the path of a .glb, .gltf, .obj or .ply file.
        up: the file's axis that points up, "y" or "z".

    Raises:
        OSError: there is no such file.
        ImageFileError: no mesh, a broken or empty or far too large one.
        MissingExtraError: the `render` extra is not installed.
    """
    if name in BUILT_IN:
        return (Mesh(*BUILT_IN[name]()),)
    path = Path(name)
    if path.suffix.lower() not in SUFFIXES:
        expected = f"{', '.join(BUILT_IN)} or a file ending in {', '.join(SUFFIXES)}"
        raise ImageFileError(expected, name, "name another object")
    first_bytes(path)
    if path.stat().st_size > MAX_BYTES:
        got = f"{path} of {path.stat().st_size / 1e6:.0f} MB"
        raise ImageFileError(f"a mesh of at most {MAX_BYTES / 1e6:.0f} MB", got, "simplify it")
    status = path.stat()
    return _read(path, up, (status.st_mtime_ns, status.st_size))


@lru_cache(maxsize=4)
def _read(path: Path, up: str, _version: tuple[int, int]) -> tuple[Mesh, ...]:
    """Read a file once for as long as it stays as it is."""
    meshes = tuple(_checked(mesh, path) for mesh in _opened(path))
    triangles = sum(len(mesh.faces) for mesh in meshes)
    if not 0 < triangles <= MAX_TRIANGLES:
        expected = f"a mesh of 1 to {MAX_TRIANGLES:,} triangles"
        do = "simplify it" if triangles else "give a file with surfaces, not points or lines"
        raise ImageFileError(expected, f"{path} with {triangles:,}", do)
    if up == "z":
        meshes = tuple(_turned(mesh, rotation("x", -np.pi / 2)) for mesh in meshes)
    return meshes


def standing(
    meshes: Iterable[Mesh],
    at: Float[np.ndarray, "3"],
    size_m: float,
    turn_rad: float = 0.0,
) -> tuple[Mesh, ...]:
    """Scale meshes together so that their longest side is `size_m`, and stand them at `at`.

    The middle of their box comes over `at`, their lowest point onto the plane; a positive turn
    is anticlockwise seen from above.
    """
    turned = [_turned(mesh, rotation("y", turn_rad)) for mesh in meshes]
    points = np.concatenate([mesh.vertices[np.unique(mesh.faces)] for mesh in turned])
    unturned = points @ rotation("y", turn_rad)  # a turn must not change the size
    scale = size_m / float(np.ptp(unturned, axis=0).max())
    low, high = points.min(0), points.max(0)
    origin = np.array([(low[0] + high[0]) / 2, low[1], (low[2] + high[2]) / 2])
    return tuple(replace(m, vertices=(m.vertices - origin) * scale + at) for m in turned)


def _turned(mesh: Mesh, turn: Float[np.ndarray, "3 3"]) -> Mesh:
    normals = None if mesh.normals is None else mesh.normals @ turn.T
    return replace(mesh, vertices=mesh.vertices @ turn.T, normals=normals)


def _opened(path: Path) -> list[Mesh]:
    """Read every mesh of a file with trimesh, each where its scene puts it."""
    try:
        import trimesh
    except ImportError as error:
        raise MissingExtraError("render", f"reading {path.name}") from error
    try:
        with warnings.catch_warnings(action="ignore"), np.errstate(all="ignore"), _losses() as lost:
            scene = trimesh.load_scene(str(path), process=False)
            for geometry in scene.geometry.values():
                _keep_small(getattr(geometry.visual, "material", None))
            pieces = scene.dump(concatenate=False)
            meshes = [_mesh(piece) for piece in pieces if isinstance(piece, trimesh.Trimesh)]
        return [replace(m, finish=replace(m.finish, lost=bool(lost))) for m in meshes]
    except MemoryError:
        raise
    except ImageFileError as error:
        raise ImageFileError(error.expected, f"{path} with {error.got}", error.do) from error
    except Exception as error:  # trimesh lets its parsers' own errors through
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:120]
        got = f"{path}, which cannot be read ({reason})"
        raise ImageFileError("a whole mesh file", got, "export it again, without Draco") from error


@contextmanager
def _losses() -> Iterator[list[str]]:
    """Collect what trimesh says of textures and materials that it leaves out.

    It goes on without them and tells only its log.
    """
    lost: list[str] = []
    handler, log = logging.Handler(), logging.getLogger("trimesh")
    level, spread = log.level, log.propagate

    def keep(record: logging.LogRecord) -> None:
        told = record.getMessage()
        if "image" in told or "material" in told:
            lost.append(told)

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


def _keep_small(material: Any) -> None:
    """Drop a material's pictures that are not used and reduce the others, before they are copied.

    Raises:
        ImageFileError: one that is far too large.
    """
    for name in ("normalTexture", "emissiveTexture", "occlusionTexture"):
        if getattr(material, name, None) is not None:
            setattr(material, name, None)
    for name in ("baseColorTexture", "metallicRoughnessTexture", "image"):
        picture = getattr(material, name, None)
        if picture is None:
            continue
        if max(picture.size) > MAX_TEXTURE_PX:
            got = f"one of {picture.size[0]} x {picture.size[1]}"
            expected = f"textures of at most {MAX_TEXTURE_PX} pixels a side"
            raise ImageFileError(expected, got, "make them smaller")
        setattr(
            material, name, picture.convert("RGB").reduce(-(-max(picture.size) // KEPT_TEXTURE_PX))
        )


def _mesh(piece: Any) -> Mesh:
    material = getattr(piece.visual, "material", None)  # smoothing loses one without coordinates
    if piece.visual.kind == "face":
        piece.unmerge_vertices()  # a colour for each vertex of each face
    if _rounds_its_edges(piece):
        from trimesh.graph import smooth_shade

        piece = smooth_shade(piece, angle=SHARP_RAD)
    visual = piece.visual
    uv = getattr(visual, "uv", None)
    colours = None
    if visual.kind in ("vertex", "face"):
        colours = (np.asarray(visual.vertex_colors)[:, :3] / 255.0) ** 2.2
    return Mesh(
        np.asarray(piece.vertices, float),
        np.asarray(piece.faces, int),
        np.asarray(piece.vertex_normals, float) if len(piece.faces) else None,
        None if uv is None else np.asarray(uv, float),
        colours,
        _finish(material),
    )


def _rounds_its_edges(piece: Any) -> bool:
    """Whether one normal stands for faces that meet at a sharp edge, which would shade them dark.

    So it is in files that give no normals, where trimesh takes the mean of the faces around.
    """
    if not len(piece.faces):
        return False
    cosine = np.einsum("fcx,fx->fc", piece.vertex_normals[piece.faces], piece.face_normals)
    return bool((cosine[piece.area_faces > 0] < np.cos(SHARP_RAD)).any())


def _finish(material: Any) -> Finish:
    """Read a trimesh material: glTF's, or the Phong one of .obj files."""
    if material is None:
        return Finish()
    if hasattr(material, "baseColorFactor"):
        factor = material.baseColorFactor
        colour = (1.0, 1.0, 1.0) if factor is None else tuple(np.asarray(factor)[:3] / 255.0)
        both = material.metallicRoughnessTexture
        parts = None if both is None else np.asarray(both)
        rough, metal = material.roughnessFactor, material.metallicFactor
        rough, metal = 1.0 if rough is None else rough, 1.0 if metal is None else metal
        return Finish(
            *_coloured(colour, material.baseColorTexture),
            roughness=float(rough),
            metallic=float(metal),
            roughness_map=None if parts is None else (parts[..., 1] * rough).astype(np.uint8),
            metallic_map=None if parts is None else (parts[..., 2] * metal).astype(np.uint8),
        )
    image = getattr(material, "image", None)
    diffuse = np.asarray(getattr(material, "diffuse", [153, 153, 153, 255]))[:3] / 255.0
    colour = (1.0, 1.0, 1.0) if image is not None else tuple(diffuse**2.2)
    return Finish(*_coloured(colour, image))


def _coloured(
    colour: tuple[float, ...], picture: Any
) -> tuple[tuple[float, float, float], UInt8[np.ndarray, "height width 3"] | None]:
    red, green, blue = (float(np.clip(c, 0, 1)) for c in colour)
    if picture is None:
        return (red, green, blue), None
    # Factors are linear, the texture is not.
    encoded = np.array([red, green, blue], np.float32) ** np.float32(1 / 2.2)
    return (red, green, blue), (np.asarray(picture) * encoded).astype(np.uint8)


def _checked(mesh: Mesh, path: Path) -> Mesh:
    """Refuse what no renderer can use; open or non-manifold surfaces are fine."""
    used = mesh.vertices[np.unique(mesh.faces)] if len(mesh.faces) else mesh.vertices[:0]
    if len(mesh.faces) and (mesh.faces.min() < 0 or mesh.faces.max() >= len(mesh.vertices)):
        got = f"{path}, whose faces name vertices that are not there"
        raise ImageFileError("a whole mesh", got, "export it again")
    if not np.isfinite(used).all():
        got = f"{path} with coordinates that are NaN or infinite"
        raise ImageFileError("a mesh of finite size", got, "export it again")
    if len(used) and not 1e-12 < np.ptp(used, axis=0).max() < 1e12:
        got = f"{path}, {np.ptp(used, axis=0).max():.3g} across"
        raise ImageFileError("a mesh of some size", got, "scale it to metres")
    normals = mesh.normals
    if normals is not None and not np.isfinite(normals).all():
        normals = None
    return replace(mesh, normals=normals)
