"""The simulated phone: its automatics, its takes, and what one frame says about another."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deeplight.camera_response import CameraResponse, decode
from deeplight.errors import DataSetError, ImageFileError
from deeplight.io.radiance import write_exr
from deeplight.mappings import latlong
from deeplight.relight import relight_rig
from deeplight.simulate.panorama import Place, load, places_in
from deeplight.simulate.phone import (
    PHONES,
    CameraAutomatics,
    Setting,
    develop,
    draw_automatics,
    follow,
    metered,
)
from deeplight.simulate.take import film, hand_held, shrink_ball
from deeplight.sphere import PAPER_RIG

PLAIN = CameraAutomatics(0.45, 0.0, 0.1, 1.0, 0.0, (0.0, 0.0, 0.0), 0.5, 2.2, 0.0, 0.0, 1e-9, 95)


def panorama(sun: float = 2000.0) -> np.ndarray:
    """A blue sky over a brown floor, with a sun of a few texels."""
    d = latlong.directions(64, 128)
    sky = np.where(d[..., 1:2] > 0, [0.4, 0.6, 1.0], [0.3, 0.2, 0.1])
    glow = np.exp(60 * (d @ np.array([0.6, 0.64, -0.48]) - 1))[..., None]
    return (sky * (1 + 0.3 * np.sin(9 * d[..., :1])) + sun / 100 * glow).astype(np.float32)


def test_a_seed_decides_the_whole_take() -> None:
    def take(seed: int) -> list[bytes]:
        rng = np.random.default_rng(seed)
        return [f.jpeg for f in film(panorama(), PHONES["paper"], PAPER_RIG, 2, rng)]

    assert take(3) == take(3)
    assert take(3) != take(4)


def test_the_scale_of_a_panorama_does_not_matter() -> None:
    frames = []
    for scale in (1.0, 1024.0):
        rng = np.random.default_rng(1)
        (frame,) = film(panorama() * np.float32(scale), PHONES["paper"], PAPER_RIG, 1, rng)
        frames.append(frame)
    first, second = frames
    np.testing.assert_allclose(first.spheres["diffuse"], second.spheres["diffuse"], atol=1)
    np.testing.assert_allclose(
        first.true_lighting.radiance, second.true_lighting.radiance, rtol=1e-3
    )


def test_spheres_are_the_true_lighting_seen_through_the_camera() -> None:
    """With an ideal camera the diffuse crop is the relit true lighting, encoded."""
    rng = np.random.default_rng(9)
    (frame,) = film(panorama(200), PHONES["ideal"], PAPER_RIG, 1, rng)
    rendered = relight_rig(PAPER_RIG, frame.true_lighting)
    mask = PAPER_RIG.views["diffuse"].mask()
    for name, tolerance in (("diffuse", 0.004), ("matte_silver", 0.004), ("mirror", 0.012)):
        pixel = CameraResponse().pixel_from_radiance(rendered[name])
        assert abs(pixel - frame.spheres[name] / 255)[mask].mean() < tolerance, name
        flipped = abs(pixel[:, ::-1] - frame.spheres[name] / 255)[mask].mean()
        assert flipped > 4 * tolerance, name


def test_meter_brings_the_picture_to_the_brightness_it_aims_at() -> None:
    pixels = np.random.default_rng(0).uniform(0.5, 1.5, (400, 3)) * 7e-3
    gain = metered(pixels, np.ones(3), PLAIN).gain
    encoded = np.minimum(pixels * gain, 1) ** (1 / 2.2)
    assert encoded.mean() == pytest.approx(PLAIN.brightness, abs=0.01)


def test_meter_spares_the_highlights() -> None:
    pixels = np.full((400, 3), 0.01)
    pixels[:80] = 5.0  # a fifth of the picture is a window
    gain = metered(pixels, np.ones(3), PLAIN).gain
    assert (pixels[0] * gain).max() < 2.1
    assert (pixels[-1] * gain).max() < 0.01


def test_white_balance_follows_the_illuminant_not_the_room() -> None:
    """A green room in white light stays green; white things in orange light turn white."""
    green, orange = np.array([0.1, 0.5, 0.1]), np.array([1.0, 0.6, 0.3])
    in_green_room = metered(np.tile(green, (400, 1)), np.ones(3), PLAIN).gain
    np.testing.assert_allclose(in_green_room / in_green_room[1], 1, rtol=1e-5)
    grey_world = replace(PLAIN, picture_share=1.0)
    purple = metered(np.tile(green, (400, 1)), np.ones(3), grey_world).gain
    assert purple[0] > 2 * purple[1]
    balanced = metered(np.tile(orange, (400, 1)), orange, PLAIN).gain * orange
    np.testing.assert_allclose(balanced / balanced[1], 1, rtol=1e-5)


def test_automatics_move_part_of_the_way_each_frame() -> None:
    old, new = Setting((0.0, 0.0, 0.0)), Setting((1.0, 2.0, -1.0))
    assert follow(None, new, 0.5) == new
    np.testing.assert_allclose(follow(old, new, 0.25).log_gain, (0.25, 0.5, -0.25))


def test_developing_clips_at_white_and_encodes() -> None:
    radiance = np.array([[[0.0, 0.5, 9.0]]], np.float32)
    photo = develop(radiance, np.ones(3, np.float32), PLAIN, 64, np.random.default_rng(0))
    np.testing.assert_allclose(decode(photo / 255.0), [[[0, 0.5, 1]]], atol=0.01)


def test_habits_are_imperfect_but_plausible() -> None:
    automatics = [draw_automatics(PHONES["paper"], np.random.default_rng(n)) for n in range(200)]
    assert 2.0 < min(h.gamma for h in automatics) < max(h.gamma for h in automatics) < 2.4
    assert np.std([h.bias_stops for h in automatics]) > 0.1


def test_hands_look_down_more_than_up() -> None:
    def views(up: bool) -> np.ndarray:
        poses = [p for n in range(60) for p in hand_held(3, np.random.default_rng(n), up)]
        return np.array([pose @ [0.0, 0.0, -1.0] for pose in poses])

    assert np.mean(views(False)[:, 1] < 0) > 0.7
    assert (views(True)[:, 1] > 0.2).all()  # where the ground is made up


def test_shrinking_a_ball_keeps_white_white() -> None:
    np.testing.assert_allclose(
        shrink_ball(np.ones((64, 64, 3), np.float32), 32)[8:24, 8:24], 1, rtol=1e-6
    )


def test_a_folder_without_a_manifest_is_split_by_file(tmp_path: Path) -> None:
    for n in range(12):
        write_exr(tmp_path / f"place-{n}.exr", panorama())
    places = places_in(tmp_path)
    assert [p.name for p in places] == sorted(f"place-{n}" for n in range(12))
    assert {p.split for p in places} <= {"train", "val", "test"}
    assert places == places_in(tmp_path)


def test_a_folder_without_panoramas_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataSetError, match="none"):
        places_in(tmp_path)
    with pytest.raises(DataSetError, match="folder"):
        places_in(tmp_path / "missing")


@pytest.mark.parametrize(
    ("shape", "reason"),
    [((64, 64, 3), "square"), ((8, 16, 3), "64 rows"), ((64, 100, 3), "twice as wide")],
)
def test_what_is_no_panorama_is_refused(
    tmp_path: Path, shape: tuple[int, int, int], reason: str
) -> None:
    write_exr(tmp_path / "odd.exr", np.ones(shape, np.float32))
    with pytest.raises(ImageFileError, match=reason):
        load(Place(tmp_path / "odd.exr", "odd", "indoor", "train"))


def test_a_black_panorama_is_refused(tmp_path: Path) -> None:
    write_exr(tmp_path / "night.exr", np.zeros((64, 128, 3), np.float32))
    with pytest.raises(ImageFileError, match="light"):
        load(Place(tmp_path / "night.exr", "night", "indoor", "train"))
