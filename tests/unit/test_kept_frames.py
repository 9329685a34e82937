"""Composed frames that outlive a kill."""

import numpy as np

from deeplight.compose.composite import Composite
from deeplight.compose.kept_frames import KeptFrames
from deeplight.compose.trace import Layers


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
    kept.keep(7, composed)
    again = KeptFrames(out, b"one")
    np.testing.assert_array_equal(again.find(7, plate), composed.pixels)
    assert again.find(8, plate) is None
    assert KeptFrames(out, b"other").find(7, plate) is None


def test_a_damaged_frame_is_composed_anew_and_nothing_stays(tmp_path):
    plate = np.full((30, 40, 3), 90, np.uint8)
    kept = KeptFrames(tmp_path / "a.mp4", b"one")
    kept.keep(1, made(plate))
    (path,) = kept.folder.glob("*.png")
    path.write_bytes(path.read_bytes()[:50])
    assert kept.find(1, plate) is None
    kept.remove()
    assert not list(tmp_path.iterdir())
