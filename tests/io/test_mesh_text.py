"""Meshes of text, .obj, .mtl and .ply, as programs of many years have written them."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from deeplight.compose.mesh import Mesh, load
from deeplight.compose.mesh_text import PLACED, plain_mtl

pytestmark = pytest.mark.needs("trimesh")


@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-8-sig", "utf-16"])
def test_an_obj_and_its_materials_may_be_of_any_encoding(encoding: str, tmp_path: Path) -> None:
    (tmp_path / "a.mtl").write_bytes("newmtl é\nKd 1 0 0\n".encode(encoding))
    content = "# modèle\nmtllib a.mtl\nusemtl é\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    (tmp_path / "a.obj").write_bytes(content.encode(encoding))
    (mesh,) = load(str(tmp_path / "a.obj"))
    assert mesh.finish.colour == pytest.approx((1, 0, 0))


def test_a_ply_of_sixteen_bit_colours_keeps_them(tmp_path: Path) -> None:
    def colour(kind: str, most: int) -> np.ndarray:
        head = "ply\nformat ascii 1.0\ncomment é\nelement vertex 3\n"
        head += "".join(f"property float {axis}\n" for axis in "xyz")
        head += "".join(f"property {kind} {name}\n" for name in ("red", "green", "blue"))
        head += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        values = f"{most} {round(0.5 * most)} {round(0.1 * most)}"
        rows = "".join(f"{xy} 0 {values}\n" for xy in ("0 0", "1 0", "0 1"))
        (tmp_path / f"{kind}.ply").write_bytes((head + rows + "3 0 1 2\n").encode("latin-1"))
        return load(str(tmp_path / f"{kind}.ply"))[0].colours[0]

    assert colour("ushort", 65535) == pytest.approx(colour("uchar", 255), abs=0.005)


@pytest.mark.parametrize("prefix", ["", "diffuse_"])
@pytest.mark.parametrize("names", [("red", "green", "blue"), ("r", "g", "b")])
def test_the_colours_of_a_ply_have_several_names(
    tmp_path: Path, prefix: str, names: tuple[str, ...]
) -> None:
    head = "ply\nformat binary_big_endian 1.0\nelement vertex 3\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += "".join(f"property uchar {prefix}{name}\n" for name in names)
    head += "element face 1\nproperty list uchar int vertex_index\nend_header\n"
    kind = [("xyz", ">f4", 3), ("rgb", "u1", 3)]
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    rows = np.array([(corner, (255, 51, 0)) for corner in corners], kind)
    face = b"\3" + np.array([0, 1, 2], ">i4").tobytes()
    (tmp_path / "a.ply").write_bytes(head.encode() + rows.tobytes() + face)
    (mesh,) = load(str(tmp_path / "a.ply"))
    assert mesh.colours[0] == pytest.approx([1, 0.2**2.2, 0])


def textured(folder: Path, libraries: str, materials: dict[str, str]) -> Mesh:
    """A triangle of material "a", and the material files next to it."""
    Image.new("RGB", (4, 4), (200, 100, 50)).save(folder / "t x.png")
    for name, text in materials.items():
        (folder / name).write_text(text)
    corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\n"
    (folder / "a.obj").write_text(f"{libraries}\n{corners}usemtl a\nf 1/1 2/2 3/3\n")
    (mesh,) = load(str(folder / "a.obj"))
    return mesh


@pytest.mark.parametrize(
    "libraries",
    ["mtllib b.mtl my a.mtl", "mtllib b.mtl\nmtllib my a.mtl", "mtllib my a.mtl\nmtllib gone.mtl"],
)
def test_an_obj_may_name_several_material_files(tmp_path: Path, libraries: str) -> None:
    materials = {"b.mtl": "newmtl b\nKd 0 0 1\n", "my a.mtl": "newmtl a\nKd 1 0.5 0\n"}
    finish = textured(tmp_path, libraries, materials).finish
    assert finish.colour == pytest.approx((1, 0.5**2.2, 0), abs=0.003)  # in 8 bits
    assert not finish.lost


@pytest.mark.parametrize(
    ("options", "is_placed"),
    [
        ("", False),
        ("-clamp on -bm 0.5 ", False),
        ("-s 1 1 1 -o 0 0 0 ", False),
        ("-s 2 2 1 ", True),
        ("-mm 0 1 -o 0.5 0 ", True),
    ],
)
def test_a_texture_is_found_behind_its_options(
    tmp_path: Path, options: str, is_placed: bool
) -> None:
    material = f"newmtl a\nKd 1 1 1\nmap_Kd {options}t x.png\n"
    finish = textured(tmp_path, "mtllib a.mtl", {"a.mtl": material}).finish
    assert finish.colour_map[0, 0].tolist() == [200, 100, 50]
    assert finish.notes == ((PLACED,) if is_placed else ())


def test_a_lone_number_of_a_material_is_grey() -> None:
    def never() -> None:
        raise AssertionError

    assert plain_mtl(b"Kd 0.5\r\nKa 1 0 0\n", never) == b"Kd 0.5 0.5 0.5\nKa 1 0 0\n"


LINES = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nvt 0 0\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1 4/1/1\n"
WAYS = {
    "as ever": LINES,
    "comments behind numbers": LINES.replace("\n", " # v 9 9 9\n"),
    "indented": "  " + LINES.replace("\n", "\n \t"),
    "CR": LINES.replace("\n", "\r"),
    "CR LF": LINES.replace("\n", "\r\n"),
    "continued": LINES.replace("3/1/1", "\\ \n3/1/1"),
}


@pytest.mark.parametrize("way", WAYS)
def test_the_lines_of_an_obj_may_look_otherwise(tmp_path: Path, way: str) -> None:
    (tmp_path / "a.obj").write_bytes(WAYS[way].encode())
    (mesh,) = load(str(tmp_path / "a.obj"))
    triangles = mesh.vertices[mesh.faces]
    sides = triangles[:, 1:] - triangles[:, :1]
    assert np.cross(sides[:, 0], sides[:, 1]).sum(0) / 2 == pytest.approx([0, 0, 4])
    assert len(mesh.faces) == 2


def test_a_name_may_hold_the_sign_of_comments(tmp_path: Path) -> None:
    mesh = textured(tmp_path, "mtllib a#1.mtl", {"a#1.mtl": "newmtl a\nKd 1 0 0\n"})
    assert mesh.finish.colour == pytest.approx((1, 0, 0))
