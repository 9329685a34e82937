"""Radiance survives its files; broken or unfit files are refused."""

import resource
import signal
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from deeplight.errors import ImageFileError
from deeplight.io.radiance import read_hdr, write_exr, write_hdr


def radiance(height: int = 20, width: int = 40) -> np.ndarray:
    """Nine decades of light, the top left texel brighter than a half float can hold."""
    random = np.random.default_rng(1)
    values = np.exp(random.uniform(-10, 8, (height, width, 3))).astype(np.float32)
    values[0, 0] = 120_000
    return values


def save(
    path: Path, array: np.ndarray, kind: str, channels: str = "RGB", **header: str | int
) -> None:
    spec = oiio.ImageSpec(array.shape[1], array.shape[0], array.shape[2], kind)
    spec.channelnames = tuple(channels.split(",") if "," in channels else channels)
    for name, value in header.items():
        spec.attribute(name, value)
    file = oiio.ImageOutput.create(str(path))
    assert file.open(str(path), spec)
    assert file.write_image(array)
    assert file.close()


def test_exr_keeps_every_bit(tmp_path: Path) -> None:
    write_exr(tmp_path / "light.exr", radiance())
    np.testing.assert_array_equal(read_hdr(tmp_path / "light.exr"), radiance())


def test_exr_carries_its_metadata(tmp_path: Path) -> None:
    path = tmp_path / "light.exr"
    write_exr(path, radiance(), {"deeplight:frame": "camera", "deeplight:size": 32, "fov": 1.5})
    spec = oiio.ImageInput.open(str(path)).spec()
    assert spec.get_string_attribute("deeplight:frame") == "camera"
    assert spec.get_int_attribute("deeplight:size") == 32
    assert spec.get_float_attribute("fov") == 1.5
    assert spec.get_string_attribute("compression") == "zip"
    assert str(spec.format) == "float"


def test_radiance_hdr_keeps_one_percent_of_the_largest_channel(tmp_path: Path) -> None:
    values = radiance()
    values[1, 1] = -3
    write_hdr(tmp_path / "light.hdr", values)
    read = read_hdr(tmp_path / "light.hdr")
    wanted = np.maximum(values, 0)
    largest = wanted.max(axis=-1, keepdims=True)
    assert (np.abs(read - wanted) <= 0.01 * largest).all()
    assert (read[1, 1] == 0).all()
    assert np.abs(read - wanted[::-1]).max() > 1000  # the top row is first


@pytest.mark.parametrize("compression", "none rle zip zips piz pxr24 b44 b44a dwaa dwab".split())
@pytest.mark.parametrize("kind", ["half", "float"])
def test_every_exr_compression_is_read(tmp_path: Path, compression: str, kind: str) -> None:
    smooth = np.linspace(0.5, 2, 64 * 64 * 3, dtype=np.float32).reshape(64, 64, 3)
    save(tmp_path / "light.exr", smooth, kind, compression=compression)
    np.testing.assert_allclose(read_hdr(tmp_path / "light.exr"), smooth, rtol=0.02)


@pytest.mark.parametrize(
    "channels", ["R,G,B,A", "A,B,G,R", "Z,R,G,B", "beauty.R,beauty.G,beauty.B"]
)
def test_colour_is_found_by_name(tmp_path: Path, channels: str) -> None:
    names = channels.split(",")
    values = radiance()
    planes = {name: values[..., "RGB".index(name[-1])] for name in names if name[-1] in "RGB"}
    stack = np.stack([planes.get(name, np.full((20, 40), 9, np.float32)) for name in names], -1)
    save(tmp_path / "light.exr", np.ascontiguousarray(stack), "float", channels)
    np.testing.assert_array_equal(read_hdr(tmp_path / "light.exr"), values)


def test_plain_colour_wins_over_a_layer(tmp_path: Path) -> None:
    values = np.concatenate([np.zeros((20, 40, 3), np.float32), radiance()], axis=-1)
    save(tmp_path / "light.exr", values, "float", "diffuse.R,diffuse.G,diffuse.B,R,G,B")
    np.testing.assert_array_equal(read_hdr(tmp_path / "light.exr"), radiance())


def test_grey_becomes_three_channels(tmp_path: Path) -> None:
    grey = radiance()[..., :1].copy()
    save(tmp_path / "light.exr", grey, "float", "Y")
    np.testing.assert_array_equal(read_hdr(tmp_path / "light.exr"), np.repeat(grey, 3, axis=-1))


def test_negative_ringing_is_kept(tmp_path: Path) -> None:
    values = radiance()
    values[5, 5] = -0.25
    write_exr(tmp_path / "light.exr", values)
    assert (read_hdr(tmp_path / "light.exr")[5, 5] == -0.25).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("suffix", ["exr", "tif"])
def test_nan_and_infinity_are_refused(tmp_path: Path, bad: float, suffix: str) -> None:
    values = radiance()
    values[3, 3, 1] = bad
    path = tmp_path / f"light.{suffix}"
    save(path, values, "float")
    with pytest.raises(ImageFileError, match="1 values that are NaN or infinite"):
        read_hdr(path)


def test_encoded_pixels_are_no_radiance(tmp_path: Path) -> None:
    save(tmp_path / "photo.png", np.zeros((40, 40, 3), np.uint8), "uint8")
    with pytest.raises(ImageFileError, match="uint8 pixels"):
        read_hdr(tmp_path / "photo.png")


def test_channels_without_colour_are_named(tmp_path: Path) -> None:
    save(tmp_path / "normals.exr", radiance()[..., :2].copy(), "float", "N.X,N.Y")
    with pytest.raises(ImageFileError, match=r"N\.X, N\.Y"):
        read_hdr(tmp_path / "normals.exr")


def test_an_unknown_suffix_is_reported_and_nothing_is_left(tmp_path: Path) -> None:
    with pytest.raises(ImageFileError, match="name ending in"):
        write_exr(tmp_path / "light.xyz", radiance())
    assert list(tmp_path.iterdir()) == []


@contextmanager
def files_of_at_most(count: int) -> Iterator[None]:
    """Let writing past `count` bytes fail, as a full disk does."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    ignored = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (count, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, ignored)


@pytest.mark.parametrize("suffix", ["exr", "hdr"])
@pytest.mark.parametrize("limit", [0, 5_000, 300_000])
def test_a_full_disk_leaves_nothing_half_written(tmp_path: Path, suffix: str, limit: int) -> None:
    write = write_exr if suffix == "exr" else write_hdr
    noise = np.random.default_rng(2).random((400, 400, 3), dtype=np.float32)
    with files_of_at_most(limit), pytest.raises(OSError, match=r"."):
        write(tmp_path / f"light.{suffix}", noise)
    assert list(tmp_path.iterdir()) == []
    write(tmp_path / f"light.{suffix}", noise)  # and with room it works
    assert read_hdr(tmp_path / f"light.{suffix}").shape == (400, 400, 3)


def test_a_real_panorama_is_read(shared: Path) -> None:
    panorama = read_hdr(shared / "hdri" / "hotel_room.exr")
    assert panorama.shape == (512, 1024, 3)
    assert panorama.dtype == np.float32
    assert panorama.max() > 10 * np.median(panorama)
