"""Orientation and field of view from EXIF, against Pillow and against known lenses."""

import math
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageOps

from deeplight.io.exif import (
    CAMERA,
    GPS,
    Exif,
    ExifDirectories,
    camera_name,
    exif_directories,
    number,
    upright,
)
from deeplight.io.photos import read_photo


@pytest.mark.parametrize("orientation", range(1, 9))
def test_upright_agrees_with_pillow(orientation: int) -> None:
    stored = np.arange(4 * 7 * 3, dtype=np.uint8).reshape(4, 7, 3)
    picture = Image.fromarray(stored)
    picture.getexif()[0x0112] = orientation
    expected = np.asarray(ImageOps.exif_transpose(picture))
    turned = upright(stored, orientation)
    np.testing.assert_array_equal(turned, expected)
    assert np.shares_memory(turned, stored)  # turning is free


@pytest.mark.parametrize(
    ("make", "model", "name"),
    [
        ("Apple", "iPhone 12", "Apple iPhone 12"),
        ("Canon", "Canon EOS R5", "Canon EOS R5"),  # once
        ("samsung\0", "  SM-G991B ", "samsung SM-G991B"),
        ("Google", None, "Google"),
        (None, "Pixel 8", "Pixel 8"),
        (None, None, ""),
        (b"\xff", 7, "b'\\xff' 7"),
    ],
)
def test_a_camera_has_one_name(make: object, model: object, name: str) -> None:
    assert camera_name(make, model) == name
    assert len(camera_name("a" * 5000, "b" * 5000)) < 300


def test_an_unknown_orientation_changes_nothing() -> None:
    stored = np.arange(24, dtype=np.uint8).reshape(2, 4, 3)
    np.testing.assert_array_equal(upright(stored, 0), stored)


def test_a_36_mm_lens_on_a_3_to_2_frame_is_textbook() -> None:
    # Full frame: 36 mm focal length sees 36 mm of width as 2 atan(1/2), 24 mm of height less.
    exif = Exif(focal_length_35mm_mm=36)
    assert exif.vertical_fov_rad(6000, 4000) == pytest.approx(2 * math.atan(12 / 36))
    turned = Exif(focal_length_35mm_mm=36, orientation=6)
    assert turned.vertical_fov_rad(6000, 4000) == pytest.approx(2 * math.atan(18 / 36))


def test_the_35_mm_figure_compares_diagonals() -> None:
    # A phone's "26 mm" on a 4:3 sensor: the diagonal field of view is that of 43.27 mm film.
    exif = Exif(focal_length_35mm_mm=26)
    focal = exif.focal_length_px(4000, 3000)
    assert focal is not None
    assert 2 * math.atan(2500 / focal) == pytest.approx(2 * math.atan(43.2666 / 2 / 26), abs=1e-5)
    assert exif.vertical_fov_rad(4000, 3000) == exif.vertical_fov_rad(1000, 750)


@pytest.mark.parametrize(("unit", "resolution"), [(2, 2.54 * 5000), (3, 5000), (4, 500)])
def test_the_focal_plane_gives_pixels_in_every_unit(unit: int, resolution: float) -> None:
    exif = Exif(focal_length_mm=4, focal_plane_x_resolution=resolution, focal_plane_unit=unit)
    assert exif.focal_length_px(4000, 3000) == pytest.approx(2000)


def test_a_picture_made_smaller_keeps_its_field_of_view() -> None:
    exif = Exif(focal_length_mm=4, focal_plane_x_resolution=500, focal_plane_unit=4)
    resized = Exif(
        focal_length_mm=4, focal_plane_x_resolution=500, focal_plane_unit=4, original_width=4000
    )
    assert resized.vertical_fov_rad(1000, 750) == pytest.approx(exif.vertical_fov_rad(4000, 3000))


