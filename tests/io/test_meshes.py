"""Meshes as tools write them: other formats than glTF, what is not opened, collected files."""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from deeplight.compose import mesh_file
from deeplight.compose.mesh import Mesh, load
from deeplight.errors import ImageFileError
from gltf import Gltf, corners

pytestmark = pytest.mark.needs("trimesh")

CASES = Path(__file__).parents[3] / "shared" / "cases"


def test_pipes_are_refused_before_they_are_opened(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    gltf = Gltf()
    gltf.board()
    gltf.json["buffers"] = [{"byteLength": len(gltf.bytes), "uri": "pipe"}]
    (tmp_path / "a.gltf").write_text(json.dumps(gltf.json))
    (tmp_path / "a.mtl").write_text("newmtl a\nmap_Kd pipe\n")
    triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    (tmp_path / "map.obj").write_text("mtllib a.mtl\nusemtl a\n" + triangle)
    (tmp_path / "library.obj").write_text("mtllib pipe\nusemtl a\n" + triangle)
    for name in ("a.gltf", "map.obj", "library.obj"):
        with pytest.raises(ImageFileError, match="regular file"):
            load(str(tmp_path / name))


def test_nothing_outside_the_folder_is_read(tmp_path: Path) -> None:
    (tmp_path / "inside").mkdir()
    Image.new("RGB", (4, 4), (200, 100, 50)).save(tmp_path / "secret.png")
    (tmp_path / "inside" / "a.mtl").write_text(f"newmtl a\nmap_Kd {tmp_path}/secret.png\n")
    content = "mtllib a.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nf 1/1 2/1 3/1\n"
    (tmp_path / "inside" / "a.obj").write_text(content)
    (mesh,) = load(str(tmp_path / "inside" / "a.obj"))
    assert mesh.finish.lost
    assert mesh.finish.colour_map is None
    Image.new("RGB", (4, 4), (10, 20, 30)).save(tmp_path / "inside" / "secret.png")
    mesh_file_name = tmp_path / "inside" / "b.obj"  # its last part alone is looked for next to it
    mesh_file_name.write_text(content)
    assert load(str(mesh_file_name))[0].finish.colour_map[0, 0].tolist() == [10, 20, 30]


def test_a_text_mesh_of_any_size_is_not_read(tmp_path: Path, monkeypatch: Any) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    monkeypatch.setattr(mesh_file, "MAX_TEXT_BYTES", 10)
    with pytest.raises(ImageFileError, match=r"\.obj of at most"):
        load(str(tmp_path / "a.obj"))


SOUND = CASES / "sound"


@pytest.mark.skipif(not SOUND.exists(), reason="needs ../shared/cases")
def test_the_collected_meshes_are_read_right() -> None:
    def first(name: str) -> Mesh:
        return load(str(SOUND / name))[0]

    base = corners(first("mesh_base.glb"))
    for name in ("mesh_vc_u16.glb", "mesh_vcm_f32.glb"):
        assert first(name).colours[0] == pytest.approx([0.5, 0.25, 0.1], abs=2e-5)
        assert corners(first(name)) == pytest.approx(base)
    plain, quantised = (load(str(SOUND / f"mesh_two_{kind}.glb")) for kind in ("plain", "quant"))
    for one, other in zip(plain, quantised, strict=True):
        assert corners(other) == pytest.approx(corners(one), abs=1e-4)
    assert first("mesh_uv_u16norm.glb").uv == pytest.approx(first("mesh_uv_float.glb").uv, abs=1e-5)
    assert first("mesh_tt.glb").uv[0] == pytest.approx([0.625, 0.375])
    assert np.ptp(first("mesh_skin.glb").vertices, axis=0) == pytest.approx([0.02, 0.02, 0.02])
    points = np.unique(first("mesh_draco.glb").vertices.round(3), axis=0)
    assert points == pytest.approx(np.unique(first("mesh_base.glb").vertices, axis=0), abs=1e-3)
    assert sum(len(mesh.faces) for mesh in load(str(SOUND / "mesh_latin.obj"))) == 24
    assert corners(first("mesh_ext.gltf")) == pytest.approx(base)


@pytest.mark.timeout(120)
def test_a_rough_scan_without_normals_takes_time_in_proportion(tmp_path: Path) -> None:
    """80,000 triangles, nearly every edge a sharp one; what compared all with all took minutes."""
    side = 200
    rows, columns = np.indices((side + 1, side + 1)).reshape(2, -1)
    corners = "".join(f"v {x} {y} {x * y % 7}\n" for x, y in zip(columns, rows, strict=True))
    starts = 1 + ((side + 1) * rows + columns)[(rows < side) & (columns < side)]
    quads = "".join(f"f {v} {v + 1} {v + side + 2} {v + side + 1}\n" for v in starts)
    (tmp_path / "a.obj").write_text(corners + quads)
    (mesh,) = load(str(tmp_path / "a.obj"))
    assert len(mesh.faces) == 2 * side**2
    assert np.linalg.norm(mesh.normals, axis=-1) == pytest.approx(1)
