"""Transfer files: what comes back, and that a damaged one is reported and never read."""

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

from deeplight.compose import shapes
from deeplight.compose.mesh import Finish, Mesh
from deeplight.errors import ImageFileError
from deeplight.frames import normalised
from deeplight.transfer.file import LAYOUT, decode, encode, read, write
from deeplight.transfer.ground import Ground
from deeplight.transfer.precompute import Transfer, TransferSettings, precompute

pytestmark = pytest.mark.needs("embreex")


@pytest.fixture(scope="module")
def transfer() -> Transfer:
    """With every part that the format knows."""
    vertices, faces, normals = shapes.bunny(9)
    mesh = Mesh(vertices, faces, normals, None, 0.5 + 0.4 * normals, Finish())
    settings = TransferSettings(
        samples=64,
        bounces=1,
        diffuse=None,
        ground=Ground(size=6),
        longest_edge=1.0,
        clusters=2,
        components=3,
    )
    return precompute([mesh], settings)[0]


@pytest.fixture(scope="module")
def content(transfer: Transfer) -> bytes:
    return encode(transfer)


def sealed(content: bytes) -> bytes:
    """The same with its checksum put right."""
    return content[:12] + struct.pack("<I", zlib.crc32(content[16:])) + content[16:]


def test_everything_comes_back_within_its_steps(transfer: Transfer, content: bytes) -> None:
    got = decode(content)
    assert (got.order, got.bounces) == (4, 1)
    np.testing.assert_array_equal(got.triangles, transfer.triangles)
    np.testing.assert_allclose(got.vertices, transfer.vertices, atol=1.6e-5)
    np.testing.assert_allclose(got.normals, transfer.normals, atol=1e-4)
    assert got.colours is not None
    np.testing.assert_array_equal(got.colours, transfer.colours)
    steps = np.ptp(transfer.diffuse, axis=0) / np.where(np.arange(25) < 4, 65_535, 255)
    assert (np.abs(got.diffuse - transfer.diffuse) <= 0.51 * steps + 1e-7).all()
    light = np.linspace(1, 0.1, 75).reshape(25, 3)
    np.testing.assert_allclose(got.shadow(light), transfer.shadow(light), atol=0.01)
    eyes = normalised(got.normals + [0.2, 0.3, 0.1])
    near = got.glossy_radiance(light, eyes) - transfer.glossy_radiance(light, eyes)
    assert np.sqrt((near**2).mean()) < 0.01


def test_writing_is_repeatable_and_reading_is_its_inverse(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.transfer"
    write(path, decode(content))
    again = read(path)
    assert len(path.read_bytes()) == len(content)
    np.testing.assert_allclose(again.diffuse, decode(content).diffuse, atol=1e-6)


def test_without_gloss_ground_and_colours_it_is_small(content: bytes) -> None:
    settings = TransferSettings(samples=64, bounces=0, glossy=None, ground=None, longest_edge=1.0)
    bare = precompute([Mesh(*shapes.bunny(9))], settings)[0]
    got = decode(encode(bare))
    assert got.glossy is None
    assert got.shadowed is None
    assert got.colours is None
    assert len(encode(bare)) < 0.8 * len(content)


def test_a_file_cut_anywhere_is_reported(content: bytes) -> None:
    for length in [*range(100), *range(100, len(content), 61)]:
        with pytest.raises(ImageFileError):
            decode(content[:length])
    with pytest.raises(ImageFileError, match="where its header says"):
        decode(content + b"\0\0\0\0")
    decode(content)


def test_a_bit_flipped_anywhere_is_reported(content: bytes) -> None:
    for at in [*range(96), *range(96, len(content), 37)]:
        flipped = bytearray(content)
        flipped[at] ^= 1 << (at % 8)
        with pytest.raises(ImageFileError):
            decode(bytes(flipped))


def test_nonsense_behind_a_right_checksum_is_reported_or_harmless(content: bytes) -> None:
    """Whatever a stranger writes: one line, or finite numbers of the right shapes."""
    rng, refused = np.random.default_rng(7), 0
    for _ in range(300):
        changed = bytearray(content)
        for at in rng.integers(16, 110, 3):
            changed[at] = rng.integers(256)
        try:
            got = decode(sealed(bytes(changed)))
        except ImageFileError:
            refused += 1
            continue
        assert got.triangles.max() < len(got.vertices)
        assert np.isfinite(got.diffuse).all()
        assert np.isfinite(got.vertices).all()
    assert 100 < refused < 300


@pytest.mark.parametrize(
    ("at", "form", "value", "message"),
    [
        (4, "<H", 2, "version 2"),
        (16, "<B", 9, "out of range"),
        (20, "<I", 2**31, "out of range"),
        (24, "<I", 2**31, "out of range"),
        (28, "<H", 60_000, "out of range"),
        (32, "<f", np.inf, "out of range"),
        (20, "<I", 1, "where its header says"),
    ],
)
def test_a_header_that_lies_is_reported(
    content: bytes, at: int, form: str, value: float, message: str
) -> None:
    part = struct.pack(form, value)
    changed = content[:at] + part + content[at + len(part) :]
    with pytest.raises(ImageFileError, match=message):
        decode(sealed(changed))


def test_corners_and_clusters_that_are_not_there_are_reported(
    transfer: Transfer, content: bytes
) -> None:
    count, triangles = len(transfer.vertices), len(transfer.triangles)
    corner = LAYOUT["header_bytes"] + -(-6 * count // 4) * 4 + 4 * count
    changed = content[:corner] + b"\xff\xff" + content[corner + 2 :]
    with pytest.raises(ImageFileError, match="vertices that are not there"):
        decode(sealed(changed))
    colours = corner + -(-6 * triangles // 4) * 4
    cluster = colours + -(-3 * count // 4) * 4 + -(-(8 * 25 + 29 * count) // 4) * 4
    changed = content[:cluster] + b"\xff" + content[cluster + 1 :]
    with pytest.raises(ImageFileError, match="cluster that is not there"):
        decode(sealed(changed))


def test_something_else_is_reported(tmp_path: Path) -> None:
    path = tmp_path / "a.transfer"
    path.write_bytes(b"glTF" + bytes(200))
    with pytest.raises(ImageFileError, match="which is none"):
        read(path)
    with pytest.raises(FileNotFoundError):
        read(tmp_path / "missing.transfer")
