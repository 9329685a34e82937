"""Radiance .hdr files that OpenImageIO does not read: old run lengths, long headers."""

from pathlib import Path

import numpy as np
import pytest

from deeplight.errors import ImageFileError
from deeplight.io.radiance import read_hdr

HEIGHT, WIDTH = 8, 400


def stored() -> np.ndarray:
    """RGBE pixels with long and short runs, of which one is over 255 long."""
    pixels = np.random.default_rng(0).integers(2, 256, (HEIGHT, WIDTH, 4)).astype(np.uint8)
    pixels[..., 3] = 128
    pixels[:, 20:30] = pixels[:, 20:21]
    pixels[2, 50:350] = pixels[2, 50]
    return pixels


def radiance(pixels: np.ndarray) -> np.ndarray:
    return (pixels[..., :3] + 0.5) / 256


def with_old_runs(pixels: np.ndarray) -> bytes:
    """As Radiance's `oldreadcolrs` undoes: runs behind one another count 256 times as much."""
    written = bytearray()
    for row in pixels:
        at = 0
        while at < len(row):
            same = 1
            while at + same < len(row) and (row[at + same] == row[at]).all():
                same += 1
            written += row[at].tobytes()
            rest, at = same - 1, at + same
            while rest:
                written += bytes([1, 1, 1, rest % 256])
                rest //= 256
    return bytes(written)


def write(path: Path, body: bytes, header: str = "", kind: str = "rgbe", columns: int = 0) -> Path:
    head = f"#?RADIANCE\n{header}FORMAT=32-bit_rle_{kind}\n\n-Y {HEIGHT} +X {columns or WIDTH}\n"
    path.write_bytes(head.encode() + body)
    return path


@pytest.mark.parametrize("columns", [WIDTH, 6])
def test_old_run_lengths_are_written_out(tmp_path: Path, columns: int) -> None:
    pixels = stored()
    pixels[:, 3:6] = pixels[:, 3:4]
    body = with_old_runs(pixels[:, :columns])
    read = read_hdr(write(tmp_path / "a.hdr", body, columns=columns))
    np.testing.assert_allclose(read, radiance(pixels[:, :columns]), atol=2e-3)
    assert len(body) < pixels[:, :columns].size


@pytest.mark.parametrize("lost", [4, 40])
def test_old_run_lengths_that_are_cut_off_are_refused(tmp_path: Path, lost: int) -> None:
    path = write(tmp_path / "a.hdr", with_old_runs(stored())[:-lost])
    with pytest.raises(ImageFileError, match="damaged"):
        read_hdr(path)


@pytest.mark.parametrize("kind", ["rgbe", "xyze"])
def test_a_header_may_have_hundreds_of_lines(tmp_path: Path, kind: str) -> None:
    lines = "pfilt -x 400 -e 2 some.hdr\n" * 300 + "EXPOSURE=2\n"
    pixels = stored()
    pixels[..., :3] = 200
    read = read_hdr(write(tmp_path / "a.hdr", pixels.tobytes(), lines, kind))
    np.testing.assert_allclose(read, 200.5 / 256 / 2, rtol=0.01)
