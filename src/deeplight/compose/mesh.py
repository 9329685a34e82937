"""Objects to put into a photo: triangle meshes from files or built in, brought to size."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from deeplight.compose import shapes
from deeplight.compose.mesh_file import read_meshes
from deeplight.compose.pot import pot
from deeplight.compose.triangles import Finish, Mesh
from deeplight.errors import ImageFileError
from deeplight.frames import rotation
from deeplight.io.image_file import first_bytes

__all__ = ["BUILT_IN", "Finish", "Mesh", "load", "standing"]

BUILT_IN: dict[str, Callable[[], Any]] = {"bunny": shapes.bunny, "sphere": shapes.ball, "pot": pot}
SUFFIXES = (".glb", ".gltf", ".obj", ".ply")
MAX_BYTES = 500_000_000
MAX_TRIANGLES = 5_000_000


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
    meshes = tuple(_checked(mesh, path) for mesh in read_meshes(path, MAX_TRIANGLES))
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
