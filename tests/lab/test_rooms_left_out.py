"""Rooms left out: no room is learnt from and measured, and every room is measured once."""

from pathlib import Path

import numpy as np

from deeplight.simulate.panorama import Place
from lab.evidence.rooms_left_out import parts_of, set_aside, unit_of

NAMES = [*(f"hall_{n}" for n in range(23)), "brown_a", "brown_b", "studio_small_a"]


def room(name: str, split: str) -> Place:
    return Place(Path(name), name, "indoor", split, "CC0", synthetic_ground=False)


ROOMS = [
    *(room(name, "train") for name in [*NAMES, "brown_b"]),
    *(room(f"attic_{n}", "val") for n in range(5)),
    *(room(f"cave_{n}", "test") for n in range(7)),
]
UNITS = np.array([unit_of(place) for place in ROOMS])


def test_units_are_left_out_whole_and_every_split_is_spread_over_the_parts() -> None:
    parts = parts_of(ROOMS, 5)
    for unit in np.unique(UNITS):
        assert len(np.unique(parts[unit == UNITS])) == 1
    assert len(np.unique(parts[np.char.startswith(UNITS, "brown")])) == 1
    for split in ("train", "val", "test"):
        units = {(parts[n], UNITS[n]) for n, place in enumerate(ROOMS) if place.split == split}
        counts = np.bincount([part for part, _ in units], minlength=5)
        assert counts.max() - counts.min() <= 1
    np.testing.assert_array_equal(parts_of(ROOMS, 5), parts)


def test_rooms_that_choose_the_step_are_whole_units_of_the_training() -> None:
    for seed in range(5):
        aside = set_aside(UNITS, 4, seed)
        assert len(np.unique(UNITS[aside])) == 4
        assert not set(UNITS[aside]) & set(UNITS[~aside])
