"""A view slid down in a photo: it lies in the photo, and its light is turned back."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from deeplight.camera import TRAINED_CAMERA
from deeplight.estimators.look import Answer, agreeing, seen_from_photo
from deeplight.frames import rotation
from deeplight.lamp import Lamp
from deeplight.lighting import Lighting
from deeplight.lobe import lobe_on_ball
from deeplight.mappings import mirror_ball
from deeplight.preprocess import (
    FARTHEST,
    FITS,
    LEAST_SLIDE,
    ROOM,
    Framing,
    frame_photo,
    hull,
    looks,
    network_input,
    slid_into_photo,
)

PITCH = -0.1
LAMP = Lamp(np.array([0.0, 0.6, -0.8]), np.array([3.0, 2.0, 1.0]), 0.1)


def view_at(pitch_rad: float, yaw_rad: float = 0.0) -> Framing:
    """A view slid so that its middle stands there."""
    framing = frame_photo(400, 400, math.radians(60))
    aside = -framing.focal * math.tan(yaw_rad)
    return framing.slid(-math.hypot(framing.focal, aside) * math.tan(pitch_rad), aside)


def seen(light: np.ndarray, lamps: Sequence[Lamp], pitch_rad: float) -> Answer:
    """One answer from such a view."""
    return seen_from_photo([Answer(light, tuple(lamps))], [view_at(pitch_rad)])


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


@given(st.integers(40, 400), st.integers(40, 400), st.floats(8, 140))
def test_two_looks_lie_in_the_photo_as_far_as_one_does(
    height: int, width: int, fov_deg: float
) -> None:
    one = slid_into_photo(frame_photo(height, width, math.radians(fov_deg)))
    views = looks(one)
    for view in views:
        assert view.visible_fraction >= one.visible_fraction - 1e-9
        assert view.bottom - view.top == pytest.approx(one.bottom - one.top)
        assert math.hypot(view.aside, view.down - one.down) <= 1.001 * FARTHEST * one.focal
    shown = hull(views)
    assert shown.used_fraction >= one.used_fraction - 1e-9
    if len(views) == 1:
        assert views == (one,)
        assert height - one.bottom < ROOM * (one.bottom - one.top)


def test_a_photo_with_room_is_looked_at_below_or_at_both_sides() -> None:
    tall, wide = frame_photo(1600, 1200, math.radians(69)), frame_photo(1080, 1920)
    first, second = looks(tall)
    assert first == tall
    assert second.bottom == 1600
    left, right = looks(wide)
    assert left.aside == -right.aside < 0
    assert left.left == pytest.approx(max(0, wide.left - FARTHEST * wide.focal))
    assert looks(frame_photo(192, 135, math.radians(54.3))) == (
        frame_photo(192, 135, math.radians(54.3)),
    )


def test_a_view_is_turned_to_where_it_was_slid() -> None:
    framing = frame_photo(900, 1600, math.radians(50)).slid(120.0, -250.0)
    ahead = framing.photo_from_view @ [0, 0, -1]
    wanted = np.array([-250.0, -120.0, -framing.focal])
    np.testing.assert_allclose(ahead, wanted / np.linalg.norm(wanted), atol=1e-12)


def test_what_is_straight_ahead_of_the_view_is_below_the_axis_of_the_photo() -> None:
    ahead = replace(LAMP, direction=np.array([0.0, 0.0, -1.0]))
    found = seen_from_photo([Answer(sky(), (ahead,), {"pitch_rad": 0.3})], [view_at(PITCH)])
    wanted = [0, math.sin(PITCH), -math.cos(PITCH)]
    np.testing.assert_allclose(found.lamps[0].direction, wanted, atol=1e-12)
    assert found.heads["pitch_rad"] == pytest.approx(0.3 - PITCH)  # the photo looks less far down


def test_no_pitch_changes_nothing() -> None:
    answer = Answer(sky(), (LAMP,), {"pitch_rad": 0.3})
    assert seen_from_photo([answer], [view_at(0.0)]) is answer


def test_there_and_back_is_the_same_light() -> None:
    whole = np.log(np.exp(sky()) + lobe_on_ball(LAMP))
    moved = seen(whole, [LAMP], PITCH)
    again = seen(moved.log_radiance, moved.lamps, -PITCH)
    np.testing.assert_allclose(again.lamps[0].direction, LAMP.direction, atol=1e-12)
    sr = mirror_ball.solid_angles(32)
    off = [
        np.average(np.abs(light - whole).mean(-1), weights=sr)
        for light in (again.log_radiance, moved.log_radiance)
    ]
    assert off[0] < 0.02 < 0.05 < off[1]


def test_power_and_the_lamps_shape_are_kept() -> None:
    whole = np.log(np.exp(sky()) + lobe_on_ball(LAMP))
    found = seen(whole, [LAMP], PITCH)
    turned, (moved,) = found.log_radiance, found.lamps
    before, after = (Lighting.from_log_radiance(light) for light in (whole, turned))
    np.testing.assert_allclose(after.power(), before.power(), rtol=0.01)
    soft = np.exp(turned) - lobe_on_ball(moved)
    assert soft.max() < 1.05 * np.exp(sky()).max()  # nothing of the lamp stays in the map


def test_it_is_the_turned_light_and_not_that_turned_the_other_way() -> None:
    directions, sr = mirror_ball.pixel_directions(32), mirror_ball.solid_angles(32)
    wanted = scene(directions @ rotation("x", PITCH))
    for pitch, is_near in ((PITCH, True), (-PITCH, False)):
        turned = seen(sky(), [], pitch).log_radiance
        assert (np.average(np.abs(turned - wanted).mean(-1), weights=sr) < 0.01) == is_near


def test_two_looks_at_one_light_find_that_light() -> None:
    """Each sees it from its own side; a look at another light does not."""
    directions, sr = mirror_ball.pixel_directions(32), mirror_ball.solid_angles(32)
    views = [view_at(0.02, yaw) for yaw in (-0.2, 0.2)]
    answers = []
    for view in views:
        lamp = LAMP.turned(view.photo_from_view.T)
        soft = np.exp(scene(directions @ view.photo_from_view.T))
        answers.append(Answer(np.log(soft + lobe_on_ball(lamp)), (lamp,), {"fov_rad": 1.0}))
    found = seen_from_photo(answers, views)
    wanted = np.log(np.exp(sky()) + lobe_on_ball(LAMP))
    off = np.average(np.abs(found.log_radiance - wanted).mean(-1), weights=sr)
    swapped = seen_from_photo(answers, views[::-1]).log_radiance
    assert off < 0.02 < 0.05 < np.average(np.abs(swapped - wanted).mean(-1), weights=sr)
    for lamp in found.lamps:
        np.testing.assert_allclose(lamp.direction, LAMP.direction, atol=1e-9)
    np.testing.assert_allclose(sum(lamp.flux for lamp in found.lamps), LAMP.flux)
    assert found.heads == {"fov_rad": 1.0}


def test_lamps_that_agree_take_the_flux_of_one_that_stands_alone_and_none_is_lost() -> None:
    toward = ([0.0, 1.0, 0.0], [0.1, 0.995, 0.0], [0.0, -1.0, 0.0])
    lamps = [replace(LAMP, direction=np.array(d) / np.linalg.norm(d)) for d in toward]
    shared = agreeing(lamps)
    np.testing.assert_allclose(sum(lamp.flux for lamp in shared), 3 * LAMP.flux)
    up = sum(lamp.luminous_flux for lamp in shared if lamp.direction[1] > 0)
    assert up > 2.9 * LAMP.luminous_flux
    apart = [lamps[0], lamps[2]]  # the twin: two that point apart keep theirs
    for lamp in agreeing(apart):
        np.testing.assert_allclose(lamp.flux, LAMP.flux, rtol=1e-6)
    assert agreeing([]) == ()
