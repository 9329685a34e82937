"""The camera's tilt by upright edges, by the network and by EXIF: which counts, and how much."""

from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from deeplight.camera import PinholeCamera
from deeplight.estimators.network import Estimate
from deeplight.estimators.projection import ImagePlane
from deeplight.estimators.tilt import seen_tilt, tilt_of_estimate
from deeplight.estimators.upright_edges import LEAST_EVIDENCE, tilt_with_edges
from deeplight.frames import turned, world_from_camera
from deeplight.io.photos import Photo
from deeplight.io.tilt import Tilt
from deeplight.lighting import Lighting
from deeplight.preprocess import frame_photo

CAMERA = PinholeCamera(300, 400, float(np.radians(66)))
PLANE = ImagePlane.centred(400, 300, CAMERA.vertical_fov_rad)
GRASS = np.random.default_rng(1).integers(60, 180, (400, 300, 3), dtype=np.uint8)


def posts(pitch_deg: float, roll_deg: float = 0.0) -> np.ndarray:
    """A photo of upright posts all around a camera."""
    rays = turned(CAMERA.rays(), world_from_camera(0.0, *np.radians([pitch_deg, roll_deg])))
    azimuth = np.arctan2(rays[..., 0], -rays[..., 2])
    noise = np.random.default_rng(0).normal(0, 4, azimuth.shape)
    level = 130 + 60 * np.tanh(4 * np.sin(azimuth * 20)) + noise
    return np.repeat(level[..., None], 3, 2).clip(0, 255).astype(np.uint8)


def guess(pitch_deg: float, scale_deg: float) -> Tilt:
    return Tilt(float(np.radians(pitch_deg)), 0.0, "a guess", float(np.radians(scale_deg)))


def heads(pitch_deg: float, turn: int = 0) -> dict[str, float]:
    upright = {f"upright_{angle}": float(angle == turn) for angle in (0, 90, 180, 270)}
    return upright | {"pitch_rad": float(np.radians(pitch_deg)), "pitch_scale": 0.3}


def estimate_of(pixels: np.ndarray, known: Tilt | None) -> Estimate:
    light = Lighting.from_log_radiance(np.zeros((32, 32, 3), np.float32))
    framing = frame_photo(400, 300, CAMERA.vertical_fov_rad, "exif")
    photo = Photo(pixels)
    vars(photo)["tilt"] = known  # as read from a file
    return Estimate(light, photo, framing, (), {}, (), heads(-10))


@pytest.mark.parametrize(
    ("pitch", "roll"), [(-35, 0), (-12, 4), (0, -3), (15, 2), (-12, 14), (5, -17)]
)
@pytest.mark.parametrize("before", [None, guess(-10, 25)])
def test_upright_edges_say_how_the_camera_was_tilted(pitch, roll, before):
    found, evidence = tilt_with_edges(posts(pitch, roll), PLANE, before)
    assert evidence > LEAST_EVIDENCE
    off = np.degrees([found.pitch_rad, found.roll_rad]) - [pitch, roll]
    assert np.abs(off).max() < 3
    assert 2.99 < np.degrees(found.scale_rad) < 5  # never as if it were known
    assert "edges" in found.source


@pytest.mark.parametrize("step", [3, 4])
def test_edges_of_a_large_photo_lie_where_those_of_a_small_one_do(step):
    large = np.asarray(Image.fromarray(posts(-20)).resize((300 * step, 400 * step)))
    found, _ = tilt_with_edges(large[: 400 * step - 1], PLANE, None)
    assert np.degrees(found.pitch_rad) == pytest.approx(-20, abs=3)


@pytest.mark.parametrize("pixels", [GRASS, np.full_like(GRASS, 128), GRASS[:3, :3]])
def test_what_has_no_upright_edges_leaves_the_guess(pixels):
    before = guess(-17, 9)
    assert tilt_with_edges(pixels, PLANE, before)[0] is before
    assert tilt_with_edges(pixels, PLANE, None)[0] is None


def test_a_sure_guess_is_moved_less_than_a_doubtful_one():
    pitches = [tilt_with_edges(posts(15), PLANE, guess(-15, s))[0].pitch_rad for s in (4, 12, 40)]
    assert pitches == sorted(pitches)


def test_edges_say_nothing_of_a_photo_that_lies_on_its_side():
    assert seen_tilt(posts(-20), PLANE, heads(-10, turn=90)) is None


def test_a_sure_network_is_not_asked_again():
    sure = heads(-10) | {"pitch_scale": 0.1}
    assert seen_tilt(posts(-20), PLANE, sure).source == "the network's guess"
    assert "edges" in seen_tilt(posts(-20), PLANE, heads(-10)).source


@pytest.mark.parametrize(
    ("given", "expected_deg"),
    [((None, None), (-5, 2)), ((-30, None), (-30, 2)), ((None, 7), (-5, 7)), ((-30, 7), (-30, 7))],
)
def test_what_is_given_of_the_tilt_counts_before_exif(given, expected_deg):
    known = Tilt(*np.radians([-5, 2]).tolist(), "EXIF acceleration")
    tilt, notes = tilt_of_estimate(estimate_of(posts(-5, 2), known), *given)
    assert (tilt.pitch_rad, tilt.roll_rad) == pytest.approx(np.radians(expected_deg))
    assert (tilt.scale_rad, notes) == (0, ())


def test_exif_that_contradicts_the_picture_is_taken_and_said():
    known = Tilt(float(np.radians(30)), 0.0, "EXIF camera elevation")
    tilt, notes = tilt_of_estimate(estimate_of(posts(-20), known))
    assert tilt == known
    (note,) = notes
    assert "EXIF camera elevation says a pitch of 30" in note
    assert "--pitch" in note
    assert tilt_of_estimate(estimate_of(posts(-20), known), pitch_deg=30)[1] == ()
    assert tilt_of_estimate(estimate_of(GRASS, known))[1] == ()
    near = replace(known, pitch_rad=float(np.radians(-5)))
    assert tilt_of_estimate(estimate_of(posts(-20), near))[1] == ()
