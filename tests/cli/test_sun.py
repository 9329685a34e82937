"""The sun where it stood: astronomy against a published figure, EXIF of phones, shadows."""

import json
import struct
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from deeplight import frames
from deeplight.camera import PinholeCamera
from deeplight.cli.main import main
from deeplight.errors import ConfigError
from deeplight.estimators.environment import SceneLight
from deeplight.estimators.sun import (
    SunHint,
    sun_at_angles,
    sun_at_pixel,
    sun_from_shadow,
    sun_of,
    with_sun,
)
from deeplight.io import photos
from deeplight.io.exif import exif_directories
from deeplight.io.tilt import Tilt
from deeplight.io.whereabouts import Whereabouts, whereabouts_of
from deeplight.lamp import SUN_ANGULAR_RADIUS_RAD, Lamp

pytestmark = pytest.mark.needs("astral", "pygeomag")


# The worked example of NREL's solar position algorithm (Reda and Andreas 2004): zenith 50.11162,
# azimuth 194.34024 degrees.
NREL = (39.742476, -105.1786, 1830.14)
NREL_TIME = datetime(2003, 10, 17, 19, 30, 30, tzinfo=UTC)
NREL_AZIMUTH_DEG, NREL_ELEVATION_DEG = 194.34024, 90 - 50.11162


def taken(heading_deg: float, north: str = "true") -> Whereabouts:
    return Whereabouts(*NREL, NREL_TIME, heading_deg, north)


def off_deg(one: np.ndarray, other: np.ndarray) -> float:
    return float(np.degrees(np.arccos(np.clip(one @ other, -1, 1))))


def test_the_sun_stands_where_the_almanac_says():
    level = Tilt(0.0, 0.0, "level")
    ahead = sun_of(taken(NREL_AZIMUTH_DEG), level)
    expected = sun_at_angles(0.0, NREL_ELEVATION_DEG).direction
    assert off_deg(ahead.direction, expected) < 0.3
    looking_left_of_it = sun_of(taken(NREL_AZIMUTH_DEG - 40), level)
    assert looking_left_of_it.direction[0] > 0.4  # so it is on the right


def test_a_raised_camera_sees_it_lower():
    tilt = Tilt(np.radians(NREL_ELEVATION_DEG), 0.0, "given")
    sun = sun_of(taken(NREL_AZIMUTH_DEG), tilt)
    assert off_deg(sun.direction, frames.VIEW) < 0.3
    rolled = sun_of(taken(NREL_AZIMUTH_DEG), Tilt(0.0, np.radians(90), "given"))
    assert rolled.direction[0] > 0.5  # rolled counter-clockwise, up is on the right


def test_a_magnetic_heading_is_turned_by_the_declination_and_the_uncertainty_covers_a_compass():
    tilt = Tilt(0.0, 0.0, "level")
    true, magnetic = (sun_of(taken(180.0, north), tilt) for north in ("true", "magnetic"))
    between = np.degrees(
        np.subtract(*(np.arctan2(s.direction[0], -s.direction[2]) for s in (true, magnetic)))
    )
    assert between == pytest.approx(10.0, abs=1.0)  # the declination of Colorado in 2003, east
    wrong = sun_of(taken(190.0), tilt)
    assert off_deg(true.direction, wrong.direction) <= true.uncertainty_deg + 0.1
    assert sun_of(taken(180.0), None).uncertainty_deg > true.uncertainty_deg


def test_no_sun_at_night():
    night = Whereabouts(*NREL, datetime(2003, 10, 17, 7, tzinfo=UTC), 0.0, "true")
    assert sun_of(night, None) is None


def dms(value: float) -> tuple[IFDRational, ...]:
    whole = abs(value)
    degrees, minutes = int(whole), int(whole % 1 * 60)
    seconds = (whole * 60 % 1) * 60
    return (
        IFDRational(degrees, 1),
        IFDRational(minutes, 1),
        IFDRational(round(seconds * 1e4), 10_000),
    )


