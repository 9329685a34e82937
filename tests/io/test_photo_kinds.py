"""Raw files, HEIC and AVIF of every brand, EXIF of every type: a photo comes out, or one line."""

import struct
import sys
import warnings
import zlib
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, TiffImagePlugin

from deeplight.errors import ImageFileError, MissingExtraError
from deeplight.io.colour import MID_GREY
from deeplight.io.exif import Exif, exif_of_pillow, number
from deeplight.io.heif_boxes import HeifHeader, read_header
from deeplight.io.photos import photo_of_pillow, photo_paths, read_photo
from lab.fuzz import dng

HEIGHT, WIDTH = 64, 96


def scene() -> np.ndarray:
    """Linear colours, smooth, all corners different."""
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH] / WIDTH
    return np.stack([0.05 + 0.6 * rows, 0.5 - 0.3 * columns, 0.1 + 0.4 * columns], axis=-1)


def photo() -> np.ndarray:
    return np.round(scene() ** (1 / 2.2) * 255).astype(np.uint8)


def far(got: np.ndarray, wanted: np.ndarray) -> float:
    assert got.shape == wanted.shape
    return float(np.abs(got.astype(int) - wanted).mean())


def write_dng(path: Path, *args: Any, **options: Any) -> Path:
    """A DNG of the scene."""
    return dng.write_dng(path, scene(), *args, **options)


@pytest.mark.parametrize("thumbnail", [False, True])
@pytest.mark.parametrize("balance", [(0.5, 1.0, 0.625), (1.0, 0.8, 0.4)])
def test_a_raw_file_is_developed(tmp_path: Path, balance: tuple, thumbnail: bool) -> None:
    pytest.importorskip("rawpy")
    read = read_photo(write_dng(tmp_path / "a.dng", balance, thumbnail=thumbnail))
    assert far(read.pixels, photo()) < 1.5  # white balance, black level and exposure kept
    assert read.vertical_fov_rad is not None
    assert "raw" in read.notes[0]


@pytest.mark.parametrize("stops", [1.0, -0.5])
def test_the_baseline_exposure_of_a_dng_is_kept(tmp_path: Path, stops: float) -> None:
    pytest.importorskip("rawpy")
    read = read_photo(write_dng(tmp_path / "a.dng", stops=stops))
    brighter = np.round(np.clip(scene() * 2**stops, 0, 1) ** (1 / 2.2) * 255)
    assert far(read.pixels, brighter.astype(int)) < 1.5


@pytest.mark.parametrize("orientation", range(1, 9))
def test_a_raw_file_is_turned_upright(tmp_path: Path, orientation: int) -> None:
    from deeplight.io.exif import upright

    pytest.importorskip("rawpy")
    read = read_photo(write_dng(tmp_path / "a.dng", orientation=orientation))
    assert far(read.pixels, upright(photo(), orientation)) < 1.5


@pytest.mark.parametrize("thumbnail", [False, True])
@pytest.mark.parametrize("name", ["a.dng", "a.tif"])
def test_without_its_extra_raw_is_refused_as_raw(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, thumbnail: bool
) -> None:
    monkeypatch.setitem(sys.modules, "rawpy", None)
    write_dng(tmp_path / name, thumbnail=thumbnail)
    with pytest.raises(MissingExtraError, match=r'raw.*pip install "\.\[raw\]"'):
        read_photo(tmp_path / name)


