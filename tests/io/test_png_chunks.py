"""What a PNG says besides its pixels, however much of it there is."""

import os
import struct
import zlib
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, PngImagePlugin

from deeplight.errors import ImageFileError
from deeplight.io.colour import DISPLAY_P3
from deeplight.io.photograph import read_photograph
from deeplight.io.photos import read_photo
from deeplight.io.png_chunks import read_png_chunks
from profiles import rgb_profile


def photo() -> np.ndarray:
    rows, columns = np.mgrid[0:48, 0:64]
    return np.stack([60 + 3 * rows, 200 - 2 * columns, 40 + rows + columns], -1).astype(np.uint8)


def png(path: Path, *added: tuple[bytes, bytes], **options: object) -> Path:
    """A PNG with more chunks behind its header."""
    Image.fromarray(photo()).save(path, **options)
    return png_with(path, *added)


def png_with(path: Path, *added: tuple[bytes, bytes], at: int = 33) -> Path:
    """The same file with more chunks."""
    content = path.read_bytes()
    more = b"".join(
        struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
        for kind, body in added
    )
    path.write_bytes(content[:at] + more + content[at:])
    return path


@pytest.mark.parametrize("in_itxt", [True, False])
def test_a_text_may_unpack_to_megabytes(tmp_path: Path, in_itxt: bool) -> None:
    texts = PngImagePlugin.PngInfo()
    if in_itxt:
        texts.add_itxt("XML:com.adobe.xmp", "ab" * 1_000_000, zip=True)
    else:
        texts.add_text("workflow", "ab" * 1_000_000, zip=True)
    path = png(tmp_path / "a.png", pnginfo=texts)
    np.testing.assert_array_equal(read_photo(path).pixels, photo())


def test_a_profile_may_unpack_to_megabytes(tmp_path: Path) -> None:
    small = rgb_profile(DISPLAY_P3, name="Display P3")
    large = struct.pack(">I", len(small) + 1_500_000) + small[4:] + bytes(1_500_000)
    read = [read_photo(png(tmp_path / "a.png", icc_profile=p)) for p in (small, large)]
    np.testing.assert_array_equal(read[0].pixels, read[1].pixels)
    assert read[1].notes == ("Display P3 converted to sRGB",)


def test_the_facts_are_pillows(tmp_path: Path) -> None:
    chunks = (b"gAMA", struct.pack(">I", 55556)), (b"cHRM", struct.pack(">8I", *range(1, 9)))
    path = png(tmp_path / "a.png", *chunks, (b"sRGB", b"\0"), (b"eXIf", b"MM\0*\0\0\0\x08\0\0"))
    size, facts = read_png_chunks(path)
    with Image.open(path) as picture:
        assert size == picture.size
        assert facts["gamma"] == picture.info["gamma"]
        assert facts["chromaticity"] == picture.info["chromaticity"]
        assert picture.info["exif"] == b"Exif\0\0" + facts["exif"]
        assert facts["srgb"]


@pytest.mark.parametrize(
    ("harm", "words"),
    [
        (lambda whole: whole[:-12], "truncated"),
        (lambda whole: whole[:-30], "truncated"),
        (lambda whole: whole[:60] + b"?" + whole[61:], "checksum of IDAT"),
        (lambda whole: whole[:33] + whole[-12:], "no pixels"),
        (lambda whole: whole[:8] + whole[33:], "damaged header"),
        (lambda whole: whole[:8] + b"\0\0\0\4CgBIabcd????" + whole[8:], "unknown chunk CgBI"),
    ],
    ids=["no end", "cut", "checksum", "no pixels", "no header", "Apple's own"],
)
def test_damage_is_refused_before_libpng_talks_of_it(
    tmp_path: Path, harm: object, words: str, capfd: pytest.CaptureFixture[str]
) -> None:
    path = png(tmp_path / "a.png")
    path.write_bytes(harm(path.read_bytes()))
    with pytest.raises(ImageFileError, match=words):
        read_photo(path)
    assert capfd.readouterr().err == ""


def with_pixels(path: Path, stored: bytes) -> Path:
    """A PNG of these compressed pixels, whole as far as its checksums say."""
    png(path)
    content = path.read_bytes()
    at = content.index(b"IDAT") - 4
    path.write_bytes(content[:at] + content[-12:])
    return png_with(path, (b"IDAT", stored), at=at)


@pytest.mark.parametrize(
    "stored",
    [zlib.compress(bytes(5000)), b"\x78\x9c" + bytes([7] * 90), zlib.compress(b"\x09" * 9264)],
    ids=["too few", "no deflate", "no such filter"],
)
def test_damage_that_only_libpng_finds_is_one_line_too(
    tmp_path: Path, stored: bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    path = with_pixels(tmp_path / "a.png", stored)
    for read in (read_photo, lambda path: read_photograph(path, 1)):
        with pytest.raises(ImageFileError, match="damaged"):
            read(path)
    assert capfd.readouterr().err == ""
    os.write(2, b"still here")
    assert capfd.readouterr().err == "still here"


def test_threads_that_read_damage_leave_stderr_where_it_was(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    path = with_pixels(tmp_path / "a.png", zlib.compress(bytes(5000)))

    def read(_number: int) -> bool:
        with suppress(ImageFileError):
            read_photo(path)
        return True

    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(read, range(64)))
    os.write(2, b"still here")
    assert capfd.readouterr().err == "still here"
