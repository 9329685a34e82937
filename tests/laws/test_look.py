"""A view slid down in a photo: it lies in the photo, and its light is turned back."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deeplight.camera import TRAINED_CAMERA
from deeplight.estimators.look import seen_from_photo
from deeplight.frames import rotation
from deeplight.lamp import Lamp
from deeplight.lighting import Lighting
from deeplight.lobe import lobe_on_ball
from deeplight.mappings import mirror_ball
from deeplight.preprocess import (
    FITS,
    LEAST_SLIDE,
    frame_photo,
    network_input,
    slid_into_photo,
)

PITCH = -0.1
LAMP = Lamp(np.array([0.0, 0.6, -0.8]), np.array([3.0, 2.0, 1.0]), 0.1)


def scene(directions: np.ndarray) -> np.ndarray:
    """ln radiance of a smooth scene, bright above and to the right."""
    grey = 0.8 * directions[..., 1:2] + 0.4 * directions[..., :1]
    return np.repeat(grey, 3, -1).astype(np.float32)


def sky() -> np.ndarray:
    """The same on a mirror ball."""
    return scene(mirror_ball.pixel_directions(32))


@given(st.integers(40, 400), st.integers(40, 400), st.floats(8, 140))
def test_a_view_that_has_room_in_the_photo_does_not_overhang_it_above_alone(
    height: int, width: int, fov_deg: float
) -> None:
    centred = frame_photo(height, width, math.radians(fov_deg))
    slid = slid_into_photo(centred)
    if centred.bottom - centred.top > FITS * height:
        assert slid == centred
    else:
        assert min(-slid.top, height - slid.bottom) <= 2 * LEAST_SLIDE * height
    assert slid.visible_fraction >= centred.visible_fraction - 1e-12
    assert slid.bottom - slid.top == pytest.approx(centred.bottom - centred.top)
    assert slid_into_photo(slid) == slid


def test_the_trained_frame_and_taller_ones_stay_where_they_are() -> None:
    for framing in (frame_photo(1920, 1080), frame_photo(1600, 1200, math.radians(69))):
        assert slid_into_photo(framing) == framing
        assert framing.pitch_rad == 0
    assert slid_into_photo(frame_photo(1200, 1600, math.radians(54))).down > 0


def test_a_slid_view_shows_the_trained_rays_from_further_down() -> None:
    height, width, half = 900, 1200, math.tan(math.radians(28))
    y = half * (1 - (np.arange(height) + 0.5) * 2 / height)
    photo = np.full((height, width, 3), 0.5, np.float32)
    photo[..., 1] = (y / 4 + 0.5)[:, None]
    framing = slid_into_photo(frame_photo(height, width, math.radians(56)))
    seen = network_input(photo, framing)[1] * 4
    rays = replace(TRAINED_CAMERA, width=135, height=240).rays()[:192]
    wanted = rays[..., 1] / -rays[..., 2] + math.tan(framing.pitch_rad)
    np.testing.assert_allclose(seen, wanted, atol=4e-3)
    assert -7 < math.degrees(framing.pitch_rad) < -6


def test_what_is_straight_ahead_of_the_view_is_below_the_axis_of_the_photo() -> None:
    ahead = replace(LAMP, direction=np.array([0.0, 0.0, -1.0]))
    _, (moved,), heads = seen_from_photo(sky(), [ahead], {"pitch_rad": 0.3}, PITCH)
    wanted = [0, math.sin(PITCH), -math.cos(PITCH)]
    np.testing.assert_allclose(moved.direction, wanted, atol=1e-12)
    assert heads["pitch_rad"] == pytest.approx(0.3 - PITCH)  # the photo looks less far down


def test_no_pitch_changes_nothing() -> None:
    light, lamps, heads = seen_from_photo(sky(), [LAMP], {"pitch_rad": 0.3}, 0.0)
    np.testing.assert_array_equal(light, sky())
    assert lamps == (LAMP,)
    assert heads == {"pitch_rad": 0.3}


def test_there_and_back_is_the_same_light() -> None:
    whole = np.log(np.exp(sky()) + lobe_on_ball(LAMP))
    away, moved, _ = seen_from_photo(whole, [LAMP], {}, PITCH)
    back, again, _ = seen_from_photo(away, moved, {}, -PITCH)
    np.testing.assert_allclose(again[0].direction, LAMP.direction, atol=1e-12)
    sr = mirror_ball.solid_angles(32)
    off = [np.average(np.abs(light - whole).mean(-1), weights=sr) for light in (back, away)]
    assert off[0] < 0.02 < 0.05 < off[1]


def test_power_and_the_lamps_shape_are_kept() -> None:
    whole = np.log(np.exp(sky()) + lobe_on_ball(LAMP))
    turned, (moved,), _ = seen_from_photo(whole, [LAMP], {}, PITCH)
    before, after = (Lighting.from_log_radiance(light) for light in (whole, turned))
    np.testing.assert_allclose(after.power(), before.power(), rtol=0.01)
    soft = np.exp(turned) - lobe_on_ball(moved)
    assert soft.max() < 1.05 * np.exp(sky()).max()  # nothing of the lamp stays in the map


def test_it_is_the_turned_light_and_not_that_turned_the_other_way() -> None:
    directions, sr = mirror_ball.pixel_directions(32), mirror_ball.solid_angles(32)
    wanted = scene(directions @ rotation("x", PITCH))
    for pitch, is_near in ((PITCH, True), (-PITCH, False)):
        turned, _, _ = seen_from_photo(sky(), [], {}, pitch)
        assert (np.average(np.abs(turned - wanted).mean(-1), weights=sr) < 0.01) == is_near
