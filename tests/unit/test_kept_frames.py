"""Composed frames that outlive a kill."""

import numpy as np
import pytest

pytest.importorskip("cv2")
pytest.importorskip("mitsuba")

from deeplight.compose.composite import Composite
from deeplight.compose.kept_frames import KeptFrames
from deeplight.compose.mesh_file import read_meshes
from deeplight.compose.scene import Solid
from deeplight.compose.trace import Layers
from deeplight.compose.video import _made_of


def made(plate: np.ndarray) -> Composite:
    pixels = plate.copy()
    pixels[5:15, 3:23] = np.random.default_rng(0).integers(0, 256, (10, 20, 3), dtype=np.uint8)
    nothing = np.zeros((10, 20, 3), np.float32)
    return Composite(pixels, Layers((3, 5, 23, 15), nothing, nothing[..., 0], nothing))


def test_a_frame_comes_back_byte_for_byte_and_only_for_the_same_settings(tmp_path):
    plate = np.full((30, 40, 3), 90, np.uint8)
    composed, out = made(plate), tmp_path / "a.mp4"
    kept = KeptFrames(out, b"one")
    assert kept.find(7, plate) is None
    kept.keep_frame(7, composed)
    again = KeptFrames(out, b"one")
    np.testing.assert_array_equal(again.find(7, plate), composed.pixels)
    assert again.find(8, plate) is None
    assert KeptFrames(out, b"other").find(7, plate) is None


def test_a_damaged_frame_is_composed_anew_and_nothing_stays(tmp_path):
    plate = np.full((30, 40, 3), 90, np.uint8)
    kept = KeptFrames(tmp_path / "a.mp4", b"one")
    kept.keep_frame(1, made(plate))
    (path,) = kept.folder.glob("*.png")
    path.write_bytes(path.read_bytes()[:50])
    assert kept.find(1, plate) is None
    kept.remove()
    assert not list(tmp_path.iterdir())


def test_what_frames_are_made_of_counts_all_files_of_a_mesh(tmp_path):
    """An .obj's material lies in another file; its own does not change with it."""
    mesh = tmp_path / "a.obj"
    mesh.write_text("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n")

    def made_from(colour: str) -> bytes:
        (tmp_path / "a.mtl").write_text(f"newmtl m\nKd {colour}\n")
        return _made_of(mesh, [Solid(tuple(read_meshes(mesh, 10)), "file")])

    assert made_from("0.2 0.3 0.4") == made_from("0.2 0.3 0.4")
    assert made_from("0.2 0.3 0.4") != made_from("0.9 0.3 0.4")
