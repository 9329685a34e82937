"""What `deeplight estimate` says of the camera, and what it may be given."""

import json

import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from deeplight.io.radiance import read_hdr


def test_notes_name_their_photos_and_are_said_once(photos, estimate, capsys):
    """Three fields of view are assumed, of 66 and of 52 degrees: one line for all three."""
    with Image.open(photos / "scene.jpg") as scene:
        scene.rotate(90, expand=True).save(photos / "lying.jpg")
        scene.crop((0, 0, 360, 440)).save(photos / "short.jpg")
    assert estimate(photos, "--light-only") == 0
    lines = " ".join(capsys.readouterr().out.split())
    assert lines.count("field of view unknown") == 1
    assert "all 3: field of view unknown, assumed 52 to 66 degrees" in lines
    assert "lying: the photo shows 94% of the view" in lines  # slid down


def test_a_given_pitch_is_the_cameras(photos, estimate, tmp_path):
    assert estimate(photos / "scene.jpg", "--pitch", -30, "--roll", 5) == 0
    record = json.loads((tmp_path / "out/scene.json").read_text())
    tilt = record["camera_tilt"]
    assert (tilt["pitch_deg"], tilt["roll_deg"], tilt["scale_deg"]) == pytest.approx((-30, 5, 0))
    assert tilt["up"][1] == pytest.approx(np.cos(np.radians(30)) * np.cos(np.radians(5)))
    down = read_hdr(tmp_path / "out/scene.exr")
    assert estimate(photos / "scene.jpg", "--pitch", 30) == 0
    up = read_hdr(tmp_path / "out/scene.exr")
    assert np.abs(up - down).max() > 0.01  # the photo's rows go on otherwise


@pytest.mark.parametrize("words", [["--pitch", 120], ["--light-only", "--pitch", -10]])
def test_a_pitch_that_cannot_be_is_refused(photos, estimate, capsys, words):
    assert estimate(photos / "scene.jpg", *words) == 2
    assert "--pitch" in capsys.readouterr().err


def test_a_tilt_that_the_picture_contradicts_is_noted(tmp_path, estimate, capsys):
    """Upright stripes all over: a camera that looks level, whatever its EXIF data say."""
    stripes = np.where(np.arange(300) // 12 % 2, 200, 60).astype(np.uint8)
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0x9405] = IFDRational(50, 1)
    pixels = np.repeat(np.tile(stripes, (400, 1))[..., None], 3, axis=2)
    Image.fromarray(pixels).save(tmp_path / "stripes.jpg", exif=exif)
    assert estimate(tmp_path / "stripes.jpg") == 0
    record = json.loads((tmp_path / "out/stripes.json").read_text())
    assert record["camera_tilt"]["pitch_deg"] == pytest.approx(50)
    (note,) = (note for note in record["notes"] if "--pitch" in note)
    assert "EXIF camera elevation says a pitch of 50" in note
    assert "EXIF camera elevation says" in " ".join(capsys.readouterr().out.split())
