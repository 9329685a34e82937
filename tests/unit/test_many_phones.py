"""The family of phones: how wide it is, what processing keeps, what a take says of itself."""

import math
from dataclasses import replace

import numpy as np
import pytest

from deeplight.camera_response import encode
from deeplight.frames import VIEW
from deeplight.lighting import Lighting
from deeplight.mappings import latlong, mirror_ball, resample
from deeplight.preprocess import background, frame_photo
from deeplight.relight import relight_rig
from deeplight.simulate.many_phones import (
    KEPT,
    Optics,
    PhoneSettings,
    draw_phone,
    kept_phone,
)
from deeplight.simulate.many_takes import (
    drawn_height,
    film_many,
    held_anywhere,
    sphere_radiance,
    visible_pixels,
)
from deeplight.simulate.phone import CameraAutomatics
from deeplight.simulate.place_light import PlaceLight
from deeplight.simulate.processing import Processing, in_srgb, local_gain, process, rolled_off
from deeplight.sphere import PAPER_RIG

PLAIN = CameraAutomatics(0.45, 0.0, 0.1, 1.0, 0.0, (0.0, 0.0, 0.0), 0.5, 2.2, 0.0, 0.0, 1e-9, 95)
DIRECTIONS = latlong.directions(128, 256)
FAMILY = [draw_phone(np.random.default_rng(n)) for n in range(400)]


def panorama(sun: float = 3000.0) -> np.ndarray:
    """A blue sky over a patterned brown floor, with a sun of a few texels."""
    sky = np.where(DIRECTIONS[..., 1:2] > 0, [0.4, 0.6, 1.0], [0.3, 0.2, 0.1])
    glow = np.exp(900 * (DIRECTIONS @ np.array([0.6, 0.64, -0.48]) - 1))[..., None]
    return (sky * (1 + 0.3 * np.sin(9 * DIRECTIONS[..., :1])) + sun * glow).astype(np.float32)


def pose(seed: int = 0) -> np.ndarray:
    return next(held_anywhere(1, np.random.default_rng(seed)))


# The family


def test_the_family_is_as_wide_as_it_says() -> None:
    def spread(value: list[float]) -> tuple[float, float]:
        return min(value), max(value)

    fov = spread([math.degrees(p.optics.vertical_fov_rad) for p in FAMILY])
    assert 40 - 1e-6 <= fov[0] < 46
    assert 94 < fov[1] <= 100
    tints = np.array([p.automatics.tint for p in FAMILY])
    np.testing.assert_allclose(tints.std(axis=0), (0.2, 0.1, 0.2), rtol=0.15)
    assert np.std([p.automatics.bias_stops for p in FAMILY]) == pytest.approx(0.4, rel=0.15)
    assert np.std([p.processing.gamma for p in FAMILY]) == pytest.approx(0.15, rel=0.15)
    adaptation = np.array([p.automatics.adaptation for p in FAMILY])
    assert (adaptation == 0).mean() == pytest.approx(0.12, abs=0.05)
    assert (adaptation > 0.9).mean() > 0.15
    assert 0.3 < max(p.automatics.highlight_share for p in FAMILY) <= 0.35
    assert {p.metering for p in FAMILY} == {"average", "centre", "spot", "highlight"}


def test_the_kept_camera_is_none_of_the_family() -> None:
    kept = [kept_phone(np.random.default_rng(n)) for n in range(20)]
    assert {p.name for p in kept} == {KEPT}
    assert len({p.processing for p in kept}) == len({p.optics for p in kept}) == 1
    assert kept[0].processing not in {p.processing for p in FAMILY}


def test_hands_hold_it_anywhere() -> None:
    poses = [p for n in range(300) for p in held_anywhere(3, np.random.default_rng(n))]
    pitch = np.degrees(np.arcsin([(p @ VIEW)[1] for p in poses]))
    assert pitch.min() > -80.1
    assert pitch.max() < 25.1
    assert (pitch < -50).mean() > 0.08
    heights = [drawn_height(np.random.default_rng(n)) for n in range(100)]
    assert 0.6 <= min(heights) < 0.8 < 1.2 < max(heights) <= 1.5


