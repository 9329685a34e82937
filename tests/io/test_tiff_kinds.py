"""Pictures that state their values in an unusual way: counted down, as Lab, encoded as floats."""

import struct
import tracemalloc
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from PIL import Image, ImageCms

from deeplight.io.colour import (
    BT709,
    DISPLAY_P3,
    bt709_from_primaries,
    srgb_decode,
    srgb_encode,
)
from deeplight.io.gain_map import write_gain_map_jpeg
from deeplight.io.photograph import read_photograph
from deeplight.io.photos import read_photo
from deeplight.io.radiance import read_hdr
from profiles import rgb_profile


def photo() -> np.ndarray:
    rows, columns = np.mgrid[0:64, 0:96] / 96
    channels = (0.1 + 0.8 * rows, 0.7 - 0.5 * columns, 0.2 + 0.4 * columns + 0.2 * rows)
    return np.round(np.stack(channels, axis=-1) * 255).astype(np.uint8)


def far(got: np.ndarray, wanted: np.ndarray) -> float:
    return float(np.abs(got.astype(int) - wanted).mean())


def write_tiff(path: Path, values: np.ndarray, photometric: int) -> Path:
    """One strip of a little-endian TIFF whose values mean what `photometric` says."""
    height, width = values.shape[:2]
    samples = values.shape[2] if values.ndim == 3 else 1
    content, behind = values.tobytes(), 8 + 2 + 9 * 12 + 4
    depth = 8 * values.itemsize
    entries = [(256, 3, 1, width), (257, 3, 1, height), (258, 3, samples, depth)]
    entries += [(259, 3, 1, 1), (262, 3, 1, photometric), (273, 4, 1, behind + 2 * samples)]
    entries += [(277, 3, 1, samples), (278, 3, 1, height), (279, 4, 1, len(content))]
    if samples > 2:
        entries[2] = (258, 3, samples, behind)
    folder = b"".join(struct.pack("<HHII", *entry) for entry in entries)
    depths = struct.pack(f"<{samples}H", *[depth] * samples)
    path.write_bytes(b"II*\0\x08\0\0\0\x09\0" + folder + bytes(4) + depths + content)
    return path


