"""Objects that are put into a photo: built in ones, files, their materials and textures."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from deeplight.camera import PinholeCamera
from deeplight.compose import shapes
from deeplight.compose.compose import Item, placed
from deeplight.compose.ground import Viewpoint
from deeplight.compose.mesh import Mesh, load, standing
from deeplight.errors import ConfigError, ImageFileError
from deeplight.frames import normalised


@pytest.mark.parametrize("turn_deg", [0, 35, 200])
def test_an_object_stands_on_its_place_at_its_size(turn_deg: float) -> None:
    at = np.array([1.0, 0.0, -2.0])
    (mesh,) = standing(load("bunny"), at, 0.3, np.radians(turn_deg))
    low, high = mesh.vertices.min(0), mesh.vertices.max(0)
    assert low[1] == pytest.approx(0, abs=1e-9)
    assert high[1] - low[1] == pytest.approx(0.3, rel=1e-6)  # its ears are its longest side
    assert (low + high)[[0, 2]] / 2 == pytest.approx(at[[0, 2]])


@pytest.mark.parametrize("shape", [shapes.bunny, shapes.ball])
def test_built_in_objects_are_closed_and_face_outwards(shape: Any) -> None:
    vertices, faces, normals = shape()
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, times = np.unique(edges, axis=0, return_counts=True)
    assert (times == 2).mean() > 0.999  # surface nets join four faces where two sheets touch
    corners = vertices[faces]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((across * normals[faces].mean(1)).sum(-1) > 0).mean() > 0.99
    volume = (corners[:, 0] * across).sum() / 6
    assert volume > 0
    if shape is shapes.ball:
        assert volume == pytest.approx(np.pi / 6, rel=0.01)


def text(content: str, name: str, folder: Path) -> str:
    (folder / name).write_text(content)
    return str(folder / name)


PLY = "ply\nformat ascii 1.0\nelement vertex 3\n"
PLY += "".join(f"property float {axis}\n" for axis in "xyz")
BROKEN = {
    "empty.obj": "",
    "words.ply": "this is no mesh\n",
    "words.glb": "this is no mesh\n",
    "words.gltf": "{}",
    "points.ply": PLY + "end_header\n0 0 0\n1 0 0\n0 1 0\n",
    "no_faces.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\n",
    "nan.obj": "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "flat_point.obj": "v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n",
    "cut_off.ply": PLY
    + "element face 5\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0",
    "far.obj": "v 0 0 0\nv 1e30 0 0\nv 0 1 0\nf 1 2 3\n",
    "picture.png": "x",
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_bad_mesh_is_reported_in_one_line(name: str, tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    with pytest.raises(ImageFileError) as caught:
        load(text(BROKEN[name], name, tmp_path))
    assert "\n" not in str(caught.value)


def test_a_missing_mesh_is_an_os_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        load(str(tmp_path / "none.glb"))


def test_an_open_surface_may_be_used_and_z_may_be_up(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    content = "v 0 0 0\nv 2 0 0\nv 0 0 5\nf 1 2 3\n"
    path = text(content, "open.obj", tmp_path)
    (lying,), (upright,) = load(path), load(path, "z")
    assert np.ptp(lying.vertices, axis=0) == pytest.approx([2, 0, 5])
    assert np.ptp(upright.vertices, axis=0) == pytest.approx([2, 5, 0])
    assert upright.vertices[:, 1].max() == pytest.approx(5)  # up, not down


def test_edges_are_sharp_and_round_things_round_where_a_file_has_no_normals(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    box, ball = trimesh.creation.box((1, 2, 3)), trimesh.creation.icosphere(2)
    for name, shape in (("box", box), ("ball", ball)):
        shape.export(tmp_path / f"{name}.ply", vertex_normal=False)
    (flat,), (round_,) = (load(str(tmp_path / f"{name}.ply")) for name in ("box", "ball"))
    assert flat.normals is not None
    assert round_.normals is not None
    outwards = np.abs(flat.normals).max(1)  # a box's: along one axis each
    assert outwards == pytest.approx(1)
    assert len(round_.vertices) == len(ball.vertices)
    cosine = (round_.normals * round_.vertices).sum(1)
    assert cosine.min() > 0.99


def test_a_mesh_is_read_anew_when_its_file_has_changed(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    path = tmp_path / "a.ply"
    trimesh.creation.box((1, 1, 1)).export(path)
    assert load(str(path)) is load(str(path))
    trimesh.creation.icosphere(1).export(path)
    assert len(load(str(path))[0].faces) == 80


def test_a_large_texture_is_reduced_and_a_huge_one_refused_by_name(
    tmp_path: Path, monkeypatch
) -> None:
    trimesh = pytest.importorskip("trimesh")
    picture = Image.fromarray(np.full((64, 32, 3), 200, np.uint8))
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=picture)
    box = trimesh.creation.box((1, 1, 1))
    box.visual = trimesh.visual.TextureVisuals(np.zeros((len(box.vertices), 2)), material=material)
    for name in ("a.glb", "b.glb"):
        (tmp_path / name).write_bytes(box.export(file_type="glb"))
    monkeypatch.setattr("deeplight.compose.textures.KEPT_TEXTURE_PX", 30)
    (kept,) = load(str(tmp_path / "a.glb"))
    assert kept.finish.colour_map is not None
    assert kept.finish.colour_map.shape == (22, 11, 3)
    monkeypatch.setattr("deeplight.compose.textures.MAX_TEXTURE_PX", 50)
    with pytest.raises(ImageFileError, match=r"b\.glb.*32 x 64"):
        load(str(tmp_path / "b.glb"))


def test_a_glb_keeps_its_place_material_and_texture(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    picture = Image.new("RGB", (4, 4), (200, 100, 50))
    material = trimesh.visual.material.PBRMaterial(
        baseColorTexture=picture, roughnessFactor=0.25, metallicFactor=0.75
    )
    box = trimesh.creation.box((1, 2, 3))
    box.visual = trimesh.visual.TextureVisuals(np.zeros((len(box.vertices), 2)), material=material)
    scene = trimesh.Scene()
    scene.add_geometry(box, transform=trimesh.transformations.translation_matrix([5, 0, 0]))
    path = tmp_path / "box.glb"
    path.write_bytes(scene.export(file_type="glb"))
    (mesh,) = load(str(path))
    assert mesh.vertices.mean(0)[0] == pytest.approx(5)
    assert (mesh.finish.roughness, mesh.finish.metallic) == (0.25, 0.75)
    assert mesh.finish.colour_map is not None
    assert mesh.finish.colour_map[0, 0].tolist() == [200, 100, 50]
    assert not mesh.finish.lost


def test_a_sharp_edged_part_keeps_a_colour_without_texture(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box((1, 2, 3))
    material = trimesh.visual.material.PBRMaterial(
        baseColorFactor=[51, 102, 255, 255], roughnessFactor=0.5, metallicFactor=0.25
    )
    box.visual = trimesh.visual.TextureVisuals(material=material)
    path = tmp_path / "box.glb"
    path.write_bytes(box.export(file_type="glb"))
    (mesh,) = load(str(path))
    assert mesh.finish.colour == pytest.approx((0.2, 0.4, 1.0))
    assert (mesh.finish.roughness, mesh.finish.metallic) == (0.5, 0.25)


def test_colours_of_faces_are_kept(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box((1, 1, 1))
    box.visual.face_colors = np.arange(12)[:, None] * [20, 10, 0, 0] + [0, 0, 0, 255]
    box.export(tmp_path / "box.ply")
    (mesh,) = load(str(tmp_path / "box.ply"))
    assert mesh.colours is not None
    of_faces = mesh.colours[mesh.faces]
    assert np.ptp(of_faces, axis=1).max() < 1e-6
    assert len(np.unique(of_faces[:, 0, 0].round(4))) == 12


def test_a_texture_that_cannot_be_read_is_reported(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    content = "mtllib none.mtl\nusemtl x\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    (mesh,) = load(text(content, "board.obj", tmp_path))
    assert mesh.finish.lost
    camera = Viewpoint(PinholeCamera(64, 48, 1.0), pitch_rad=-0.5)
    _, notes = placed(camera, [Item(str(tmp_path / "board.obj"))])
    assert any("could not be read" in note for note in notes)
    (mesh,) = load(text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "plain.obj", tmp_path))
    assert not mesh.finish.lost


@pytest.mark.parametrize(
    "wrong", [{"material": "gold"}, {"size_m": -1.0}, {"up": "x"}, {"material": "file"}]
)
def test_a_wrong_item_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ConfigError):
        Item("bunny", **wrong)


EYE = np.array([0.4, 1.4, 2.0])


def seen(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Cosines between the view and the normals of each face: its own, and its corners'."""
    corners = mesh.vertices[mesh.faces]
    own = normalised(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]))
    view = normalised(EYE - corners)
    return np.einsum("fc,fc->f", own, view[:, 0]), (mesh.normals[mesh.faces] * view).sum(-1)


@pytest.mark.parametrize("name", ["bunny", "sphere", "pot"])
def test_no_normal_of_a_face_that_is_seen_turns_away(name: str) -> None:
    mesh = standing(load(name), np.zeros(3), 1.0)[0]
    face, corners = seen(mesh)
    assert corners[face > 1e-6].min() < 0  # as it comes, it does at the outline
    bent = mesh.towards(EYE)
    assert seen(bent)[1][face > 1e-6].min() > 0.02
    assert np.linalg.norm(bent.normals, axis=-1) == pytest.approx(1)
    front = np.isin(np.arange(len(mesh.vertices)), mesh.faces[face > 0])
    front &= (mesh.normals * normalised(EYE - mesh.vertices)).sum(-1) > 0.06
    assert bent.normals[front] == pytest.approx(mesh.normals[front])  # away from the outline


def test_an_open_surface_seen_from_behind_keeps_its_side() -> None:
    square = np.array([[-1, 0, 3], [1, 0, 3], [1, 2, 3], [-1, 2, 3]], float)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    behind = Mesh(square, faces, np.tile([0.0, 0, 1], (4, 1)))
    assert behind.towards(EYE).normals == pytest.approx(behind.normals)
    assert Mesh(square, faces).towards(EYE).normals is None
