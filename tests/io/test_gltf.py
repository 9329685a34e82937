"""Every way of glTF to say the same triangles gives the same ones; lies are refused."""

import base64
import json
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest

from deeplight.compose.mesh import load
from deeplight.errors import ImageFileError
from gltf import BOARD, FACES, TYPES, UV, Gltf, same

pytestmark = pytest.mark.needs("trimesh")


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "mesh.glb"


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
@pytest.mark.parametrize("width", [3, 4])
def test_vertex_colours_are_linear_and_tint_the_base_colour(
    dtype: Any, width: int, path: Path
) -> None:
    gltf, most = Gltf(), 1.0 if dtype == np.float32 else np.iinfo(dtype).max
    colours = np.tile(np.array([0.5, 0.25, 0.1, 1.0][:width]) * most, (4, 1))
    colours = (colours if dtype == np.float32 else colours.round()).astype(dtype)
    if width == 3 and dtype != np.float32:
        colours = np.pad(colours, ((0, 0), (0, 1)))  # attributes are aligned to four bytes
    whole = {} if dtype == np.float32 else {"normalized": True}
    primitive = gltf.board(COLOR_0=gltf.array(colours, **whole))
    assert load(gltf.save(path))[0].colours[0] == pytest.approx([0.5, 0.25, 0.1], abs=1 / 255)
    primitive["material"] = 0
    gltf.json["materials"] = [{"pbrMetallicRoughness": {"baseColorFactor": [0.5, 1, 1, 1]}}]
    assert load(gltf.save(path))[0].colours[0] == pytest.approx([0.25, 0.25, 0.1], abs=1 / 255)


@pytest.mark.parametrize(("dtype", "most"), [(np.int8, 127), (np.int16, 32767), (np.uint16, 65535)])
def test_quantised_positions_come_to_their_size(dtype: Any, most: int, path: Path) -> None:
    gltf = Gltf()
    whole = np.round(BOARD / 2 * most).astype(dtype)
    padded = np.zeros((4, 4), dtype)
    padded[:, :3] = whole
    view = gltf.view(padded.tobytes(), byteStride=4 * padded.itemsize)
    entry = {"bufferView": view, "componentType": TYPES[np.dtype(dtype).name], "type": "VEC3"}
    gltf.json["accessors"].append({**entry, "count": 4, "normalized": True})
    gltf.board(POSITION=0)
    gltf.json["nodes"] = [{"mesh": 0, "scale": [2, 2, 2]}]
    gltf.json["extensionsRequired"] = ["KHR_mesh_quantization"]
    size = np.ptp(load(gltf.save(path))[0].vertices, axis=0)
    assert size == pytest.approx([2, 1, 0], abs=0.02)
    del gltf.json["accessors"][0]["normalized"]  # the twin: whole numbers are taken as they are
    assert np.ptp(load(gltf.save(path))[0].vertices, axis=0)[0] == pytest.approx(2 * most, rel=0.01)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_texture_coordinates_of_every_type_are_the_same(dtype: Any, path: Path) -> None:
    gltf, most = Gltf(), 1 if dtype == np.float32 else np.iinfo(dtype).max
    gltf.board(TEXCOORD_0=gltf.array((UV * most).astype(dtype), normalized=most > 1))
    gltf.textured()
    (mesh,) = load(gltf.save(path))
    assert mesh.uv == pytest.approx(UV * [1, -1] + [0, 1])
    assert mesh.finish.colour_map[0, 0].tolist() == [200, 100, 50]


def test_a_texture_lies_where_its_transform_and_its_set_put_it(path: Path) -> None:
    def uv(transform: dict[str, Any], **info: Any) -> np.ndarray:
        gltf = Gltf()
        second = gltf.array(UV / 2)
        gltf.board(TEXCOORD_0=gltf.array(UV), TEXCOORD_1=second)
        gltf.textured(extensions={"KHR_texture_transform": transform}, **info)
        return load(gltf.save(path))[0].uv * [1, -1] + [0, 1]  # as glTF counts

    assert uv({}, texCoord=1) == pytest.approx(UV / 2)
    assert uv({"texCoord": 1}) == pytest.approx(UV / 2)
    assert uv({"offset": [0.5, 0.5], "scale": [0.5, 0.25]}) == pytest.approx(UV * [0.5, 0.25] + 0.5)
    # The specification's example: the lower left quarter, turned by 90 degrees.
    turned = uv({"offset": [0, 1], "rotation": np.pi / 2, "scale": [0.5, 0.5]})
    assert turned.min(0) == pytest.approx([0, 0.5])
    assert turned.max(0) == pytest.approx([0.5, 1])
    assert turned == pytest.approx(np.stack([UV[:, 1] / 2, 1 - UV[:, 0] / 2], -1))


