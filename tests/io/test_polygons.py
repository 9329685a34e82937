"""Polygons of any shape: their triangles cover them once, whichever corner comes first."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deeplight.compose.mesh import load
from deeplight.compose.polygons import cut_obj, ears, fans_out
from deeplight.errors import ImageFileError

pytestmark = [pytest.mark.needs("trimesh"), pytest.mark.needs("mapbox_earcut")]

STAIRS = np.array([(x, y, 0.0) for x, y in zip((0, 3, 3, 2, 2, 1, 1, 0), (0, 0, 1, 1, 2, 2, 3, 3))])  # noqa: B905
AREA = 6.0


def turns(polygon: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Twice the area of each triangle along the polygon's own normal."""
    a, b, c = np.moveaxis(polygon[triangles], 1, 0)
    spokes = polygon[1:] - polygon[0]
    normal = np.cross(spokes[:-1], spokes[1:]).sum(0)
    return np.cross(b - a, c - a) @ normal / np.linalg.norm(normal)


@given(
    radii=st.lists(st.floats(0.2, 1.0), min_size=4, max_size=12),
    turn=st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.hypot(*q[:2]) > 0.1),
    backwards=st.booleans(),
)
def test_ears_cover_a_star_once_however_it_lies(
    radii: list[float], turn: tuple[float, ...], backwards: bool
) -> None:
    angles = np.arange(len(radii)) * 2 * np.pi / len(radii)
    flat = np.stack([np.cos(angles), np.sin(angles), 0 * angles], -1) * np.array(radii)[:, None]
    rotation, _ = np.linalg.qr(np.array([*turn, 1, 0, 2, 1, 1]).reshape(3, 3) + np.eye(3))
    polygon = (flat @ rotation.T)[:: -1 if backwards else 1]
    found = turns(polygon, ears(polygon))
    nexts = np.roll(radii, -1)
    area = np.dot(radii, nexts) * np.sin(2 * np.pi / len(radii))
    assert found.min() > -1e-9
    assert found.sum() == pytest.approx(area)


def test_a_fan_is_right_from_a_corner_that_sees_the_whole_polygon() -> None:
    fans = fans_out(np.stack([np.roll(STAIRS, -first, 0) for first in range(8)]))
    assert fans.tolist() == [True, False, False, False, False, False, False, False]


def test_a_polygon_without_an_inside_loses_no_triangle() -> None:
    line = np.array([(0, 0, 0), (1, 1, 1), (3, 3, 3), (2, 2, 2)], float)
    assert ears(line).tolist() == [[0, 1, 2], [0, 2, 3]]


def written(folder: Path, kind: str, first: int) -> Path:
    corners = [*range(first, 8), *range(first)]
    path = folder / ("a.obj" if kind == "obj" else "a.ply")
    if kind == "obj":
        rows = "".join(f"v {x} {y} {z}\n" for x, y, z in STAIRS)
        names = " ".join(str(corner + 1) for corner in corners[:4])
        rest = " ".join(f"{corner - 8}" for corner in corners[4:])
        path.write_text(f"{rows}f {names} \\\n {rest}\n")  # goes on in the next line, backwards
        return path
    head = f"ply\nformat {kind} 1.0\nelement vertex 8\nproperty float x\nproperty float y\n"
    head += "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    if kind == "ascii":
        rows = "".join(f"{x} {y} {z}\n" for x, y, z in STAIRS)
        path.write_text(f"{head}{rows}8 {' '.join(map(str, corners))}\n")
        return path
    order = "<" if "little" in kind else ">"
    content = STAIRS.astype(f"{order}f4").tobytes() + b"\x08"
    path.write_bytes(head.encode() + content + np.array(corners, f"{order}i4").tobytes())
    return path


@pytest.mark.parametrize("first", [0, 3, 5])
@pytest.mark.parametrize("kind", ["obj", "ascii", "binary_little_endian", "binary_big_endian"])
def test_the_side_of_a_staircase_has_its_own_area(tmp_path: Path, kind: str, first: int) -> None:
    (mesh,) = load(str(written(tmp_path, kind, first)))
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    parts = np.cross(b - a, c - a)[:, 2] / 2
    assert np.abs(parts).sum() == pytest.approx(parts.sum()) == AREA


def test_what_a_fan_is_right_for_stays_as_it_was() -> None:
    square = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\nf 1/2/3 2//1 3/1 4\n"
    assert cut_obj(square) == square


@pytest.mark.parametrize("face", ["0 1 2", "1 0/1 2", "1 2 0"])
def test_a_face_with_a_vertex_that_cannot_be_is_refused(tmp_path: Path, face: str) -> None:
    (tmp_path / "a.obj").write_text(f"v 0 0 0\nv 1 0 0\nv 1 1 0\nf {face}\n")
    with pytest.raises(ImageFileError, match="vertex 0"):
        load(str(tmp_path / "a.obj"))