def save_photo(path: Path, heading: float, reference: str = "T", seconds=(1, 2000)) -> Path:
    """A photo with the GPS entries as phones write them and exiftool lists them."""
    exif = Image.Exif()
    gps = exif.get_ifd(0x8825)
    latitude, longitude, altitude = NREL
    gps[1], gps[2] = "N" if latitude > 0 else "S", dms(latitude)
    gps[3], gps[4] = "E" if longitude > 0 else "W", dms(longitude)
    gps[5], gps[6] = b"\0", IFDRational(round(altitude * 100), 100)
    gps[7] = tuple(IFDRational(n, 1) for n in (19, 30, 30))
    gps[16], gps[17] = reference, IFDRational(round(heading * 100), 100)
    gps[29] = "2003:10:17"
    camera = exif.get_ifd(0x8769)
    camera[0x829A], camera[0x829D], camera[0x8827] = IFDRational(*seconds), IFDRational(18, 10), 50
    noise = np.random.default_rng(0).integers(60, 200, (160, 120, 3), dtype=np.uint8)
    Image.fromarray(noise).save(path, exif=exif)
    return path


def test_exif_gives_place_time_and_heading(tmp_path):
    found = whereabouts_of(exif_directories(save_photo(tmp_path / "a.jpg", 154.34)))
    assert (found.latitude_deg, found.longitude_deg) == pytest.approx(NREL[:2], abs=1e-5)
    assert found.time == NREL_TIME
    assert found.exposure_value == pytest.approx(13.7, abs=0.1)
    sun = sun_of(found, None)
    assert off_deg(sun.direction, sun_at_angles(40.0, NREL_ELEVATION_DEG).direction) < 0.5
    assert "39." not in repr(found)  # the place does not slip into a message
    Image.new("RGB", (64, 64)).save(tmp_path / "plain.jpg")
    assert whereabouts_of(exif_directories(tmp_path / "plain.jpg")) is None


UNKNOWN = 0xFFFFFFFF
ENTRIES = {
    "hours without end": {7: (IFDRational(UNKNOWN - 1, 1), IFDRational(0, 1), IFDRational(0, 1))},
    "the end of time": {7: tuple(IFDRational(n, 1) for n in (24, 0, 0)), 29: "9999:12:31"},
    "one number for three": {2: IFDRational(39, 1)},
}


@pytest.mark.parametrize("name", ENTRIES)
def test_places_and_times_that_cannot_be_are_none(tmp_path, name):
    with Image.open(save_photo(tmp_path / "a.jpg", 154.34)) as picture:
        exif = picture.getexif()
        assert exif.get_ifd(0x8825)[17] == pytest.approx(154.34)
        exif.get_ifd(0x8825).update(ENTRIES[name])
        picture.save(tmp_path / "b.jpg", exif=exif)
    assert whereabouts_of(exif_directories(tmp_path / "b.jpg")) is None


def test_a_heading_may_be_unknown(tmp_path):
    path = save_photo(tmp_path / "a.jpg", 123.47)
    content = path.read_bytes()
    for order in "<>":  # by hand, since Pillow writes 0 / FFFFFFFF as 0 / 1
        written, unknown = struct.pack(f"{order}II", 12347, 100), struct.pack("<II", 0, UNKNOWN)
        content = content.replace(written, unknown)
    (tmp_path / "b.jpg").write_bytes(content)
    assert whereabouts_of(exif_directories(path)).heading_deg == pytest.approx(123.47)
    assert whereabouts_of(exif_directories(tmp_path / "b.jpg")) is None


@pytest.mark.parametrize(("seconds", "used"), [((1, 2000), True), ((1, 20), False)])
def test_the_command_uses_it_outdoors_by_day_and_writes_no_place(
    tmp_path, tiny_model, capsys, seconds, used
):
    photo = save_photo(tmp_path / "a.jpg", 154.34, "M", seconds)
    words = [str(photo), "--out", str(tmp_path / "out"), "--model", str(tiny_model)]
    assert main(["estimate", *words]) == 0
    text = (tmp_path / "out/a.json").read_text()
    record = json.loads(text)
    assert record["sun"]["used"] is used
    assert record["sun"]["uncertainty_deg"] > 10
    assert "magnetic" in record["sun"]["source"]
    lamps = record["lamps"]["lamps"]
    if used:
        assert len(lamps) == 1
        assert off_deg(np.array(lamps[0]["direction"]), np.array(record["sun"]["direction"])) < 0.1
    assert ("sun placed" in capsys.readouterr().out) is used
    assert not any(
        number in text for number in ("39.7424", "105.178", "1830.14", "2003:10", "2003-10")
    )


