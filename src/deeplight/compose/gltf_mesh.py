"""Triangles of a glTF 2.0 file, each where its scene puts it: nodes, skins, morphs, Draco.

Everything that decides how the object looks in its rest pose is applied; what is not (cameras,
animations, lights) does not belong to the object. What belongs to it and cannot be applied is
said in `MeshPart.notes` or refused by name.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Any

import numpy as np
from jaxtyping import Float, Int, Num

from deeplight.compose.gltf_file import DO, GltfFile
from deeplight.compose.gltf_look import MIXED, MaterialLook, look
from deeplight.errors import ImageFileError, MissingExtraError

MAX_NODES = 1_000_000
MAX_PARTS = 50_000
MAX_COPIES = 100_000
MANY = 100
TRIANGLES, STRIP, FAN = 4, 5, 6
DRACO = "KHR_draco_mesh_compression"
INSTANCES, VISIBILITY = "EXT_mesh_gpu_instancing", "KHR_node_visibility"
APPLIED = (
    "KHR_mesh_quantization", "KHR_texture_transform", DRACO, "EXT_texture_webp", INSTANCES,
    VISIBILITY,
)  # fmt: skip
HARMLESS = ("KHR_materials_", "KHR_lights_", "KHR_xmp", "KHR_animation_")
"""Extensions of a file that may be required and yet left out: they change the look a little."""

Matrix = Float[np.ndarray, "4 4"]


@dataclass(frozen=True, eq=False)
class MeshPart:
    """Triangles of one material.

    Attributes:
        uv: (0, 0) is the texture's lower left.
        colours: linear, of the vertices, times the material's base colour.
        notes: what of the file could not be applied.
    """

    vertices: Float[np.ndarray, "n 3"]
    faces: Int[np.ndarray, "m 3"]
    normals: Float[np.ndarray, "n 3"] | None
    uv: Float[np.ndarray, "n 2"] | None
    colours: Float[np.ndarray, "n 3"] | None
    look: MaterialLook
    notes: tuple[str, ...] = ()


def read(file: GltfFile, max_triangles: int) -> list[MeshPart]:
    """Read the triangles of a file's scene.

    Raises:
        ImageFileError: it breaks the specification, is too large, or needs what we cannot do.
        MissingExtraError: it is compressed by Draco and the decoder is not installed.
        OSError: a buffer next to it cannot be read.
    """
    for name in file.json.get("extensionsRequired", []):
        if name not in APPLIED and not str(name).startswith(HARMLESS):
            raise ImageFileError("a mesh that we can read", f"{file.path}, which needs {name}", DO)
    places = world_from_node(file)
    looks, joints = cache(partial(look, file)), partial(_joints, file, places)
    read_once: dict[tuple[Any, ...], MeshPart] = {}
    copies: dict[tuple[Any, ...], list[Matrix]] = {}
    triangles, hidden = 0, _hidden(file.json.get("nodes", []))
    for index, place in places.items():
        node = file.json["nodes"][index]
        if "mesh" not in node or index in hidden:
            continue
        alone = index if "skin" in node or node.get("weights") else None
        for number, primitive in enumerate(file.item("meshes", node["mesh"])["primitives"]):
            key = (node["mesh"], number, alone)
            if key not in read_once:
                read_once[key] = _part(file, node, primitive, looks, joints)
            where = (
                [np.eye(4)] if "skin" in node else [place @ own for own in _instances(file, node)]
            )
            copies.setdefault(key, []).extend(where)
            triangles += len(where) * len(read_once[key].faces)
            if triangles > max_triangles or len(read_once) > MAX_PARTS:
                expected = f"at most {max_triangles:,} triangles in {MAX_PARTS:,} parts"
                raise ImageFileError(expected, f"{file.path} with more", "simplify it")
    parts = [_placed(part, np.array(copies[key])) for key, part in read_once.items()]
    return _joined([part for part in parts if len(part.faces)])


def _joined(parts: list[MeshPart]) -> list[MeshPart]:
    """Join the parts of one material where there are many: a renderer wants few."""
    if len(parts) <= MANY:
        return parts
    groups: dict[tuple[Any, ...], list[MeshPart]] = {}
    for part in parts:
        given = (part.normals is None, part.uv is None, part.colours is None)
        groups.setdefault((id(part.look), part.notes, *given), []).append(part)
    return [_one(group) for group in groups.values()]


def _one(parts: list[MeshPart]) -> MeshPart:
    starts = np.cumsum([0] + [len(part.vertices) for part in parts[:-1]])

    def all_of(name: str) -> Any:
        values = [getattr(part, name) for part in parts]
        return None if values[0] is None else np.concatenate(values)

    faces = [part.faces + start for part, start in zip(parts, starts, strict=True)]
    changes = {name: all_of(name) for name in ("vertices", "normals", "uv", "colours")}
    return replace(parts[0], faces=np.concatenate(faces), **changes)


def world_from_node(file: GltfFile) -> dict[int, Matrix]:
    """Give every node of the file's scene and where it stands.

    Raises:
        ImageFileError: nodes in a circle, or one in two places, or far too many.
    """
    nodes = file.json.get("nodes", [])
    if len(nodes) > MAX_NODES:
        raise file.fault(f"{len(nodes):,} nodes")
    if file.json.get("scenes"):
        roots = file.item("scenes", file.json.get("scene", 0)).get("nodes", [])
    else:  # a library of parts: everything that hangs on nothing
        children = {child for node in nodes for child in node.get("children", [])}
        roots = [index for index in range(len(nodes)) if index not in children]
    found: dict[int, Matrix] = {}
    waiting = [(index, np.eye(4)) for index in reversed(roots)]
    while waiting:
        index, above = waiting.pop()
        node = file.item("nodes", index)
        if index in found:
            raise file.fault(f"node {index} in two places")
        found[index] = above @ _local(node) if node.keys() & _MOVES else above
        waiting += [(child, found[index]) for child in reversed(node.get("children", []))]
    return found


def _hidden(nodes: list[Mapping[str, Any]]) -> set[int]:
    """Give the nodes that KHR_node_visibility hides, with all that hangs on them."""
    waiting = [
        index
        for index, node in enumerate(nodes)
        if node.get("extensions", {}).get(VISIBILITY, {}).get("visible", True) is False
    ]
    found: set[int] = set()
    while waiting:
        index = waiting.pop()
        found.add(index)
        waiting += [child for child in nodes[index].get("children", []) if child not in found]
    return found


def _instances(file: GltfFile, node: Mapping[str, Any]) -> Float[np.ndarray, "copies 4 4"]:
    """Give where EXT_mesh_gpu_instancing puts copies of a node's mesh, in the node's frame."""
    given = node.get("extensions", {}).get(INSTANCES, {}).get("attributes", {})
    names = [name for name in ("TRANSLATION", "ROTATION", "SCALE") if name in given]
    moves = {name.lower(): file.accessor(given[name]) for name in names}
    if len({len(values) for values in moves.values()}) > 1:
        raise file.fault("instances of uneven number")
    count = len(next(iter(moves.values()), [0]))
    if count > MAX_COPIES:
        raise file.fault(f"{count:,} copies of a mesh")
    return np.array(
        [_local({name: values[i] for name, values in moves.items()}) for i in range(count)]
    ).reshape(-1, 4, 4)


_MOVES = {"matrix", "translation", "rotation", "scale"}


def _local(node: Mapping[str, Any]) -> Matrix:
    result = np.eye(4)
    result[:3, 3] = node.get("translation", (0, 0, 0))
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    if not node.keys() & {"rotation", "scale"}:
        return result
    x, y, z, w = np.array(node.get("rotation", (0, 0, 0, 1)), float)
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    result[:3, :3] = turn * np.array(node.get("scale", (1, 1, 1)), float)
    return result


def _part(
    file: GltfFile, node: Mapping[str, Any], primitive: Mapping[str, Any], looks: Any, joints: Any
) -> MeshPart:
    """Read one primitive as its node poses it, in the mesh's own frame (skinned: the world's)."""
    arrays, faces = _arrays(file, primitive)
    if len(faces) and faces.max() >= len(arrays["POSITION"]):
        raise file.fault("faces of vertices that are not there")
    lengths = {len(values) for values in arrays.values()}
    if len(lengths) != 1:
        raise file.fault(f"attributes of {' and '.join(map(str, sorted(lengths)))} vertices")
    weights = node.get("weights") or file.item("meshes", node["mesh"]).get("weights") or []
    for weight, target in zip(weights, primitive.get("targets", []), strict=False):
        for name in arrays.keys() & target.keys() if weight else ():
            arrays[name] = _morphed(arrays[name], float(weight), file.accessor(target[name]))
    vertices, normals = arrays["POSITION"].astype(float), arrays.get("NORMAL")
    if "skin" in node and "JOINTS_0" in arrays:
        vertices, normals = _skinned(vertices, normals, arrays, joints(node["skin"]), file)
    of = looks(primitive.get("material"))
    uv, notes = _coordinates(arrays, of)
    colours, colour_notes = _colours(arrays.get("COLOR_0"), of)
    return MeshPart(
        vertices, faces, _unit(normals), uv, colours, of, of.notes + notes + colour_notes
    )


def _morphed(
    values: Num[np.ndarray, "n width"], weight: float, change: Num[np.ndarray, "n less"]
) -> Num[np.ndarray, "n width"]:
    """Add a morph's weighted change; one of colours may leave alpha out."""
    result = values.astype(float)
    result[:, : change.shape[1]] += weight * change
    return result


