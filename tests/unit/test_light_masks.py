"""Lights that are found: what counts as one, and what an answer's brightest part holds of them."""

import numpy as np
import pytest

from deeplight.mappings import latlong
from lab.evidence.light_masks import another_place, found, lights_of

SOLID = latlong.solid_angles(32, 64)


def room(seed: int = 0) -> np.ndarray:
    light = np.random.default_rng(seed).uniform(0.1, 0.4, (32, 64))
    light[6:9, 20:24] = 60.0
    return light


def test_lights_are_brightest_and_hold_half_the_power() -> None:
    light = room()
    mask = lights_of(light)
    power = light * SOLID
    assert light[mask].min() >= light[~mask].max()
    assert power[mask].sum() >= power.sum() / 2
    without_the_faintest = power[mask].sum() - power[mask & (light == light[mask].min())].sum()
    assert without_the_faintest < power.sum() / 2
    np.testing.assert_array_equal(lights_of(7 * light), mask)


def test_the_true_light_finds_all_and_the_darkest_finds_none() -> None:
    light = room()
    mask = lights_of(light)
    assert found(light, mask) == pytest.approx((1.0, 1.0))
    assert found(3 * light + 1, mask) == pytest.approx((1.0, 1.0))
    recall, precision = found(-light, mask)
    assert recall == 0
    assert precision < 0.05


def test_an_answer_of_noise_finds_the_lights_part_of_the_sphere() -> None:
    mask = lights_of(np.random.default_rng(1).uniform(0, 1, (32, 64)))
    share = (SOLID * mask).sum() / SOLID.sum()
    answers = [np.random.default_rng(seed).uniform(size=(32, 64)) for seed in range(2, 22)]
    recalls, precisions = np.array([found(answer, mask) for answer in answers]).T
    assert recalls.mean() == pytest.approx(share, abs=0.02)
    assert precisions.mean() == pytest.approx(share, abs=0.02)


def test_chance_is_another_places_answer() -> None:
    names = np.repeat(["a", "b", "c"], 4)
    assert (names[another_place(names)] != names).all()