def test_sparse_values_replace_or_make_an_array(path: Path) -> None:
    for dense in (True, False):
        gltf = Gltf()
        rows, values = np.array([1, 2], np.uint16), BOARD[1:3]
        sparse = {
            "count": 2,
            "indices": {"bufferView": gltf.view(rows.tobytes()), "componentType": 5123},
            "values": {"bufferView": gltf.view(values.tobytes())},
        }
        wrong = BOARD * [1, 1, 0]
        wrong[1:3] = 9
        index = gltf.array(wrong.astype(np.float32), sparse=sparse)
        if dense:
            view = gltf.view(wrong.astype(np.float32).tobytes())
            gltf.json["accessors"][index]["bufferView"] = view
        gltf.board(POSITION=index)
        found = load(gltf.save(path))[0]
        expected = BOARD.copy() if dense else BOARD * [[0], [1], [1], [0]]
        assert np.ptp(found.vertices, axis=0) == pytest.approx(np.ptp(expected, axis=0))
        assert found.vertices.max() == pytest.approx(2)


def test_a_skin_moves_its_vertices_and_ignores_their_node(path: Path) -> None:
    gltf = Gltf()
    joints = np.array([[0, 1, 0, 0]] * 4, np.uint8)
    weights = np.tile(np.array([[0.25, 0.75, 0, 0]], np.float32), (4, 1))
    binds = np.tile(np.eye(4, dtype=np.float32), (2, 1, 1))
    binds[1, 3, :3] = [0, 0, 5]  # columns first: moved by +5 along Z before its joint
    gltf.board(JOINTS_0=gltf.array(joints), WEIGHTS_0=gltf.array(weights))
    gltf.json["skins"] = [{"joints": [1, 2], "inverseBindMatrices": gltf.array(binds)}]
    gltf.json["nodes"] = [
        {"mesh": 0, "skin": 0, "translation": [100, 0, 0]},
        {"translation": [4, 0, 0], "children": [2]},
        {"translation": [0, 8, 0]},
    ]
    gltf.json["scenes"] = [{"nodes": [0, 1]}]
    (mesh,) = load(gltf.save(path))
    assert mesh.vertices.min(0) == pytest.approx([4, 6, 3.75])


def test_a_morph_is_applied_by_its_weight(path: Path) -> None:
    gltf = Gltf()
    primitive = gltf.board()
    primitive["targets"] = [{"POSITION": gltf.array(BOARD)}]
    gltf.json["meshes"][0]["weights"] = [0.5]
    assert np.ptp(load(gltf.save(path))[0].vertices, axis=0) == pytest.approx([3, 1.5, 0])
    gltf.json["nodes"][0]["weights"] = [1.0]  # the node's come first
    assert np.ptp(load(gltf.save(path))[0].vertices, axis=0) == pytest.approx([4, 2, 0])


def test_a_morph_moves_colours_and_texture_coordinates_too(path: Path) -> None:
    gltf = Gltf()
    half = gltf.array(np.full((4, 4), 0.5, np.float32))
    primitive = gltf.board(TEXCOORD_0=gltf.array(UV), COLOR_0=half)
    primitive["targets"] = [
        {
            "COLOR_0": gltf.array(np.full((4, 3), -0.5, np.float32)),
            "TEXCOORD_0": gltf.array(np.full((4, 2), 0.25, np.float32)),
        }
    ]
    gltf.json["meshes"][0]["weights"] = [0.5]
    (mesh,) = load(gltf.save(path))
    assert mesh.colours == pytest.approx(np.full((4, 3), 0.25))
    assert mesh.uv == pytest.approx((UV + 0.125) * [1, -1] + [0, 1])


@pytest.mark.parametrize(
    ("mode", "indices"), [(4, FACES), (5, [3, 0, 2, 1]), (6, [0, 1, 2, 3]), (4, None)]
)
def test_lists_strips_and_fans_are_the_same_triangles(mode: int, indices: Any, path: Path) -> None:
    gltf = Gltf()
    primitive = gltf.board(BOARD if indices is not None else BOARD[FACES])
    primitive["mode"] = mode
    primitive["indices"] = gltf.array(np.array(FACES if indices is None else indices, np.uint16))
    if indices is None:
        del primitive["indices"]
    (mesh,) = load(gltf.save(path))
    across = np.cross(*(np.diff(mesh.vertices[mesh.faces], axis=1).swapaxes(0, 1)))
    assert across[:, 2] == pytest.approx([2, 2])  # both face the same way
    assert np.unique(mesh.vertices, axis=0) == pytest.approx(np.unique(BOARD, axis=0))