def test_exif_is_read_with_the_pixels_and_never_again(tmp_path, tiny_model, monkeypatch):
    photo, read = save_photo(tmp_path / "a.jpg", 154.34, "M"), []

    def noted(path):
        read.append(path)
        return exif_directories(path)

    monkeypatch.setattr(photos, "exif_directories", noted)
    words = [str(photo), "--out", str(tmp_path / "out"), "--model", str(tiny_model)]
    assert main(["estimate", *words]) == 0
    assert read == []


def test_a_given_sun_is_said_without_a_doubt_of_0_degrees(tmp_path, tiny_model, capsys):
    photo = save_photo(tmp_path / "a.jpg", 154.34)
    words = [str(photo), "--out", str(tmp_path / "out"), "--model", str(tiny_model)]
    assert main(["estimate", *words, "--sun", "30", "40"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "given by its angles" in said
    assert "within" not in said


CAMERA = PinholeCamera(300, 400, float(np.radians(66)))


@pytest.mark.parametrize("azimuth_deg", [-150, -60, 20, 100])
@pytest.mark.parametrize("elevation_deg", [15, 40, 70])
def test_a_shadow_gives_the_suns_direction(azimuth_deg, elevation_deg):
    """A pole of 0.4 camera heights, projected with its shadow, gives the sun back."""
    tilt = Tilt(np.radians(-25), np.radians(3), "given")
    world = frames.world_from_camera(0.0, tilt.pitch_rad, tilt.roll_rad)
    sun = sun_at_angles(azimuth_deg, elevation_deg).direction  # here in the level world
    foot, height = np.array([0.2, 0.0, -2.2]), 0.4
    tip = foot - [sun[0], 0, sun[2]] / sun[1] * height
    points = np.stack([foot, tip, foot + [0, height, 0]]) - [0, 1, 0]
    rows, columns = CAMERA.pixel_of_directions(frames.normalised(points) @ world)
    pixels = [(float(c) + 0.5, float(r) + 0.5) for r, c in zip(rows, columns, strict=True)]
    found = sun_from_shadow(CAMERA, tilt, *pixels)
    assert off_deg(world @ found.direction, sun) < 0.1
    assert found.uncertainty_deg <= 5
    wrong = sun_from_shadow(CAMERA, Tilt(np.radians(-15), 0.0, "wrong"), *pixels)
    assert off_deg(world @ wrong.direction, sun) > 1
    guessed = sun_from_shadow(CAMERA, tilt, *pixels[:2], None, np.radians(elevation_deg))
    assert off_deg(world @ guessed.direction, sun) < 0.1


def test_a_pixel_is_a_direction():
    ray = CAMERA.rays()[40, 250]
    assert off_deg(sun_at_pixel(CAMERA, 250.5, 40.5).direction, ray) < 1e-4


def test_the_power_stays_the_estimates():
    flux = np.array([2.0, 1.5, 1.0])
    lamps = (Lamp(frames.UP, flux, 0.1), Lamp(frames.RIGHT, flux / 4, 0.1))
    scene = SceneLight(np.ones((32, 64, 3), np.float32), lamps, np.zeros((32, 64), np.float32))
    (sun,) = with_sun(scene, sun_at_angles(30, 20)).lamps
    assert sun.flux == pytest.approx(flux * 1.25)
    assert sun.angular_radius_rad == SUN_ANGULAR_RADIUS_RAD
    empty = SceneLight(scene.rest, (), scene.seen)
    assert with_sun(empty, sun_at_angles(30, 20)).lamps == ()


@pytest.mark.parametrize(
    "values",
    [
        {},
        {"angles_deg": (0.0, 10.0), "pixel": (1.0, 1.0)},
        {"pixel": (1.0, 1.0), "shadow_top": (2.0, 2.0)},
        {"pixel": (np.nan, 1.0)},
    ],
)
def test_hints_that_contradict_or_say_nothing_are_refused(values):
    with pytest.raises(ConfigError):
        SunHint(**values)


def test_a_shadow_in_the_sky_is_refused():
    with pytest.raises(ConfigError, match="ground"):
        sun_from_shadow(CAMERA, None, (150, 100), (160, 300), (150, 50))
