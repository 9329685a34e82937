"""Edits of light: linear, energy kept, turns compose, and nothing changes for nothing."""

import numpy as np
import pytest

from deeplight import frames
from deeplight.camera_response import LUMINANCE
from deeplight.edit import Edit, direction_of, edited, edited_latlong, with_neutral
from deeplight.errors import ConfigError
from deeplight.harmonics import dominant_light_of_latlong
from deeplight.lighting import Lighting
from deeplight.mappings import latlong
from deeplight.mappings.resample import turned_latlong as turned

HEIGHT = 128
DIRECTIONS = latlong.directions(HEIGHT, 2 * HEIGHT)
TO_LAMP = direction_of(40, 30)


@pytest.fixture(scope="module")
def room() -> np.ndarray:
    """Soft light that is bluer from above, and a warm lamp of 4 degrees."""
    soft = 0.3 + 0.2 * DIRECTIONS[..., 1:2] * np.array([0.7, 0.9, 1.0])
    lamp = (np.cos(np.radians(4)) < DIRECTIONS @ TO_LAMP)[..., None] * np.array([80.0, 70, 50])
    return (soft + lamp).astype(np.float32)


def power(radiance: np.ndarray) -> np.ndarray:
    return np.einsum("ij,ijc->c", latlong.solid_angles(*radiance.shape[:2]), radiance)


def test_an_edit_of_nothing_changes_nothing(room) -> None:
    np.testing.assert_array_equal(edited_latlong(room, Edit()), room)
    lighting = Lighting.from_latlong(room)
    assert edited(lighting, Edit()) is lighting


LINEAR = [Edit(tint=(1, 0.5, 2)), Edit(stops=-1.5), Edit(turn=(20, 10, 5)), Edit(neutral=0.4)]


@pytest.mark.parametrize("edit", LINEAR)
def test_edits_are_linear(edit, room) -> None:
    other = room[::-1, ::-1].copy()
    summed = edited_latlong(room + 3 * other, edit)
    apart = edited_latlong(room, edit) + 3 * edited_latlong(other, edit)
    np.testing.assert_allclose(summed, apart, rtol=2e-4, atol=1e-3)


@pytest.mark.parametrize("factor", [0.0, 0.5, 3.0])
def test_the_main_light_alone_is_scaled(factor, room) -> None:
    light, excess = dominant_light_of_latlong(room)
    dimmed = edited_latlong(room, Edit(main_light=factor))
    np.testing.assert_allclose(dimmed, room + (factor - 1) * excess, atol=1e-3)
    np.testing.assert_allclose(power(dimmed), power(room) + (factor - 1) * power(excess), rtol=1e-4)
    assert light.direction @ TO_LAMP > 0.999


@pytest.mark.parametrize("to", [(-100, 10), (0, 80), (-140, -30)])
def test_a_moved_main_light_keeps_its_power_and_stands_where_it_was_sent(to, room) -> None:
    moved = edited_latlong(room, Edit(main_light_to=to))
    np.testing.assert_allclose(power(moved), power(room), rtol=0.01)
    light, _ = dominant_light_of_latlong(moved)
    assert light.direction @ direction_of(*to) > np.cos(np.radians(3))


def test_turns_compose(room) -> None:
    first, second = Edit(turn=(30, 20, 0)), Edit(turn=(-50, 5, 15))
    twice = turned(turned(room, first.new_from_old), second.new_from_old)
    once = turned(room, second.new_from_old @ first.new_from_old)
    one, other = (dominant_light_of_latlong(radiance)[0] for radiance in (twice, once))
    assert one.direction @ other.direction > np.cos(np.radians(0.5))
    np.testing.assert_allclose(one.irradiance, other.irradiance, rtol=0.02)
    np.testing.assert_allclose(power(twice), power(once), rtol=0.005)


@pytest.mark.parametrize("turn", [(90, 0, 0), (37, 0, 0), (0, 25, 0), (10, -40, 70)])
def test_a_turn_keeps_power_and_takes_the_light_along(turn, room) -> None:
    edit = Edit(turn=turn)
    result = edited_latlong(room, edit)
    np.testing.assert_allclose(power(result), power(room), rtol=0.01)
    light, _ = dominant_light_of_latlong(result)
    assert light.direction @ (edit.new_from_old @ TO_LAMP) > np.cos(np.radians(1))


def test_a_whole_turn_by_columns_resamples_nothing(room) -> None:
    quarter = edited_latlong(room, Edit(turn=(90, 0, 0)))
    np.testing.assert_array_equal(np.sort(quarter, axis=1), np.sort(room, axis=1))
    np.testing.assert_array_equal(turned(quarter, frames.rotation("y", -np.pi / 2)), room)


def test_positive_yaw_moves_light_in_front_to_the_left_and_pitch_raises_it() -> None:
    ahead = Edit(turn=(30, 0, 0)).new_from_old @ frames.VIEW
    assert ahead[0] < 0
    raised = Edit(turn=(0, 30, 0)).new_from_old @ frames.VIEW
    assert raised[1] > 0


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_neutral_keeps_the_luminous_power(share, room) -> None:
    mixed = with_neutral(room, share)
    assert power(mixed) @ LUMINANCE == pytest.approx(power(room) @ LUMINANCE, rel=1e-3)
    if share == 1:
        assert np.ptp(mixed) < 1e-5


def test_stops_and_tint_are_factors(room) -> None:
    brighter = edited_latlong(room, Edit(stops=2, tint=(1, 0.5, 0)))
    np.testing.assert_allclose(brighter, room * [4, 2, 0], rtol=1e-6)


WRONG = [
    ({"main_light": -1.0}, "main light"),
    ({"neutral": 1.5}, "neutral"),
    ({"tint": (1.0, -0.1, 1.0)}, "tint"),
    ({"stops": float("nan")}, "finite"),
    ({"stops": 99.0}, "stops"),
    ({"main_light_to": (0.0, 100.0)}, "elevation"),
]


@pytest.mark.parametrize(("values", "said"), WRONG)
def test_impossible_edits_are_refused(values, said) -> None:
    with pytest.raises(ConfigError, match=said):
        Edit(**values)
