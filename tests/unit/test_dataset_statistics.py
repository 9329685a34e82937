"""Statistics and contact sheets of a data set."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from deeplight.dataset import (
    DataSet,
    Example,
    ExampleMeta,
    ShardJob,
    open_dataset,
)
from deeplight.dataset.contact_sheet import contact_sheet, spread_over_places, write_contact_sheet
from deeplight.dataset.statistics import BRIGHTNESS_EDGES_STOPS, split_statistics
from deeplight.io.photos import read_photo
from deeplight.sphere import PAPER_RIG, SPHERES
from toy_data import write_toy_data


def examples_of(job: ShardJob) -> Iterator[Example]:
    for number in range(job.count):
        place = "large" if number < 7 else f"small-{number}"
        meta = ExampleMeta(
            place, "take", number, "indoor", "train", "paper", "phone", "CC0", "test"
        )
        sphere = np.full((32, 32, 3), 255, np.uint8)  # corners clip, but are not the sphere
        sphere[PAPER_RIG.views["mirror"].mask()] = 255 if number % 2 else 100
        spheres = dict.fromkeys(SPHERES, sphere) | {"diffuse": np.full_like(sphere, 128)}
        yield Example(f"e-{number}", np.full((192, 135, 3), 51, np.uint8), spheres, meta)


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> DataSet:
    return open_dataset(write_toy_data(tmp_path_factory.mktemp("data"), {"train": 10}, examples_of))


def test_statistics(data: DataSet) -> None:
    found = split_statistics(data, "train")
    assert found.examples == 10
    assert found.mean_pixel == pytest.approx((0.2, 0.2, 0.2), abs=0.01)
    assert found.clipped == {"background": 0, "mirror": 0.5, "matte_silver": 0.5, "diffuse": 0}
    stops = np.log2((128 / 255) ** 2.2 / 0.345)
    at = np.digitize(stops, BRIGHTNESS_EDGES_STOPS) - 1
    assert found.brightness_histogram[at] == 10 == sum(found.brightness_histogram)


def test_statistics_of_a_sample(data: DataSet) -> None:
    assert split_statistics(data, "train", at_most=4).examples == 4


@pytest.mark.parametrize(("count", "places"), [(2, 2), (4, 4), (6, 4), (10, 4), (99, 4)])
def test_a_choice_is_spread_over_the_places(data: DataSet, count: int, places: int) -> None:
    index = data.index("train")
    chosen = spread_over_places(index, count)
    assert len(chosen) == len(set(chosen)) == min(count, 10)
    assert len(set(index.places[chosen])) == places


def test_the_contact_sheet(data: DataSet, tmp_path: Path) -> None:
    pixels = read_photo(write_contact_sheet(data, tmp_path / "sheet.png", count=10)).pixels
    assert pixels.shape == (2 * (192 + 45 + 13) + 6, 8 * 135 + 7 * 6, 3)
    assert (pixels[10, 10] == 51).all()  # a background
    np.testing.assert_array_equal(contact_sheet(list(data.examples("train"))), pixels)