def test_a_mirrored_copy_still_faces_outwards(path: Path) -> None:
    gltf = Gltf()
    gltf.board(NORMAL=gltf.array(np.tile(np.array([[0, 0, 1]], np.float32), (4, 1))))
    gltf.json["nodes"] = [{"mesh": 0, "scale": [-1, 1, 1]}, {"mesh": 0, "translation": [0, 0, 7]}]
    gltf.json["scenes"] = [{"nodes": [0, 1]}]
    (mesh,) = load(gltf.save(path))
    across = np.cross(*(np.diff(mesh.vertices[mesh.faces], axis=1).swapaxes(0, 1)))
    assert len(across) == 4
    assert (across * mesh.normals[mesh.faces[:, 0]]).sum(1) == pytest.approx([2] * 4)
    assert mesh.normals == pytest.approx(np.tile([0, 0, 1], (len(mesh.vertices), 1)))


def test_draco_is_decoded(path: Path) -> None:
    draco = pytest.importorskip("DracoPy")
    gltf = Gltf()
    primitive = gltf.board()
    content = draco.encode(BOARD, FACES.reshape(-1, 3), quantization_bits=16)
    packed = {"bufferView": gltf.view(content), "attributes": {"POSITION": 0}}
    primitive["extensions"] = {"KHR_draco_mesh_compression": packed}
    for entry in gltf.json["accessors"]:
        del entry["bufferView"]
    gltf.json["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    points = load(gltf.save(path))[0]
    assert np.unique(points.vertices, axis=0) == pytest.approx(np.unique(BOARD, axis=0), abs=1e-4)
    assert len(points.faces) == 2
    gltf.json["bufferViews"][packed["bufferView"]]["byteLength"] //= 2
    with pytest.raises(ImageFileError, match="Draco"):
        load(gltf.save(path))


def test_what_cannot_be_decoded_is_named(path: Path) -> None:
    gltf = Gltf()
    gltf.board()
    assert same(gltf.save(path))
    for name in ("EXT_meshopt_compression", "VENDOR_something"):
        gltf.json["extensionsRequired"] = [name]
        with pytest.raises(ImageFileError, match=name):
            load(gltf.save(path))


def test_buffers_are_found_by_their_percent_encoded_names(tmp_path: Path) -> None:
    gltf = Gltf()
    gltf.board()
    (tmp_path / "my mesh é.bin").write_bytes(gltf.bytes)
    for uri in ("my%20mesh%20%C3%A9.bin", "my mesh é.bin"):
        gltf.json["buffers"] = [{"byteLength": len(gltf.bytes), "uri": uri}]
        (tmp_path / "mesh.gltf").write_text(json.dumps(gltf.json))
        assert same(str(tmp_path / "mesh.gltf"))

    uri = "data:application/octet-stream;base64," + base64.b64encode(gltf.bytes).decode()
    gltf.json["buffers"][0]["uri"] = uri
    (tmp_path / "mesh.gltf").write_text(json.dumps(gltf.json))
    assert same(str(tmp_path / "mesh.gltf"))


LIES: dict[str, Any] = {
    "count": lambda j: j["accessors"][0].update(count=2**40),
    "zeros": lambda j: (j["accessors"][0].update(count=2**31), j["accessors"][0].pop("bufferView")),
    "offset": lambda j: j["accessors"][0].update(byteOffset=-4),
    "view": lambda j: j["bufferViews"][0].update(byteLength=2**40),
    "stride": lambda j: j["bufferViews"][0].update(byteStride=1),
    "type": lambda j: j["accessors"][0].update(type="VEC9"),
    "index": lambda j: j["meshes"][0]["primitives"][0].update(indices=77),
    "indices": lambda j: j["meshes"][0]["primitives"][0].update(indices=0),
    "circle": lambda j: j["nodes"][0].update(children=[0]),
    "version": lambda j: j["asset"].update(version="1.0"),
    "list": lambda j: j.update(nodes={"0": {}}),
    "word": lambda j: j["accessors"][0].update(count="many"),
}


@pytest.mark.parametrize("lie", LIES)
def test_a_lying_gltf_is_refused(lie: str, path: Path) -> None:
    gltf = Gltf()
    gltf.board()
    gltf.save(path)
    assert same(str(path))
    LIES[lie](gltf.json)
    with pytest.raises(ImageFileError) as refused:
        load(gltf.save(path))
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("nodes", [2000, pytest.param(20_000, marks=pytest.mark.slow)])
def test_many_nodes_are_read_in_time_and_joined(path: Path, nodes: int) -> None:
    gltf = Gltf()
    gltf.board()
    primitive = gltf.json["meshes"][0]["primitives"][0]
    gltf.json["meshes"] = [{"primitives": [primitive]}] * 300
    gltf.json["nodes"] = [{"mesh": i % 300, "translation": [i, 0, 0]} for i in range(nodes)]
    gltf.json["scenes"] = [{"nodes": list(range(nodes))}]
    (mesh,) = load(gltf.save(path))
    assert len(mesh.faces) == 2 * nodes
    assert mesh.vertices[:, 0].max() == pytest.approx(nodes + 1)


@pytest.mark.parametrize("required", [True, False])
def test_instances_are_copies_where_they_are_put(path: Path, required: bool) -> None:
    gltf = Gltf()
    gltf.board()
    half = np.float32(0.5**0.5)
    where = {
        "TRANSLATION": gltf.array(np.array([[0, 0, 0], [5, 0, 0], [0, 0, 7]], np.float32)),
        "ROTATION": gltf.array(np.array([[0, 0, 0, 1], [0, 0, half, half], [0, 0, 0, 1]], "f4")),
        "SCALE": gltf.array(np.array([[1, 1, 1], [1, 1, 1], [2, 2, 2]], np.float32)),
    }
    name = "EXT_mesh_gpu_instancing"
    instances = {name: {"attributes": where}}
    gltf.json["nodes"][0] |= {"translation": [1, 0, 0], "extensions": instances}
    gltf.json["extensionsUsed"] = [name]
    gltf.json |= {"extensionsRequired": [name]} if required else {}
    (mesh,) = load(gltf.save(path))
    copies = [BOARD, BOARD[:, [1, 0, 2]] * [-1, 1, 1] + [5, 0, 0], 2 * BOARD + [0, 0, 7]]
    np.testing.assert_allclose(mesh.vertices, np.concatenate(copies) + [1, 0, 0], atol=1e-6)


def test_hidden_nodes_and_what_hangs_on_them_are_left_out(path: Path) -> None:
    gltf = Gltf()
    gltf.board()
    hidden = {"extensions": {"KHR_node_visibility": {"visible": False}}}
    gltf.json["nodes"] = [{"mesh": 0, "children": [1]}, {"children": [2], **hidden}, {"mesh": 0}]
    (mesh,) = load(gltf.save(path))
    assert len(mesh.vertices) == len(BOARD)
    gltf.json["nodes"][1].pop("extensions")
    (mesh,) = load(gltf.save(path))
    assert len(mesh.vertices) == 2 * len(BOARD)


@pytest.mark.parametrize(
    ("material", "note"),
    [
        ({"alphaMode": "BLEND", "pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 0.2]}},
         "transparent parts are drawn solid"),
        ({"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1}}},
         "transparent parts are drawn solid"),
        ({"emissiveFactor": [0, 0.5, 0]}, "light of its own was left out"),
        ({"alphaMode": "OPAQUE", "emissiveFactor": [0, 0, 0]}, None),
    ],
)  # fmt: skip
def test_what_is_not_drawn_is_said(path: Path, material: dict[str, Any], note: str | None) -> None:
    gltf = Gltf()
    gltf.board()["material"] = 0
    gltf.json["materials"] = [material]
    (mesh,) = load(gltf.save(path))
    assert mesh.finish.notes == ((note,) if note else ())


@pytest.mark.parametrize("safe", [False, True])
def test_written_out_data_may_be_encoded_for_addresses(tmp_path: Path, safe: bool) -> None:
    gltf = Gltf()
    board = BOARD * np.nextafter(np.float32(1), np.float32(0))  # bytes that need / in base64
    gltf.board(board)
    text = base64.b64encode(gltf.bytes).decode()
    plain = text.replace("+", "-").replace("/", "_").rstrip("=") if safe else quote(text, "")
    assert plain != text
    for data in (plain, text):
        uri = f"data:application/octet-stream;base64,{data}"
        gltf.json["buffers"] = [{"byteLength": len(gltf.bytes), "uri": uri}]
        (tmp_path / "a.gltf").write_text(json.dumps(gltf.json))
        (mesh,) = load(str(tmp_path / "a.gltf"))
        np.testing.assert_allclose(mesh.vertices, board, rtol=1e-7)


@pytest.mark.parametrize(
    ("modes", "wrap"),
    [((), "repeat"), ((33071, 33071), "clamp"), ((33648, 33648), "mirror"), ((33071,), "mixed")],
)
def test_what_lies_around_a_texture_is_obeyed_or_said(
    path: Path, modes: tuple[int, ...], wrap: str
) -> None:
    gltf = Gltf()
    gltf.board(TEXCOORD_0=gltf.array(2 * UV))
    gltf.textured()
    gltf.json["samplers"] = [dict(zip(("wrapS", "wrapT"), modes, strict=False))]
    gltf.json["textures"][0]["sampler"] = 0
    (mesh,) = load(gltf.save(path))
    assert mesh.finish.wrap == ("repeat" if wrap == "mixed" else wrap)
    assert bool(mesh.finish.notes) == (wrap == "mixed")
    gltf.json["accessors"][0] = gltf.json["accessors"][gltf.array(UV)]
    assert not load(gltf.save(path))[0].finish.notes  # nothing around it shows