@pytest.mark.parametrize("fov", [45.0, 66.0, 95.0])
@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("aspect", [9 / 16, 4 / 3])
def test_the_network_sees_what_preprocessing_makes_of_the_photo(
    fov: float, known: bool, aspect: float
) -> None:
    """A photo of ray positions, framed: each cell holds its own ray, edges go on."""
    optics = Optics(math.radians(fov), aspect, known)
    height = 600
    width = round(height * aspect)
    x, y = (np.arange(n, dtype=np.float64) + 0.5 for n in (width, height))
    photo = np.stack(np.broadcast_arrays(x / width, y[:, None] / height, 0.5), axis=-1)
    framing = frame_photo(height, width, optics.vertical_fov_rad if known else None)
    wanted = background(photo.astype(np.float32), framing).astype(float) / 255
    pixels = visible_pixels(optics)
    across, up = pixels.place
    np.testing.assert_allclose((across[pixels.columns] + 1) / 2, wanted[0, :, 0], atol=0.008)
    np.testing.assert_allclose((1 - up[pixels.rows]) / 2, wanted[:, 0, 1], atol=0.008)


# What a phone makes of a picture


def test_plain_processing_is_gamma() -> None:
    linear = np.random.default_rng(0).uniform(0, 1.3, (24, 18, 3)).astype(np.float32)
    plain = process(in_srgb(linear, Processing()), Processing())
    assert abs(plain - encode(np.minimum(linear, 1)) * 255).max() <= 0.51


@pytest.mark.parametrize("phone", FAMILY[:12])
def test_grey_stays_grey_and_more_light_is_never_darker(phone: PhoneSettings) -> None:
    plain = replace(phone.processing, local=0.0, detail=0.0, chroma_blur=0.0)
    ramp = np.repeat(np.linspace(0, 3, 200, dtype=np.float32)[None, :, None], 3, axis=2)
    shown = process(in_srgb(ramp, plain), plain).astype(int)
    assert np.ptp(shown, axis=2).max() <= 1
    assert (np.diff(shown[0, :, 0]) >= 0).all()
    middle = shown[0, np.searchsorted(ramp[0, :, 0], 0.2), 0] / 255
    assert middle == pytest.approx(0.2 ** (1 / 2.2), abs=0.08)


def test_highlights_roll_off_without_a_kink() -> None:
    curve = Processing(headroom=5.0, knee=0.6)
    x = np.linspace(0, 5, 2001, dtype=np.float32)
    y = rolled_off(x, curve).astype(float)
    np.testing.assert_array_equal(y[x <= 0.6], x[x <= 0.6])
    slope = np.diff(y) / np.diff(x)
    assert abs(np.diff(slope)).max() < 0.03
    assert y[-1] == pytest.approx(1, abs=1e-5)
    np.testing.assert_array_equal(rolled_off(x, Processing()), x)


def test_local_tone_mapping_brings_areas_together_and_keeps_texture() -> None:
    """Two areas four stops apart, both with the same fine pattern."""
    area = np.where(np.arange(128) < 64, 0.05, 0.8)[None, :, None]
    texture = 1 + 0.2 * ((np.arange(96)[:, None] + np.arange(128)) % 2)[..., None]
    linear = np.broadcast_to(area * texture, (96, 128, 3)).astype(np.float32)
    mapped = linear * local_gain(linear, 0.5)[..., None]
    dark, bright = mapped[:, 10:40].mean(), mapped[:, 90:120].mean()
    assert np.log2(bright / dark) == pytest.approx(2, abs=0.3)
    assert np.log(mapped / linear).mean() == pytest.approx(0, abs=0.02)
    assert mapped[1::2, 11].mean() / mapped[::2, 11].mean() == pytest.approx(1 / 1.2, rel=0.1)
    np.testing.assert_allclose(local_gain(linear, 0.0), 1)


# The light of a place


@pytest.mark.parametrize("seed", range(4))
def test_light_gathered_quickly_is_the_light(seed: int) -> None:
    light = panorama()
    fast = PlaceLight.of(light).ball(128, pose(seed))
    exact = resample.ball_from_latlong(light, 128, pose(seed).T)
    power = mirror_ball.solid_angles(128)[..., None]
    wanted = float((light * latlong.solid_angles(128, 256)[..., None]).sum())
    assert (fast * power).sum() == pytest.approx(wanted, rel=0.003)
    for name, crops in sphere_radiance(PAPER_RIG, [fast, exact]).items():
        mask = PAPER_RIG.views[name].mask()
        pixel = encode(np.minimum(crops[mask] * 0.3, 1))
        assert abs(pixel[:, 0] - pixel[:, 1]).mean() < 0.008, name
        turned_away = abs(pixel[:, 0] - pixel[::-1, 1]).mean()
        assert turned_away > 0.008, name


def test_spheres_of_several_frames_are_those_of_each() -> None:
    place = PlaceLight.of(panorama())
    balls = [place.ball(128, pose(n)) for n in range(3)]
    together = sphere_radiance(PAPER_RIG, balls)
    for number, ball in enumerate(balls):
        for name, alone in sphere_radiance(PAPER_RIG, [ball]).items():
            np.testing.assert_allclose(together[name][:, :, number], alone[:, :, 0], rtol=1e-4)


