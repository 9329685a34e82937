"""Which photos show floor, and what is counted of them."""

from dataclasses import replace

import numpy as np
import pytest

from deeplight.camera import PinholeCamera
from deeplight.compose.ground import Viewpoint
from lab.evidence.floor_accuracy import FREE, REFUSED, WARNED, Filmed, Found, said_at, table

CAMERA = PinholeCamera(40, 30, float(np.radians(53)))
LEVEL = Viewpoint(CAMERA, pitch_rad=0.0)


@pytest.mark.parametrize(
    ("pitch_deg", "floor", "none"),
    [(-35, True, False), (-10, True, False), (10, False, False), (35, False, True)],
)
def test_a_photo_shows_floor_by_its_true_pitch(pitch_deg, floor, none):
    view = replace(LEVEL, pitch_rad=float(np.radians(pitch_deg)))
    photo = Filmed(np.zeros((30, 40, 3), np.uint8), view)
    assert (photo.shows_floor, photo.shows_none) == (floor, none)


def test_places_are_refused_above_and_doubted_near_the_horizon():
    unsure = replace(LEVEL, doubt_rad=float(np.radians(10)))
    assert [said_at(unsure, 20, row) for row in (5, 17, 28)] == [REFUSED, WARNED, FREE]


def test_the_table_counts_each_photo_once():
    below = {"on floor": 0.5, "doubtful": 0.15, "on none": -0.2}
    rows = [Found(True, FREE, rad, {True: FREE, False: REFUSED}, 8, 0.1) for rad in below.values()]
    rows += [Found(False, WARNED, 0.5, {}, 0, 0.0), Found(None, REFUSED, np.nan, {}, 15, 0.0)]
    rows += [Found(True, WARNED, 0.5, {}, roll, 0.0) for roll in (0, 15)]
    lines = list(table(rows))
    assert "| that show floor (5) | 1 / 1 / 1 | 2 | 0 |" in lines
    assert "| that show none (1) | 0 / 0 / 0 | 1 | 0 |" in lines
    assert "| that show hardly any (1) | 0 / 0 / 0 | 0 | 1 |" in lines
    assert "| `--at` a place that is floor (3) | 3 | 0 | 0 |" in lines
    assert "| `--at` a place that is none (3) | 0 | 0 | 3 |" in lines
    assert "roll 8: off by 5.7 degrees, by less than 5: 0%" in lines
