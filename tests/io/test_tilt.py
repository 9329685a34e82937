"""How a camera was held, from what its photo says."""

import struct
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, TiffImagePlugin

from deeplight.frames import UP, world_from_camera
from deeplight.io.exif import exif_directories
from deeplight.io.tilt import tilt_of
from scripts import loaded

MADE = loaded(Path(__file__).parents[1] / "golden/make_web_exif.py")


def iphone_photo(up: np.ndarray, orientation: int, path: Path) -> Path:
    """A photo whose maker note says that `up` (camera frame of the upright picture) is up."""
    x, y = up[:2]
    phone = {1: (y, -x), 3: (-y, x), 6: (x, y), 8: (-x, -y)}[orientation]
    x, y, z = (-value for value in (*phone, up[2]))  # at rest a phone feels 1 g upwards
    path.write_bytes(MADE.photo(MADE.maker_note((x, y, z)), orientation))
    return path


@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
@pytest.mark.parametrize(("pitch", "roll"), [(-0.4, 0.1), (0.3, -0.2), (0.0, 0.0)])
def test_an_iphones_tilt_is_read(
    orientation: int, pitch: float, roll: float, tmp_path: Path
) -> None:
    up = world_from_camera(1.0, pitch, roll).T @ UP
    tilt = tilt_of(exif_directories(iphone_photo(up, orientation, tmp_path / "photo.jpg")))
    assert tilt is not None
    assert (tilt.pitch_rad, tilt.roll_rad) == pytest.approx((pitch, roll), abs=1e-3)


def elevated(path: Path, value: object) -> Path:
    path.write_bytes(MADE.photo(elevation=value))
    return path


def test_the_cameras_elevation_is_read_where_it_is_known(tmp_path: Path) -> None:
    known = tilt_of(
        exif_directories(elevated(tmp_path / "a.jpg", TiffImagePlugin.IFDRational(-25, 2)))
    )
    assert known is not None
    assert known.pitch_rad == pytest.approx(np.radians(-12.5))
    content = (tmp_path / "a.jpg").read_bytes()
    packed = struct.pack(">2i", -25, 2)
    assert content.count(packed) == 1
    (tmp_path / "a.jpg").write_bytes(content.replace(packed, struct.pack(">2I", 0, 0xFFFFFFFF)))
    assert tilt_of(exif_directories(tmp_path / "a.jpg")) is None
    assert tilt_of(exif_directories(elevated(tmp_path / "b.jpg", "n/a"))) is None


def test_an_iphones_heic_is_read_with_the_cameras_own_orientation(tmp_path: Path) -> None:
    heif = pytest.importorskip("pillow_heif")
    up = world_from_camera(1.0, -0.3, 0.1).T @ UP
    iphone_photo(up, 6, tmp_path / "photo.jpg")
    with Image.open(tmp_path / "photo.jpg") as picture:
        exif = picture.getexif().tobytes()
        heif.from_pillow(picture).save(tmp_path / "photo.heic", exif=exif)
    tilt = tilt_of(exif_directories(tmp_path / "photo.heic"))
    assert tilt is not None
    assert (tilt.pitch_rad, tilt.roll_rad) == pytest.approx((-0.3, 0.1), abs=1e-3)


@pytest.mark.parametrize("name", ["text", "unknown"])
def test_elevations_of_other_programs_are_unknown(name: str, cases: Path) -> None:
    assert tilt_of(exif_directories(cases / f"sound/exif_elevation_{name}.jpg")) is None


def test_no_tilt_is_invented(tmp_path: Path) -> None:
    Image.new("RGB", (64, 48)).save(tmp_path / "plain.jpg")
    assert tilt_of(exif_directories(tmp_path / "plain.jpg")) is None
    assert tilt_of(exif_directories(tmp_path / "missing.jpg")) is None
    shaken = iphone_photo(np.array([0.0, 3.0, 0.0]), 6, tmp_path / "shaken.jpg")
    assert tilt_of(exif_directories(shaken)) is None
