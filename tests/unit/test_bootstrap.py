"""The intervals: what they cover, and that they resample places."""

import numpy as np
import pytest

from deeplight.evaluate.bootstrap import PlaceBootstrap


def test_they_cover_the_truth_about_as_often_as_they_say() -> None:
    """30 places of 8 alike frames: 95 % intervals of places cover, those of frames would not."""
    random = np.random.default_rng(0)
    places = np.repeat(np.arange(30), 8)
    covered = alone = 0
    for _ in range(120):
        values = random.normal(0, 1, 30)[places] + random.normal(0, 0.1, 240)
        covered += 0 in PlaceBootstrap(places, 300).mean(values)
        alone += 0 in PlaceBootstrap(np.arange(240), 300).mean(values)
    assert covered >= 105
    assert alone < 80  # the twin: by frame


def test_the_same_seed_gives_the_same_interval() -> None:
    places, values = np.arange(40) % 7, np.random.default_rng(2).normal(size=40)
    assert PlaceBootstrap(places, 200).mean(values) == PlaceBootstrap(places, 200).mean(values)
    assert PlaceBootstrap(places, 200, seed=1).mean(values) != PlaceBootstrap(places, 200).mean(
        values
    )


def test_a_median_resamples_places_too() -> None:
    places = np.repeat(np.arange(5), 20)
    found = PlaceBootstrap(places, 500).median(places.astype(float))
    assert (found.value, found.low, found.high) == (2, 0, 4) or (found.low, found.high) == (1, 3)


def test_one_place_has_a_number_and_no_interval() -> None:
    values = np.random.default_rng(0).normal(size=100)
    one = PlaceBootstrap(np.zeros(100), 500)
    for found in (one.mean(values), one.median(values), one.ratio(values, values + 5)):
        assert np.isfinite(found.value)
        assert found.of_one_place
    two = PlaceBootstrap(np.arange(100) % 2, 500)
    assert not two.mean(values).of_one_place
    # The other place has no value: as good as one place.
    assert two.mean(np.where(np.arange(100) % 2, values, np.nan)).of_one_place
    assert not one.mean(np.full(100, np.nan)).of_one_place  # there is nothing at all


def test_values_without_a_number_are_left_out() -> None:
    places, values = np.arange(12) % 4, np.arange(12.0)
    holes = np.where(places == 1, np.nan, values)
    assert PlaceBootstrap(places, 100).mean(holes).value == pytest.approx(np.nanmean(holes))
    assert PlaceBootstrap(places, 100).median(holes).value == pytest.approx(np.nanmedian(holes))
    assert np.isnan(PlaceBootstrap(places, 100).median(np.full(12, np.nan)).value)