def _arrays(
    file: GltfFile, primitive: Mapping[str, Any]
) -> tuple[dict[str, Num[np.ndarray, "n width"]], Int[np.ndarray, "m 3"]]:
    names = dict(primitive["attributes"])
    mode = primitive.get("mode", TRIANGLES)
    if mode not in (TRIANGLES, STRIP, FAN) or "POSITION" not in names:
        return {"POSITION": np.zeros((0, 3))}, np.zeros((0, 3), int)
    wanted = [name for name in names if not name.startswith(("TANGENT", "_"))]
    packed = primitive.get("extensions", {}).get(DRACO)
    if packed is not None:
        return _unpacked(file, packed, {name: names[name] for name in wanted})
    arrays = {name: file.accessor(names[name]) for name in wanted}
    if arrays["POSITION"].shape[1] != 3:
        raise file.fault("positions that are not of three numbers")
    if "indices" in primitive:
        corners = file.accessor(primitive["indices"])[:, 0]
        if corners.dtype.kind != "i" or corners.min() < 0:
            raise file.fault("indices that are not whole numbers")
    else:
        corners = np.arange(len(arrays["POSITION"]))
    return arrays, _faces(corners, mode)


def _faces(corners: Int[np.ndarray, "n"], mode: int) -> Int[np.ndarray, "m 3"]:
    if mode == TRIANGLES:
        return corners[: len(corners) // 3 * 3].reshape(-1, 3)
    if len(corners) < 3:
        return np.zeros((0, 3), int)
    if mode == FAN:
        first = np.full(len(corners) - 2, corners[0])
        return np.stack([first, corners[1:-1], corners[2:]], -1)
    faces = np.stack([corners[:-2], corners[1:-1], corners[2:]], -1)
    faces[1::2] = faces[1::2, [1, 0, 2]]  # every other triangle of a strip runs the other way
    return faces


def _unpacked(
    file: GltfFile, packed: Mapping[str, Any], names: Mapping[str, Any]
) -> tuple[dict[str, Num[np.ndarray, "n width"]], Int[np.ndarray, "m 3"]]:
    """Decode what Draco compressed."""
    try:
        import DracoPy
    except ImportError as error:
        raise MissingExtraError("render", f"Draco, by which {file.path} is compressed") from error
    try:
        mesh = DracoPy.decode(file.view(packed["bufferView"]))
        by_number = {entry["unique_id"]: entry["data"] for entry in mesh.attributes}
        faces = np.asarray(mesh.faces, int).reshape(-1, 3)
    except (DracoPy.FileTypeException, DracoPy.EncodingFailedException, AttributeError) as error:
        raise file.fault("Draco data that cannot be decoded") from error
    arrays = {}
    for name, number in packed["attributes"].items():
        if name in names:
            values = np.asarray(by_number[number])
            whole = values.dtype.kind in "iu"
            if whole and file.item("accessors", names[name]).get("normalized", False):
                values = np.maximum(values / float(np.iinfo(values.dtype).max), -1.0)
            arrays[name] = values.astype(np.int64 if values.dtype.kind in "iu" else np.float64)
    return arrays, faces


def _joints(
    file: GltfFile, places: Mapping[int, Matrix], index: Any
) -> Float[np.ndarray, "joints 4 4"]:
    skin = file.item("skins", index)
    if not all(joint in places for joint in skin["joints"]):
        raise file.fault("a skin whose joints are not in the scene")
    worlds = np.array([places[joint] for joint in skin["joints"]])
    if "inverseBindMatrices" not in skin:
        return worlds
    binds = file.accessor(skin["inverseBindMatrices"]).reshape(-1, 4, 4).swapaxes(1, 2)
    return worlds @ binds[: len(worlds)]


def _skinned(
    vertices: Float[np.ndarray, "n 3"],
    normals: Float[np.ndarray, "n 3"] | None,
    arrays: Mapping[str, Num[np.ndarray, "n width"]],
    joints: Float[np.ndarray, "joints 4 4"],
    file: GltfFile,
) -> tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"] | None]:
    """Blend the joints' matrices linearly (glTF 2.0, section 3.7.3.3)."""
    blend = np.zeros((len(vertices), 4, 4))
    total = np.zeros(len(vertices))
    for number in range(sum(name.startswith("JOINTS_") for name in arrays)):
        which, weight = arrays[f"JOINTS_{number}"], arrays[f"WEIGHTS_{number}"]
        if which.dtype.kind != "i" or not 0 <= which.min() <= which.max() < len(joints):
            raise file.fault("vertices on joints that are not there")
        for column in range(which.shape[1]):
            blend += weight[:, column, None, None] * joints[which[:, column]]
            total += weight[:, column]
    blend /= np.where(total > 0, total, 1)[:, None, None]
    moved = np.einsum("nij,nj->ni", blend[:, :3, :3], vertices) + blend[:, :3, 3]
    if normals is not None:
        normals = np.einsum("nij,nj->ni", _cofactors(blend[:, :3, :3]), normals)
    return moved, normals


def _cofactors(m: Float[np.ndarray, "*n 3 3"]) -> Float[np.ndarray, "*n 3 3"]:
    """What turns normals where `m` turns points: its inverse, transposed, times its determinant."""
    rows = [np.cross(m[..., (i + 1) % 3, :], m[..., (i + 2) % 3, :]) for i in range(3)]
    return np.stack(rows, -2)


def _unit(normals: Float[np.ndarray, "n 3"] | None) -> Float[np.ndarray, "n 3"] | None:
    if normals is None:
        return None
    length = np.linalg.norm(normals, axis=-1, keepdims=True)
    return normals / np.where(length > 0, length, 1)


def _coordinates(
    arrays: Mapping[str, Num[np.ndarray, "n width"]], of: MaterialLook
) -> tuple[Float[np.ndarray, "n 2"] | None, tuple[str, ...]]:
    values = arrays.get(f"TEXCOORD_{of.uv_set}")
    if values is None:
        textured = of.colour_map is not None or of.roughness_map is not None
        return None, ("a texture without coordinates was left out",) if textured else ()
    places = of.uv_place.apply(values[:, :2].astype(float))
    leaves = np.abs(places - 0.5).max(initial=0) > 0.5 + 1e-3
    notes = ("a texture repeats to all sides, where it should not",) if leaves else ()
    return places * [1, -1] + [0, 1], notes if of.wrap == MIXED else ()


def _colours(
    given: Num[np.ndarray, "n width"] | None, of: MaterialLook
) -> tuple[Float[np.ndarray, "n 3"] | None, tuple[str, ...]]:
    if given is None:
        return None, ()
    linear = np.clip(given[:, :3].astype(float), 0, 1)
    if of.colour_map is None:
        return linear * of.colour, ()
    if np.allclose(linear, 1, atol=1 / 255):
        return None, ()
    return None, ("colours of the vertices under a texture were left out",)


def _placed(part: MeshPart, places: Float[np.ndarray, "copies 4 4"]) -> MeshPart:
    """Give every copy of a part, each where it stands."""
    turns, count = places[:, :3, :3], len(part.vertices)
    vertices = np.einsum("kij,nj->kni", turns, part.vertices) + places[:, None, :3, 3]
    mirrored = np.linalg.det(turns) < 0
    faces = np.where(mirrored[:, None, None], part.faces[:, ::-1], part.faces)
    faces = faces + count * np.arange(len(places))[:, None, None]
    normals = None
    if part.normals is not None:
        across = np.einsum("kij,nj->kni", _cofactors(turns), part.normals)
        # The cofactors carry the determinant's sign.
        normals = _unit((across * np.where(mirrored, -1, 1)[:, None, None]).reshape(-1, 3))

    def each(values: Any) -> Any:
        return None if values is None else np.tile(values, (len(places), 1))

    return replace(
        part,
        vertices=vertices.reshape(-1, 3),
        faces=faces.reshape(-1, 3),
        normals=normals,
        uv=each(part.uv),
        colours=each(part.colours),
    )
