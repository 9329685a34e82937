"""Faces of any number of corners, in text and binary."""

from pathlib import Path

import numpy as np
import pytest

from deeplight.compose.mesh import Mesh, load

pytestmark = pytest.mark.needs("trimesh")

CORNERS = [(0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0), (1, 2, 0)]
FACES = [[0, 1, 2, 3], [3, 2, 4]]  # a quad and a triangle on it


def area(mesh: Mesh) -> float:
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return float(np.cross(b - a, c - a)[:, 2].sum() / 2)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("kinds", ["uchar int", "int uint", "uint8 ushort"])
@pytest.mark.parametrize("faces", [FACES, FACES[:1], FACES[1:]])
def test_a_binary_ply_may_mix_triangles_and_quads(
    tmp_path: Path, order: str, kinds: str, faces: list[list[int]]
) -> None:
    number, each = ({"uchar": "u1", "uint8": "u1", "int": "i4", "uint": "u4", "ushort": "u2"}[k]
                    for k in kinds.split())  # fmt: skip
    endian = "little" if order == "<" else "big"
    head = f"ply\nformat binary_{endian}_endian 1.0\nelement vertex {len(CORNERS)}\n"
    head += "".join(f"property double {axis}\n" for axis in "xyz")
    head += f"element face {len(faces)}\nproperty list {kinds} vertex_indices\nend_header\n"
    lists = [
        np.array([len(f)], order + number).tobytes() + np.array(f, order + each).tobytes()
        for f in faces
    ]
    content = head.encode() + np.array(CORNERS, f"{order}f8").tobytes() + b"".join(lists)
    (tmp_path / "a.ply").write_bytes(content)
    (mesh,) = load(str(tmp_path / "a.ply"))
    assert area(mesh) == pytest.approx(2 * (FACES[0] in faces) + (FACES[1] in faces))


def test_an_obj_may_be_written_with_tabs_and_count_backwards(tmp_path: Path) -> None:
    corners = "".join(f"v\t{x}\t{y}\t{z}\r\n" for x, y, z in CORNERS)
    (tmp_path / "a.obj").write_bytes(f"{corners}f\t-5\t-4\t-3\t-2\r\nf\t4\t3\t5\r\n".encode())
    (mesh,) = load(str(tmp_path / "a.obj"))
    assert area(mesh) == pytest.approx(3)