@pytest.mark.parametrize(
    "exif",
    [
        Exif(),
        Exif(focal_length_mm=4),
        Exif(focal_length_35mm_mm=-1),
        Exif(focal_length_35mm_mm=float("nan")),
        Exif(focal_length_35mm_mm=float("inf")),
        Exif(focal_length_35mm_mm=1),  # 173 degrees
        Exif(focal_length_35mm_mm=90_000),
        Exif(focal_length_mm=4, focal_plane_x_resolution=500, focal_plane_unit=9),
    ],
)
def test_what_exif_does_not_tell_stays_unknown(exif: Exif) -> None:
    assert exif.vertical_fov_rad(4000, 3000) is None


def _photo_with_entries(path: Path, with_exif: bool = True) -> Path:
    exif = Image.Exif()
    exif[0x0112] = 1
    exif.get_ifd(CAMERA)[0x829A] = 0.25
    exif.get_ifd(CAMERA)[0x8827] = 400
    exif.get_ifd(GPS)[17] = 123.5
    picture = Image.new("RGB", (64, 48), (90, 120, 60))
    if path.suffix == ".heic":
        pillow_heif = pytest.importorskip("pillow_heif")
        file = pillow_heif.from_pillow(picture)
        file.save(path, exif=exif.tobytes() if with_exif else None)
    else:
        picture.save(path, **({"exif": exif.tobytes()} if with_exif else {}))
    return path


KINDS = ("jpg", "png", "webp", "tif", "avif", "heic")


@pytest.mark.parametrize("kind", KINDS)
def test_every_format_gives_the_same_directories(tmp_path: Path, kind: str) -> None:
    found = exif_directories(_photo_with_entries(tmp_path / f"a.{kind}"))
    assert number(found.camera[0x829A]) == 0.25
    assert number(found.camera[0x8827]) == 400
    assert number(found.gps[17]) == 123.5
    without = exif_directories(_photo_with_entries(tmp_path / f"b.{kind}", with_exif=False))
    assert not without.gps
    assert 0x829A not in without.camera


def test_a_file_that_is_no_photo_has_no_entries(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(b"\xff\xd8\xff nothing more")
    assert exif_directories(tmp_path / "a.jpg") == ExifDirectories()
    assert exif_directories(tmp_path / "missing.heic") == ExifDirectories()


def orientation_entry(kind: int, count: int, content: bytes) -> bytes:
    """An EXIF block whose one entry, the orientation, has some type and count."""
    entry = struct.pack(">HHI4s", 0x0112, kind, count, content.ljust(4, b"\0"))
    return b"MM\0*\0\0\0\x08\0\1" + entry + bytes(4)


SIX = {
    "short": (3, 1, b"\0\6"),
    "byte": (1, 1, b"\6"),
    "long": (4, 1, b"\0\0\0\6"),
    "signed": (9, 1, b"\0\0\0\6"),
    "text": (2, 2, b"6\0"),
    "two": (3, 2, b"\0\6\0\1"),
}


@pytest.mark.parametrize("name", SIX)
def test_formats_and_sizes_agree_on_entries_of_odd_types(tmp_path: Path, name: str) -> None:
    exif = orientation_entry(*SIX[name])
    picture = Image.new("RGB", (160, 96), (90, 120, 60))
    picture.save(tmp_path / "a.jpg", exif=b"Exif\0\0" + exif)
    for kind in ("png", "webp"):
        picture.save(tmp_path / f"a.{kind}", exif=exif)
    for kind in ("jpg", "png", "webp"):
        assert read_photo(tmp_path / f"a.{kind}").pixels.shape == (160, 96, 3)
    height, width, _ = read_photo(tmp_path / "a.jpg", max_side=70).pixels.shape
    assert 96 >= height > width


def test_a_png_may_have_its_entries_behind_its_pixels(tmp_path: Path) -> None:
    path, exif = tmp_path / "a.png", orientation_entry(3, 1, b"\0\6")
    Image.new("RGB", (160, 96), (90, 120, 60)).save(path)
    content, block = path.read_bytes(), b"eXIf" + exif
    chunk = struct.pack(">I", len(exif)) + block + struct.pack(">I", zlib.crc32(block))
    path.write_bytes(content[:-12] + chunk + content[-12:])
    assert read_photo(path).pixels.shape == (160, 96, 3)
