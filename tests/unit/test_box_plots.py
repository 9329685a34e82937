"""The five numbers of a box, and the picture."""

import numpy as np
import pytest

from deeplight.evaluate.figures.box_plots import Box, box_of
from deeplight.evaluate.figures.spheres import title_lines


def test_a_box_holds_the_middle_half_and_whiskers_end_within_reach() -> None:
    found = box_of(np.array([*range(1, 10), 100.0, np.nan]))
    assert found == Box(1, 3.25, 5.5, 7.75, 9, 1)


def test_a_column_without_numbers_has_no_box() -> None:
    assert box_of(np.full(3, np.nan)) is None
    one = box_of(np.array([2.0]))
    assert one is not None
    assert (one.low, one.median, one.high, one.beyond) == pytest.approx((2, 2, 2, 0))


def test_a_long_name_is_broken_where_both_lines_fit() -> None:
    """Under a group of boxes there is room for 15 letters."""
    assert title_lines("hold_geoffroy_2017_paper") == ("hold geoffroy", "2017 paper")
    assert title_lines("landscape") == ("landscape", "")
    for name in ("gardner_2017_paper", "fuse_opposite_views", "nearest_neighbour"):
        lines = title_lines(name)
        assert " ".join(lines).strip() == name.replace("_", " ")
        assert max(map(len, lines)) <= 15