@pytest.mark.parametrize("kind", [np.uint8, np.uint16])
@pytest.mark.parametrize("white_is_zero", [True, False])
def test_grey_may_count_down(tmp_path: Path, kind: type, white_is_zero: bool) -> None:
    grey = photo()[..., 1]
    most = np.iinfo(kind).max
    values = (grey.astype(int) * (most // 255)).astype(kind)
    values = most - values if white_is_zero else values
    path = write_tiff(tmp_path / "a.tif", values, int(not white_is_zero))
    wanted = np.repeat(grey[..., None], 3, axis=2)
    np.testing.assert_array_equal(read_photo(path).pixels, wanted)
    np.testing.assert_allclose(read_photograph(path, 1), wanted / 255, atol=1e-6)


def test_lab_without_a_profile_becomes_rgb(tmp_path: Path) -> None:
    spaces = ImageCms.createProfile("sRGB"), ImageCms.createProfile("LAB")
    lab = ImageCms.profileToProfile(Image.fromarray(photo()), *spaces, outputMode="LAB")
    path = write_tiff(tmp_path / "a.tif", np.asarray(lab), 8)
    assert far(read_photo(path).pixels, photo()) < 2
    assert far(np.asarray(lab), photo()) > 20


def float_tiff(path: Path, values: np.ndarray, profile: bytes | None) -> Path:
    spec = oiio.ImageSpec(values.shape[1], values.shape[0], 3, "float")
    if profile:
        content = np.frombuffer(profile, np.uint8)
        spec.attribute("ICCProfile", oiio.TypeDesc(f"uint8[{len(content)}]"), content)
    file = oiio.ImageOutput.create(str(path))
    assert file.open(str(path), spec)
    assert file.write_image(np.ascontiguousarray(values, np.float32))
    assert file.close()
    return path


@pytest.mark.parametrize("primaries", [BT709, DISPLAY_P3])
def test_a_profile_with_a_curve_says_that_floats_are_encoded(
    tmp_path: Path, primaries: tuple[float, ...]
) -> None:
    linear = srgb_decode(photo() / 255) @ np.linalg.inv(bt709_from_primaries(primaries)).T
    encoded = srgb_encode(linear.clip(0, 1))
    profile = rgb_profile(primaries, name="a space")
    read = read_photo(float_tiff(tmp_path / "a.tif", encoded, profile))
    assert far(read.pixels, photo()) < 1
    assert not any("linear" in note for note in read.notes)
    for name, values, space in (("b", encoded, None), ("c", encoded * 2, profile)):
        (note,) = read_photo(float_tiff(tmp_path / f"{name}.tif", values, space)).notes
        assert note == "scene-linear file: 1.0 taken as white"  # no curve, or more than white


def test_a_damaged_gain_map_is_not_talked_about(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    write_gain_map_jpeg(tmp_path / "a.jpg", np.full((32, 64, 3), 0.5, np.float32))
    content = (tmp_path / "a.jpg").read_bytes()
    scan = content.rfind(b"\xff\xda")  # the gains' own
    (tmp_path / "b.jpg").write_bytes(content[: scan + 16] + b"\xff\xd9")
    assert read_photo(tmp_path / "b.jpg").pixels.shape == (32, 64, 3)
    assert capfd.readouterr().err == ""


def test_a_photo_with_a_gain_map_is_what_every_viewer_shows(tmp_path: Path) -> None:
    rows, columns = np.mgrid[0:64, 0:96] / 64
    light = np.stack([0.1 + rows, 0.5 - 0.2 * columns, 3 * columns], axis=-1)
    write_gain_map_jpeg(tmp_path / "a.jpg", light)
    with Image.open(tmp_path / "a.jpg") as picture:
        shown = np.asarray(picture.convert("RGB"))
    read = read_photo(tmp_path / "a.jpg")
    np.testing.assert_array_equal(read.pixels, shown)
    assert read.notes == ()
    assert read_hdr(tmp_path / "a.jpg").max() > 2  # as light it is read with its gains


@pytest.mark.parametrize("first_is_smaller", [True, False])
def test_a_tiff_that_begins_with_a_thumbnail_is_its_photo(
    tmp_path: Path, first_is_smaller: bool
) -> None:
    path = tmp_path / "a.tif"
    specs = (oiio.ImageSpec(48, 32, 3, "uint8"), oiio.ImageSpec(96, 64, 3, "uint8"))
    if first_is_smaller:
        specs[0].attribute("tiff:subfiletype", 1)
    file = oiio.ImageOutput.create(str(path))
    assert file.open(str(path), specs)
    assert file.write_image(np.ascontiguousarray(photo()[::2, ::2]))
    assert file.open(str(path), specs[1], "AppendSubimage")
    assert file.write_image(photo())
    assert file.close()
    wanted = photo() if first_is_smaller else photo()[::2, ::2]
    np.testing.assert_array_equal(read_photo(path).pixels, wanted)


@pytest.mark.parametrize("tiled", [True, False])
def test_alpha_takes_little_memory_whatever_the_tiles(tmp_path: Path, tiled: bool) -> None:
    path, side = tmp_path / "a.tif", 1600
    spec = oiio.ImageSpec(side, side, 4, "uint16")
    spec.tile_width = spec.tile_height = 64 if tiled else 0
    stored: np.ndarray = np.linspace(0, 65535, side * side * 4).reshape(side, side, 4)
    file = oiio.ImageOutput.create(str(path))
    assert file.open(str(path), spec)
    assert file.write_image(stored.astype(np.uint16))
    assert file.close()
    tracemalloc.start()
    read = read_photo(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 40 * side**2 / 2  # bytes; over grey all at once it was 40 for each pixel
    share = stored[..., 3:] / 65535
    wanted = stored[..., :3] / 257 + 118 * (1 - share)  # multiplied by alpha, as TIFF has it
    assert np.abs(read.pixels - wanted.clip(0, 255)).max() <= 1.5