def test_a_raw_file_that_is_cut_off_is_refused(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("rawpy")
    path = write_dng(tmp_path / "a.dng")
    whole = path.read_bytes()
    places = struct.pack("<HHII", 273, 4, 1, 8)
    assert whole.count(places) == 1
    path.write_bytes(whole.replace(places, struct.pack("<HHII", 273, 4, 1, len(whole) - 500)))
    with pytest.raises(ImageFileError, match="damaged"):
        read_photo(path)
    assert capfd.readouterr().err == ""


STARTS = [b"FUJIFILMCCD-RAW 0201", b"II*\0\x10\0\0\0CR\2\0", b"IIRO\x08\0", b"IIU\0", b"FOVb"]


@pytest.mark.parametrize("start", [*STARTS, b"\0\0\0\x18ftypcrx \0\0\0\1"])
def test_raw_files_of_other_makers_are_known(
    tmp_path: Path, start: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a.bin").write_bytes(start + bytes(200))
    with pytest.raises(ImageFileError):
        read_photo(tmp_path / "a.bin")
    monkeypatch.setitem(sys.modules, "rawpy", None)
    with pytest.raises(MissingExtraError, match="raw"):
        read_photo(tmp_path / "a.bin")


def test_a_folder_gives_raw_files_that_have_no_photo(tmp_path: Path) -> None:
    for name in ("a.dng", "a.JPG", "b.NEF", "c.png", "c.preview.png"):
        (tmp_path / name).touch()
    assert [path.name for path in photo_paths([tmp_path])] == ["a.JPG", "b.NEF", "c.png"]


def branded(path: Path, brand: bytes) -> Path:
    content = path.read_bytes()
    path.write_bytes(content[:8] + brand + content[12:])
    return path


@pytest.mark.parametrize("installed", [True, False])
@pytest.mark.parametrize("brand", [b"mif1", b"avif", b"msf1"])
def test_avif_of_any_brand_needs_no_extra(
    tmp_path: Path, brand: bytes, installed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    if installed:
        pytest.importorskip("pillow_heif").register_heif_opener()
    else:
        monkeypatch.setitem(sys.modules, "pillow_heif", None)
    path = tmp_path / "a.avif"
    Image.fromarray(photo()).save(path, quality=95, subsampling="4:4:4")
    assert far(read_photo(branded(path, brand)).pixels, photo()) < 3


def heic(path: Path, **options: object) -> Path:
    pytest.importorskip("pillow_heif").register_heif_opener()
    Image.fromarray(photo()).save(path, quality=95, **options)
    return path


def with_orientation(orientation: int) -> bytes:
    exif = Image.Exif()
    exif[0x0112] = orientation
    return exif.tobytes()


@pytest.mark.parametrize("orientation", range(1, 9))
def test_a_heic_that_says_nothing_is_turned_by_exif(tmp_path: Path, orientation: int) -> None:
    """As some Samsung and Fujifilm cameras write it; a file with its own box ignores EXIF."""
    from deeplight.io.exif import upright

    path = heic(tmp_path / "a.heic", exif=with_orientation(1))
    assert not read_header(path).is_turned
    content = path.read_bytes()
    path.write_bytes(content.replace(with_orientation(1)[6:], with_orientation(orientation)[6:]))
    read = read_photo(path)
    assert far(read.pixels, upright(photo(), orientation)) < 3
    assert any("EXIF orientation" in note for note in read.notes) == (orientation != 1)


@pytest.mark.parametrize("suffix", [".heic", ".avif"])
@pytest.mark.parametrize("orientation", range(2, 9))
def test_boxes_that_turn_and_mirror_are_obeyed_once(
    tmp_path: Path, orientation: int, suffix: str
) -> None:
    from deeplight.io.exif import upright

    path = tmp_path / f"a{suffix}"
    if suffix == ".heic":
        heic(path, exif=with_orientation(orientation))
    else:
        Image.fromarray(photo()).save(path, quality=95, exif=with_orientation(orientation))
    assert read_header(path).is_turned
    assert far(read_photo(path).pixels, upright(photo(), orientation)) < 4


def test_headers_of_nonsense_say_nothing(tmp_path: Path) -> None:
    path = tmp_path / "a.heic"
    random = np.random.default_rng(0)
    for size in (0, 8, 16, 200):
        for _ in range(20):
            noise = random.integers(0, 256, size, np.uint8).tobytes()
            path.write_bytes(b"\0\0\0\x10ftypheic" + bytes(4) + b"\0\0\2\0meta\0\0\0\0" + noise)
            assert not read_header(path).is_av1
    path.write_bytes(b"")
    assert read_header(path) == HeifHeader()


ODD = [
    (1.0, 2.0),
    (),
    "n/a",
    b"\xff\x00",
    TiffImagePlugin.IFDRational(5, 0),
    TiffImagePlugin.IFDRational(0, 0xFFFFFFFF),
    TiffImagePlugin.IFDRational(0, -1),
    float("inf"),
    None,
    "1e999",
    [[]],
]


@pytest.mark.parametrize("value", ODD, ids=repr)
def test_a_number_of_any_type_is_one_number_or_none(value: object) -> None:
    assert number(value) is None


@pytest.mark.parametrize("value", [26, "26", b"26\0", (26,), TiffImagePlugin.IFDRational(52, 2)])
def test_numbers_in_odd_types_are_understood(value: object) -> None:
    assert number(value) == 26


def test_exif_that_pillow_cannot_read_is_no_exif() -> None:
    def fails() -> Image.Exif:
        raise KeyError(0x8769)

    assert exif_of_pillow(fails) == Exif()


def odd_exif(kind: int, count: int) -> bytes:
    """EXIF whose numbers all have another type and count than the standard's."""
    tags = (0x9209, 0x920A, 0xA002, 0xA20E, 0xA210, 0xA405)
    tiff = b"MM\0*\0\0\0\x08" + struct.pack(">H", 2)
    camera = 8 + 2 + 24 + 4
    tiff += struct.pack(">HHII", 0x0112, kind, count, 0x00060000)
    tiff += struct.pack(">HHII", 0x8769, 4, 1, camera) + bytes(4)
    tiff += struct.pack(">H", len(tags))
    tiff += b"".join(struct.pack(">HHII", tag, kind, count, camera + 100) for tag in tags)
    return b"Exif\0\0" + tiff + bytes(4) + bytes(range(1, 200))


def with_crc(png: bytes) -> bytes:
    """The same with the checksum of its EXIF chunk made right."""
    at = png.index(b"eXIf")
    end = at + 4 + int.from_bytes(png[at - 4 : at])
    return png[:end] + struct.pack(">I", zlib.crc32(png[at:end])) + png[end + 4 :]


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".webp", ".avif", ".heic"])
def test_exif_of_any_type_and_count_never_stops_a_photo(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    if suffix == ".heic":
        pytest.importorskip("pillow_heif").register_heif_opener()
    plain = Image.Exif()
    plain[0x010E] = "a text as long as the odd entries are, " * 10  # to be overwritten with them
    place = plain.tobytes()[6:]
    Image.fromarray(photo()).save(path, exif=plain.tobytes(), quality=90)
    whole = path.read_bytes()
    assert whole.count(place) == 1
    for kind in (*range(14), 129, 0xFFFF):
        for count in (0, 1, 2, 0x7FFFFFFF):
            odd = odd_exif(kind, count)[6:].ljust(len(place), b"\0")
            path.write_bytes(
                with_crc(whole.replace(place, odd))
                if suffix == ".png"
                else whole.replace(place, odd)
            )
            with warnings.catch_warnings(action="error"):
                read = read_photo(path)
            assert sorted(read.pixels.shape) == [3, HEIGHT, WIDTH]
            fov = read.vertical_fov_rad
            assert fov is None or 0 < fov < 3


def test_pillow_pictures_are_read_as_their_files_are(tmp_path: Path) -> None:
    stored = np.dstack([photo(), np.full((HEIGHT, WIDTH), 255, np.uint8)])
    stored[:30, :, 3] = 0
    exif = Image.Exif()
    exif[0x0112] = 6
    exif.get_ifd(0x8769)[0xA405] = 85
    for picture in (Image.fromarray(stored), Image.fromarray(photo()).convert("P")):
        picture.save(tmp_path / "a.png", exif=exif)
        read = read_photo(tmp_path / "a.png")
        with Image.open(tmp_path / "a.png") as opened:
            same = photo_of_pillow(opened)
        np.testing.assert_array_equal(same.pixels, read.pixels)
        assert same.vertical_fov_rad == pytest.approx(read.vertical_fov_rad)
        assert same.notes == read.notes


@pytest.mark.parametrize("mode", ["1", "L", "I;16", "I", "F"])
def test_grey_pillow_pictures_of_any_depth(mode: str) -> None:
    grey = photo()[..., 0]
    if mode == "I;16":
        picture = Image.fromarray(grey.astype(np.uint16) * 257)
    elif mode in ("I", "F"):
        picture = Image.fromarray(grey.astype(np.int32) * 257 if mode == "I" else grey.astype("f4"))
    else:
        picture = Image.fromarray(grey).convert(mode)
    wanted = np.asarray(picture.convert("L")) if mode == "1" else grey
    assert far(photo_of_pillow(picture).pixels, np.repeat(wanted[..., None], 3, axis=2)) < 1


BROKEN = ["damaged.avif", "indexerror.png", "runtimeerror.avif", "eoferror.heic"]


@pytest.mark.parametrize("name", BROKEN)
def test_broken_photos_of_the_wild_are_one_line(
    cases: Path, name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    path = next(cases.glob(f"*/{name}"))
    with pytest.raises((ImageFileError, MissingExtraError)) as caught:
        read_photo(path)
    assert name in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().err == ""


def test_random_damage_is_one_line_or_a_photo(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Bytes changed anywhere, in every format: never another exception, never a word on stderr."""
    random = np.random.default_rng(5)
    pictures = {
        suffix: tmp_path / f"good{suffix}"
        for suffix in (".png", ".jpg", ".avif", ".webp", ".tif", ".gif", ".jp2")
    }
    for path in pictures.values():
        Image.fromarray(photo()).save(path)
    pictures[".dng"] = write_dng(tmp_path / "good.dng")
    for suffix, path in pictures.items():
        whole = np.frombuffer(path.read_bytes(), np.uint8)
        for _ in range(25):
            broken = whole.copy()
            places = random.integers(0, min(len(whole), random.choice([200, 10**9])), 8)
            broken[places] = random.integers(0, 256, 8)
            bad = tmp_path / f"bad{suffix}"
            bad.write_bytes(broken.tobytes())
            with suppress(ImageFileError, MissingExtraError):
                read_photo(bad)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize(
    ("fourth", "has_mask"), [(0, False), (7, False), (255, False), (7, True), (255, True)]
)
def test_the_fourth_byte_of_a_bmp_is_alpha_where_a_mask_says_so(
    tmp_path: Path, fourth: int, has_mask: bool
) -> None:
    """Without one it is unused, and 0 in most files."""
    colour = np.random.default_rng(0).integers(0, 256, (40, 48, 3), dtype=np.uint8)
    pixels = np.dstack([colour[::-1, :, ::-1], np.full((40, 48), fourth, np.uint8)]).tobytes()
    masks = struct.pack("<4I", 0xFF0000, 0xFF00, 0xFF, 0xFF000000) + bytes(52) if has_mask else b""
    header = struct.pack(
        "<IiiHHIIiiII", 40 + len(masks), 48, 40, 1, 32, 3 * has_mask, len(pixels), 0, 0, 0, 0
    )
    start = 14 + len(header) + len(masks)
    head = b"BM" + struct.pack("<IHHI", start + len(pixels), 0, 0, start)
    (tmp_path / "a.bmp").write_bytes(head + header + masks + pixels)
    read = read_photo(tmp_path / "a.bmp")
    is_seen_through = has_mask and fourth < 255
    share = fourth / 255 if is_seen_through else 1
    wanted = colour * share + MID_GREY * (1 - share)
    assert np.abs(read.pixels - wanted).max() <= 1
    assert bool(read.notes) == is_seen_through


STRAIGHT = [(s, m) for s in (".jp2", ".j2k") for m in ("RGBA", "LA")]
STRAIGHT += [(s, "RGBA") for s in (".dds", ".sgi", ".tga", ".webp", ".png", ".tif")]


@pytest.mark.parametrize(("suffix", "mode"), STRAIGHT)
def test_alpha_is_laid_over_grey_in_every_format(tmp_path: Path, suffix: str, mode: str) -> None:
    stored = np.full((48, 64, len(mode)), 200, np.uint8)
    stored[..., -1] = 128
    lossless = {"lossless": True} if suffix == ".webp" else {}
    Image.fromarray(stored, mode).save(tmp_path / f"a{suffix}", **lossless)
    wanted = 200 * 128 / 255 + MID_GREY * 127 / 255
    assert np.abs(read_photo(tmp_path / f"a{suffix}").pixels - wanted).max() <= 1
