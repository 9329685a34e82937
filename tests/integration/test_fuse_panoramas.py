"""`deeplight fuse` on panoramas of phones: equirectangular, cylinders swept round and upwards."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from deeplight.frames import rotation
from deeplight.io.environment_file import read_environment
from deeplight.io.photos import encode_jpeg
from deeplight.mappings import latlong
from deeplight.mappings.resample import sample_latlong, shrink_latlong, turned_latlong
from fused import HEIGHT, fuse, pan

pytestmark = pytest.mark.needs("av")


@pytest.mark.parametrize("metadata", [True, False])
def test_a_phones_panorama_is_seen_where_it_shows(tmp_path: Path, metadata: bool) -> None:
    whole = (np.clip(pan().panorama, 0, 1) ** (1 / 2.2) * 255).astype(np.uint8)
    xmp = (
        b"http://ns.adobe.com/xap/1.0/\0<x:xmpmeta><rdf:Description "
        b'GPano:ProjectionType="equirectangular" GPano:FullPanoWidthPixels="512" '
        b'GPano:FullPanoHeightPixels="256"/></x:xmpmeta>'
    )
    jpeg = encode_jpeg(whole)
    segment = b"\xff\xe1" + (len(xmp) + 2).to_bytes(2, "big") + xmp
    (tmp_path / "pano.jpg").write_bytes(jpeg[:2] + segment * metadata + jpeg[2:])
    assert fuse(tmp_path / "out", tmp_path / "pano.jpg") == 0
    found = read_environment(tmp_path / "out" / "pano.json")
    assert found.seen is not None
    solid_angle = latlong.solid_angles(HEIGHT, 2 * HEIGHT)
    assert (found.seen * solid_angle).sum() / (4 * np.pi) > 0.9
    wanted = shrink_latlong(pan().panorama, HEIGHT)
    off = np.abs(np.log(found.radiance / wanted))[found.seen > 0.99]
    assert np.median(off) < 0.1


def cylinder(focal_px: float, height: int, width: int, place: np.ndarray) -> np.ndarray:
    """What a phone that is swept round writes of a place, linear; -Z in its middle."""
    angle = (np.arange(width) + 0.5 - width / 2) / focal_px
    rise = (height / 2 - np.arange(height) - 0.5) / focal_px
    x, y, z = np.broadcast_arrays(np.sin(angle)[None], rise[:, None], -np.cos(angle)[None])
    directions = np.stack([x, y, z], axis=-1) / np.hypot(1, rise)[:, None, None]
    return sample_latlong(place, directions.astype(np.float32))


@pytest.mark.parametrize("focal_35mm", [26, 35])
def test_an_iphones_panorama_is_a_cylinder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], focal_35mm: int
) -> None:
    focal_px = 320 * 26 / (0.8 * np.hypot(36, 24))
    radiance = cylinder(focal_px, 320, round(np.radians(240) * focal_px), pan().panorama)
    exif = Image.Exif()
    exif.get_ifd(0x8769).update({0xA401: 6, 0xA405: focal_35mm})
    pixels = (np.clip(radiance, 0, 1) ** (1 / 2.2) * 255).astype(np.uint8)
    Image.fromarray(pixels).save(tmp_path / "pano.jpg", exif=exif, quality=95)
    assert fuse(tmp_path / "out", tmp_path / "pano.jpg") == 0
    degrees = round(240 * 26 / focal_35mm)
    assert f"a cylinder {degrees} degrees wide" in capsys.readouterr().out
    found = read_environment(tmp_path / "out" / "pano.json")
    assert found.seen is not None
    wanted = shrink_latlong(pan().panorama, HEIGHT)
    seen = found.seen[HEIGHT // 2] > 0.99
    assert abs(seen.mean() - degrees / 360) < 0.15  # of its ends less than a view is left out
    off = float(np.median(np.abs(np.log(found.radiance / wanted))[found.seen > 0.99]))
    assert off < 0.1 if focal_35mm == 26 else off > 0.2  # a wrong one shows


def test_an_iphones_panorama_swept_upwards_is_a_cylinder_that_lies(tmp_path: Path) -> None:
    focal_px = 320 * 26 / (0.8 * np.hypot(36, 24))
    aside = turned_latlong(pan().panorama, rotation("z", np.pi / 2))  # as the lying phone sees it
    lying = cylinder(focal_px, 320, round(np.radians(120) * focal_px), aside)
    exif = Image.Exif()
    exif.get_ifd(0x8769).update({0xA401: 6, 0xA405: 26})
    pixels = (np.clip(np.rot90(lying, -1), 0, 1) ** (1 / 2.2) * 255).astype(np.uint8)
    Image.fromarray(pixels).save(tmp_path / "pano.jpg", exif=exif, quality=95)
    assert fuse(tmp_path / "out", tmp_path / "pano.jpg") == 0
    found = read_environment(tmp_path / "out" / "pano.json")
    assert found.seen is not None
    seen = found.seen[:, HEIGHT] > 0.99
    assert 0.4 < seen.mean() < 120 / 180
    log = np.log(found.radiance)
    places = (aside, shrink_latlong(pan().panorama, HEIGHT))
    wrong, off = (
        float(np.median(np.abs(log - np.log(shrink_latlong(p, HEIGHT)))[found.seen > 0.99]))
        for p in places
    )
    assert off < 0.1 < 0.2 < wrong


def test_of_several_panoramas_each_has_a_world_of_its_own(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    xmp = b'<rdf:Description GPano:ProjectionType="equirectangular"/>'
    pixels = (np.clip(pan().panorama, 0, 1) ** (1 / 2.2) * 255).astype(np.uint8)
    for name in ("a.jpg", "b.jpg"):
        Image.fromarray(pixels).save(tmp_path / name, xmp=xmp)
        pixels = np.roll(pixels, 200, axis=1)
    assert fuse(tmp_path / "out", tmp_path / "a.jpg", tmp_path / "b.jpg") == 2
    assert "expected one panorama; got another" in capsys.readouterr().err
    assert fuse(tmp_path / "alone", tmp_path / "a.jpg") == 0
    kept, alone = (read_environment(tmp_path / f / "a.json") for f in ("out", "alone"))
    np.testing.assert_array_equal(kept.radiance, alone.radiance)
