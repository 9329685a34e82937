"""Photos of every kind come out upright and 8-bit; what is no photo is refused in one line."""

import math
import os
import struct
import sys
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest
from PIL import Image

from deeplight.errors import ImageFileError, MissingExtraError
from deeplight.io.colour import MID_GREY
from deeplight.io.photos import (
    decode_rgb,
    encode_jpeg,
    encode_png,
    photo_paths,
    read_photo,
    write_png,
)
from deeplight.io.radiance import write_exr, write_hdr

HEIGHT, WIDTH = 48, 64
FORMATS = ("jpg", "png", "webp", "tif", "bmp", "gif", "jp2", "avif")


def picture() -> Image.Image:
    """A smooth picture whose four corners differ: no turn of it looks like another."""
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH]
    channels = (rows * 5, columns * 3, 200 - rows * 2 - columns)
    return Image.fromarray(np.stack(channels, axis=-1).astype(np.uint8))


def save(path: Path, array: np.ndarray, kind: str) -> None:
    """Write an array through OpenImageIO, for pixel types that Pillow lacks."""
    spec = oiio.ImageSpec(array.shape[1], array.shape[0], array.shape[2], kind)
    file = oiio.ImageOutput.create(str(path))
    assert file.open(str(path), spec)
    assert file.write_image(array)
    assert file.close()


def photo_of(path: Path, stored: Image.Image, **options: object) -> np.ndarray:
    stored.save(path, **options)
    return read_photo(path).pixels.astype(int)


@pytest.mark.parametrize("suffix", FORMATS)
def test_every_format_gives_the_same_picture(tmp_path: Path, suffix: str) -> None:
    lossless = suffix in ("png", "tif", "bmp")
    options = {"lossless": True} if suffix == "webp" else {}
    read = photo_of(tmp_path / f"photo.{suffix}", picture(), **options)
    difference = np.abs(read - np.asarray(picture(), dtype=int))
    assert read.shape == (HEIGHT, WIDTH, 3)
    assert difference.max() == 0 if lossless else difference.mean() < 6


def test_a_heic_photo_is_read_upright_with_its_field_of_view(tmp_path: Path) -> None:
    pillow_heif = pytest.importorskip("pillow_heif")
    pillow_heif.register_heif_opener()
    exif = Image.Exif()
    exif[0x0112] = 6
    exif.get_ifd(0x8769)[0xA405] = 26
    path = tmp_path / "photo.heic"
    picture().save(path, exif=exif.tobytes(), quality=95)
    photo = read_photo(path)
    expected = np.rot90(np.asarray(picture(), dtype=int), -1)
    assert photo.pixels.shape == (WIDTH, HEIGHT, 3)
    assert np.abs(photo.pixels - expected).mean() < 6
    focal = 26 / math.hypot(36, 24) * math.hypot(WIDTH, HEIGHT)
    assert photo.vertical_fov_rad == pytest.approx(2 * math.atan(WIDTH / 2 / focal))


def test_heic_without_its_extra_names_the_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pillow_heif", None)
    path = tmp_path / "photo.heic"
    path.write_bytes(b"\0\0\0\x18ftypheic" + bytes(100))
    with pytest.raises(MissingExtraError, match=r'pip install "\.\[heic\]"'):
        read_photo(path)


