"""The five numbers of a box, and the picture."""

import numpy as np
import pytest

from deeplight.evaluate.figures.box_plots import Box, box_of


def test_a_box_holds_the_middle_half_and_whiskers_end_within_reach() -> None:
    found = box_of(np.array([*range(1, 10), 100.0, np.nan]))
    assert found == Box(1, 3.25, 5.5, 7.75, 9, 1)


def test_a_column_without_numbers_has_no_box() -> None:
    assert box_of(np.full(3, np.nan)) is None
    one = box_of(np.array([2.0]))
    assert one is not None
    assert (one.low, one.median, one.high, one.beyond) == pytest.approx((2, 2, 2, 0))
