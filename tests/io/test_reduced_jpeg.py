"""JPEGs decoded at the scale that is needed: the same photo, smaller, of the same field of view."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from deeplight.errors import ImageFileError
from deeplight.io import photo_decoders
from deeplight.io.photo_like import as_photo
from deeplight.io.photos import read_photo


@pytest.fixture
def large(tmp_path: Path) -> Path:
    """A smooth picture of 1600 x 1201, stored on its side, of 28 mm."""
    y, x = np.mgrid[:1201, :1600] / 400
    pixels = np.stack([128 + 90 * np.sin(x), 128 + 90 * np.cos(y), 128 + 60 * np.sin(x + y)], -1)
    exif = Image.Exif()
    exif[0x0112] = 6
    exif.get_ifd(0x8769)[0xA405] = 28
    exif.get_ifd(0x8769)[0x920A] = 4.0
    Image.fromarray(pixels.astype(np.uint8)).save(tmp_path / "a.jpg", quality=95, exif=exif)
    return tmp_path / "a.jpg"


@pytest.mark.parametrize(("max_side", "scale"), [(700, 2), (400, 4), (150, 8), (20, 8)])
def test_a_jpeg_comes_as_small_as_is_asked_and_no_smaller(large, max_side, scale):
    whole, reduced = read_photo(large), read_photo(large, max_side)
    height, width = (-(-side // scale) for side in whole.pixels.shape[:2])
    assert reduced.pixels.shape == (height, width, 3)
    assert max(height, width) >= max_side
    assert reduced.vertical_fov_rad == whole.vertical_fov_rad
    sides = (scale * (height - 1), scale * (width - 1))
    inner = whole.pixels[: sides[0], : sides[1]].astype(float)
    means = inner.reshape(height - 1, scale, width - 1, scale, 3).mean((1, 3))
    off = np.abs(means - reduced.pixels[: height - 1, : width - 1])
    if whole.pixels.shape[1] % scale == 0:  # turned, a cut block may lie at either end
        assert off.mean() < 2
    assert np.abs(whole.pixels.mean((0, 1)) - reduced.pixels.mean((0, 1))).max() < 2


def test_small_ones_and_other_files_are_read_as_they_are(large, tmp_path):
    np.testing.assert_array_equal(read_photo(large, 900).pixels, read_photo(large).pixels)
    Image.open(large).save(tmp_path / "a.png")
    assert max(read_photo(tmp_path / "a.png", 200).pixels.shape) == 1600


def test_bytes_are_read_as_their_file_is(large):
    of_bytes = as_photo(large.read_bytes(), 400)
    np.testing.assert_array_equal(of_bytes.pixels, as_photo(large, 400).pixels)


@pytest.mark.parametrize(
    ("mode", "max_side", "options"),
    [
        ("RGB", 250, {}),
        ("RGB", 130, {"subsampling": 0}),
        ("RGB", 20, {"subsampling": 1}),
        ("RGB", 130, {"progressive": True}),
        ("L", 130, {}),
        ("CMYK", 130, {}),
    ],
)
def test_pixels_are_pillows(tmp_path, monkeypatch, mode, max_side, options):
    pytest.importorskip("simplejpeg")
    noise = np.random.default_rng(0).integers(0, 256, (405, 603, 3)).astype(np.uint8)
    Image.fromarray(noise).convert(mode).save(tmp_path / "a.jpg", **options)
    fast = read_photo(tmp_path / "a.jpg", max_side)
    monkeypatch.setattr(photo_decoders, "simplejpeg", None)
    np.testing.assert_array_equal(fast.pixels, read_photo(tmp_path / "a.jpg", max_side).pixels)


def test_what_is_damaged_is_read_as_far_as_pillow_can(large, tmp_path, monkeypatch):
    content = bytearray(large.read_bytes())
    middle = len(content) // 2
    content[middle : middle + 40] = bytes(40)
    (tmp_path / "damaged.jpg").write_bytes(content)
    fast = read_photo(tmp_path / "damaged.jpg", 400)
    monkeypatch.setattr(photo_decoders, "simplejpeg", None)
    slow = read_photo(tmp_path / "damaged.jpg", 400)
    np.testing.assert_array_equal(fast.pixels, slow.pixels)


def test_a_cut_file_is_refused(large, tmp_path):
    content = large.read_bytes()
    (tmp_path / "cut.jpg").write_bytes(content[: len(content) // 2])
    with pytest.raises(ImageFileError):
        read_photo(tmp_path / "cut.jpg", 200)