@pytest.mark.parametrize("suffix", ["jpg", "png", "webp", "avif"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_exif_orientation_is_undone(tmp_path: Path, suffix: str, orientation: int) -> None:
    turn = {
        1: lambda a: a,
        2: lambda a: a[:, ::-1],
        3: lambda a: a[::-1, ::-1],
        4: lambda a: a[::-1],
        5: lambda a: a.transpose(1, 0, 2),
        6: lambda a: np.rot90(a, 1),
        7: lambda a: a[::-1, ::-1].transpose(1, 0, 2),
        8: lambda a: np.rot90(a, -1),
    }[orientation]  # how a camera held that way stores the scene
    scene = np.asarray(picture())
    exif = Image.Exif()
    exif[0x0112] = orientation
    read = photo_of(tmp_path / f"p.{suffix}", Image.fromarray(turn(scene)), exif=exif, quality=95)
    assert read.shape == scene.shape
    assert np.abs(read - scene).mean() < 6
    assert np.abs(read - scene[:, ::-1]).mean() > 20  # the test can fail


def test_exif_gives_the_field_of_view(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA405] = 36
    path = tmp_path / "photo.jpg"
    Image.new("RGB", (600, 400), "gray").save(path, exif=exif)
    photo = read_photo(path)
    assert photo.vertical_fov_rad == pytest.approx(2 * math.atan(12 / 36), rel=1e-3)
    assert photo.source == path
    assert photo.notes == ()


@pytest.mark.parametrize("mode", ["L", "P", "1", "LA", "RGBA", "CMYK"])
def test_every_pillow_mode_becomes_rgb(tmp_path: Path, mode: str) -> None:
    stored = picture().convert(mode)
    read = photo_of(tmp_path / ("photo.jpg" if mode == "CMYK" else "photo.png"), stored)
    assert read.shape == (HEIGHT, WIDTH, 3)
    assert np.abs(read - np.asarray(stored.convert("RGB"), dtype=int)).mean() < 3


@pytest.mark.parametrize("suffix", ["png", "tif"])
@pytest.mark.parametrize("channels", [1, 3])
def test_16_bit_is_scaled_not_cut(tmp_path: Path, suffix: str, channels: int) -> None:
    eight_bit = np.asarray(picture())[..., :channels]
    path = tmp_path / f"photo.{suffix}"
    save(path, np.ascontiguousarray(eight_bit.astype(np.uint16) * 257), "uint16")
    np.testing.assert_array_equal(read_photo(path).pixels, np.broadcast_to(eight_bit, (48, 64, 3)))


@pytest.mark.parametrize("suffix", ["tif", "exr"])
def test_floating_point_is_scene_linear(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"photo.{suffix}"
    radiance = np.full((40, 40, 3), 0.5, np.float32)
    radiance[:20] = 7.0
    radiance[30:] = -1.0
    save(path, radiance, "float")
    photo = read_photo(path)
    assert photo.pixels[25, 0, 0] == round(255 * 0.5 ** (1 / 2.2))
    assert photo.pixels[0, 0, 0] == 255
    assert photo.pixels[35, 0, 0] == 0
    assert "scene-linear" in photo.notes[0]


@pytest.mark.parametrize(
    ("suffix", "options"), [("png", {}), ("webp", {"lossless": True}), ("tif", {})]
)
def test_transparent_parts_are_mid_grey(tmp_path: Path, suffix: str, options: dict) -> None:
    rgba = np.dstack([np.asarray(picture()), np.full((HEIGHT, WIDTH), 255, np.uint8)])
    rgba[:, :20, 3] = 0
    rgba[:, 20:40, 3] = 128
    path = tmp_path / f"photo.{suffix}"
    Image.fromarray(rgba).save(path, **options)
    photo = read_photo(path)
    half = rgba[..., :3] * (128 / 255) + MID_GREY * (127 / 255)
    assert (photo.pixels[:, :20] == MID_GREY).all()
    assert np.abs(photo.pixels[:, 20:40] - half[:, 20:40]).max() <= 1
    np.testing.assert_array_equal(photo.pixels[:, 40:], rgba[:, 40:, :3])
    assert photo.notes == ("transparent parts taken as mid-grey",)


@pytest.mark.parametrize("name", ["RGBA.gif", "RGBA.png", "LA.png", "RGBA.webp", "LA.tif"])
def test_a_cut_out_is_on_mid_grey_in_every_format(tmp_path: Path, name: str) -> None:
    mode = name.split(".")[0]
    stored = picture().convert(mode)
    cover = np.full((HEIGHT, WIDTH), 255, np.uint8)
    cover[:, :20] = 0
    stored.putalpha(Image.fromarray(cover))
    read = photo_of(tmp_path / name, stored)
    assert (read[:, :20] == MID_GREY).all()
    opaque = np.asarray(picture().convert(mode[:-1]).convert("RGB"), dtype=int)
    assert np.abs(read[:, 20:] - opaque[:, 20:]).mean() < 8


def test_a_foreign_colour_profile_is_reported(tmp_path: Path) -> None:
    from PIL import ImageCms

    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("LAB")).tobytes()
    path = tmp_path / "photo.jpg"
    picture().save(path, icc_profile=profile)
    assert "read as sRGB" in read_photo(path).notes[0]


def cut(path: Path, kept: float) -> None:
    whole = path.read_bytes()
    path.write_bytes(whole[: int(len(whole) * kept)])


@pytest.mark.parametrize("suffix", ["jpg", "png", "webp", "tif", "gif", "avif", "exr", "hdr"])
@pytest.mark.parametrize("kept", [0.02, 0.6, 0.97])
def test_a_truncated_file_is_refused(
    tmp_path: Path, suffix: str, kept: float, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"photo.{suffix}"
    noise = np.random.default_rng(0).integers(0, 256, (HEIGHT, WIDTH, 3), np.uint8)
    if suffix in ("exr", "hdr"):
        (write_exr if suffix == "exr" else write_hdr)(path, noise.astype(np.float32) + 0.25)
    else:
        Image.fromarray(noise).save(path)
    read_photo(path)
    cut(path, kept)
    with pytest.raises(ImageFileError) as caught:
        read_photo(path)
    assert path.name in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().err == ""  # no decoder talks past us


@pytest.mark.parametrize("before_end", [b"\0\0\x11\x22", b""])
@pytest.mark.parametrize("after_end", [b"\0" * 500, b""])
def test_harmless_faults_that_phones_write_are_read(
    tmp_path: Path, before_end: bytes, after_end: bytes
) -> None:
    path = tmp_path / "photo.jpg"
    clean = photo_of(path, picture())
    whole = path.read_bytes()
    path.write_bytes(whole[:-2] + before_end + whole[-2:] + after_end)
    np.testing.assert_array_equal(read_photo(path).pixels, clean)


def test_a_damaged_png_is_refused_quietly(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "photo.png"
    picture().save(path)
    whole = bytearray(path.read_bytes())
    whole[len(whole) // 2] ^= 0xFF
    path.write_bytes(whole)
    with pytest.raises(ImageFileError, match="damaged"):
        read_photo(path)
    assert capfd.readouterr().err == ""


def png_header(width: int, height: int) -> bytes:
    def chunk(kind: bytes, content: bytes) -> bytes:
        return (
            struct.pack(">I", len(content))
            + kind
            + content
            + struct.pack(">I", zlib.crc32(kind + content))
        )

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    body = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(bytes(1000))) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


def wide_gif(path: Path, height: int) -> None:
    """A GIF of one small frame that states a huge screen."""
    Image.new("L", (40, 40)).save(path)
    content = path.read_bytes()
    path.write_bytes(content[:6] + struct.pack("<HH", 60_000, height) + content[10:])


def wide_tiff(path: Path) -> None:
    Image.new("1", (60_000, 40)).save(path, compression="group4")


MAKE_BAD: dict[str, tuple[str, Callable[[Path], object]]] = {
    "text": ("photo.jpg", lambda path: path.write_text("no photo at all\n" * 20)),
    "zero bytes": ("photo.jpg", lambda path: path.write_bytes(b"")),
    "1x1": ("photo.png", lambda path: Image.new("RGB", (1, 1)).save(path)),
    "31 px": ("photo.png", lambda path: Image.new("RGB", (31, 500)).save(path)),
    "bomb": ("photo.png", lambda path: path.write_bytes(png_header(60_000, 60_000))),
    "GIF bomb": ("photo.gif", lambda path: wide_gif(path, 60_000)),
    "wide GIF": ("photo.gif", lambda path: wide_gif(path, 40)),
    "60,000 px wide": ("photo.tif", wide_tiff),
    "101 megapixels": (
        "p.tif",
        lambda path: Image.new("1", (10_100, 10_000)).save(path, compression="group4"),
    ),
    "NaN": ("photo.exr", lambda path: write_exr(path, np.full((40, 40, 3), np.nan, np.float32))),
    "not AVIF": ("photo.avif", lambda path: path.write_bytes(b"\0\0\0\x18ftypavif" + bytes(100))),
    "a film": ("photo.mp4", lambda path: path.write_bytes(b"\0\0\0\x18ftypisom" + bytes(100))),
}


@pytest.mark.parametrize("case", MAKE_BAD)
def test_what_is_no_photo_is_refused_in_one_line(
    tmp_path: Path, case: str, capfd: pytest.CaptureFixture[str]
) -> None:
    name, make = MAKE_BAD[case]
    path = tmp_path / name
    make(path)
    with pytest.raises(ImageFileError) as caught:
        read_photo(path)
    message = str(caught.value)
    assert name in message
    assert "\n" not in message
    assert len(message) < 400
    assert capfd.readouterr().err == ""


def test_the_operating_systems_errors_are_kept(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_photo(tmp_path / "missing.jpg")
    with pytest.raises(IsADirectoryError):
        read_photo(tmp_path)


def test_no_permission_is_the_operating_systems_error(tmp_path: Path) -> None:
    path = tmp_path / "photo.png"
    picture().save(path)
    path.chmod(0)
    before = os.geteuid()
    if before == 0:
        os.seteuid(65534)  # root may read everything: be nobody for a moment
    try:
        with pytest.raises(PermissionError):
            read_photo(path)
    finally:
        os.seteuid(before)


def test_a_pipe_does_not_hang(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.jpg")
    with pytest.raises(ImageFileError, match="device or pipe"):
        read_photo(tmp_path / "pipe.jpg")


def test_names_with_spaces_and_accents_are_read(tmp_path: Path) -> None:
    assert photo_of(tmp_path / "mein Foto — 東京.jpg", picture()).shape == (HEIGHT, WIDTH, 3)


@pytest.mark.parametrize("suffix", ["png", "jpg", "exr", "avif"])
def test_names_that_are_not_utf8_are_read(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / os.fsdecode(b"caf\xe9." + suffix.encode())
    plain = tmp_path / f"plain.{suffix}"
    if suffix == "exr":
        write_exr(plain, np.full((40, 40, 3), 0.5, np.float32))
    else:
        picture().save(plain)
    plain.rename(path)
    assert min(read_photo(path).pixels.shape[:2]) >= 40


def test_a_folder_lists_its_photos_only(tmp_path: Path) -> None:
    for name in (
        "b.JPG",
        "a.png",
        "c.heic",
        ".hidden.png",
        "a.preview.png",
        "notes.txt",
        "light.exr",
    ):
        (tmp_path / name).write_bytes(b"x")
    (tmp_path / "folder.png").mkdir()
    listed = photo_paths([tmp_path, tmp_path / "notes.txt"])
    assert [path.name for path in listed] == ["a.png", "b.JPG", "c.heic", "notes.txt"]


def test_a_folder_without_photos_and_a_missing_file_are_reported(tmp_path: Path) -> None:
    with pytest.raises(ImageFileError, match="folder of photos"):
        photo_paths([tmp_path])
    with pytest.raises(FileNotFoundError):
        photo_paths([tmp_path / "missing.jpg"])


def test_pixels_survive_png_and_nearly_survive_jpeg(tmp_path: Path) -> None:
    pixels = np.asarray(picture())
    np.testing.assert_array_equal(decode_rgb(encode_png(pixels[:, ::-1])), pixels[:, ::-1])
    assert np.abs(decode_rgb(encode_jpeg(pixels, 95)).astype(int) - pixels).mean() < 3
    assert len(encode_jpeg(pixels, 30)) < len(encode_jpeg(pixels, 95))
    write_png(tmp_path / "out" / "p.png", pixels)
    np.testing.assert_array_equal(read_photo(tmp_path / "out" / "p.png").pixels, pixels)


@pytest.mark.parametrize("encoded", [b"", b"no image", encode_png(np.asarray(picture()))[:100]])
def test_broken_bytes_are_an_os_error(encoded: bytes) -> None:
    with pytest.raises(OSError, match=r"."):
        decode_rgb(encoded)