def test_from_another_height_the_ground_moves_and_the_sky_stays() -> None:
    place = PlaceLight.of(panorama())
    low = place.from_height(0.6)
    up = np.array([[0.3, 0.5, -0.8]], np.float32)
    np.testing.assert_array_equal(low.seen(up), place.seen(up))
    # The point of the ground at tan 0.5 is seen at tan 0.3 from 0.6 of the height.
    np.testing.assert_allclose(
        low.seen(np.array([[0.6, -0.3, -0.8]], np.float32)),
        place.seen(np.array([[0.6, -0.5, -0.8]], np.float32)),
        rtol=1e-5,
    )
    ball, ground = low.ball(64, np.eye(3)), place.ball(64, np.eye(3))
    assert abs(ball[:30] - ground[:30])[..., 1].max() < 1e-3 * ground.max()
    assert abs(ball[34:] - ground[34:])[..., 1].max() > 0.01


def test_lamps_on_the_ground_keep_their_radiance_from_another_height() -> None:
    """A wide lamp in the floor: its power changes as the solid angle it is seen under."""
    lamp = np.where((DIRECTIONS @ [0.0, -0.6, -0.8] > 0.99)[..., None], 100.0, 0.1)
    place = PlaceLight.of(np.repeat(lamp, 3, axis=2).astype(np.float32))
    low = place.from_height(0.5)
    seen = low.seen(DIRECTIONS.astype(np.float32))[..., 0] - 0.1
    area = latlong.solid_angles(128, 256)
    assert low.light_power[:, 0].sum() == pytest.approx(float((seen * area).sum()), rel=0.06)
    assert abs(low.light_power.sum() / place.light_power.sum() - 1) > 0.1


# A take


def ideal() -> PhoneSettings:
    return PhoneSettings("ideal", PLAIN)


def test_spheres_are_the_true_lighting_whatever_the_curve() -> None:
    place = PlaceLight.of(panorama(300))
    phone = replace(ideal(), processing=replace(FAMILY[3].processing, local=0.5, contrast=0.5))
    phone = replace(phone, automatics=replace(PLAIN, vignette=0.4, bias_stops=0.5))
    (frame,) = film_many(place, phone, PAPER_RIG, 1, np.random.default_rng(2))
    for name, tolerance in (("diffuse", 0.004), ("matte_silver", 0.006), ("mirror", 0.014)):
        mask = PAPER_RIG.views[name].mask()
        rendered = relight_rig(PAPER_RIG, frame.true_lighting)[name]
        pixel = encode(np.clip(rendered, 0, 1))
        assert abs(pixel - frame.spheres[name] / 255)[mask].mean() < tolerance, name
        flipped = abs(pixel[:, ::-1] - frame.spheres[name] / 255)[mask].mean()
        assert flipped > 2 * tolerance, name


def test_a_frame_knows_its_exposure_white_balance_and_pose() -> None:
    place = PlaceLight.of(panorama(), ev100=12.0)
    warm = replace(ideal(), automatics=replace(PLAIN, adaptation=0.0, tint=(0.3, 0.0, -0.3)))
    (frame,) = film_many(place, warm, PAPER_RIG, 1, np.random.default_rng(5))
    known = frame.known
    np.testing.assert_allclose(known["white_balance"], (0.3, 0, -0.3), atol=1e-4)
    gain = 2 ** known["exposure_stops"] / place.mean_luminance
    assert gain == pytest.approx(np.exp(np.mean(frame.setting.log_gain)), rel=1e-3)
    assert known["ev100"] + known["exposure_stops"] == pytest.approx(12, abs=1e-3)
    assert math.sin(known["pitch_rad"]) == pytest.approx((frame.pose @ VIEW)[1], abs=1e-4)
    level = frame.pose @ [math.cos(known["roll_rad"]), -math.sin(known["roll_rad"]), 0]
    assert level[1] == pytest.approx(0, abs=1e-4)
    assert known["view_fov_rad"] == pytest.approx(math.radians(66), abs=1e-4)


def test_a_brighter_exposure_is_a_brighter_light() -> None:
    place, frames = PlaceLight.of(panorama()), []
    for bias in (0.0, 1.0):
        phone = replace(ideal(), automatics=replace(PLAIN, bias_stops=bias))
        frames += film_many(place, phone, PAPER_RIG, 1, np.random.default_rng(4))
    dark, bright = (f.true_lighting.radiance for f in frames)
    np.testing.assert_allclose(bright, 2 * dark, rtol=1e-4)
    assert isinstance(frames[0].true_lighting, Lighting)
    assert frames[1].background.mean() > frames[0].background.mean() + 10
