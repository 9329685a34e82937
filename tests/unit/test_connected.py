"""The connected parts of a mask: those that filling from pixel to pixel finds, and soon."""

import numpy as np
import pytest

from deeplight.estimators.lamps import _connected


def filled(mask: np.ndarray) -> np.ndarray:
    """The same by filling each part from its first pixel."""
    labels = np.full(mask.shape, -1)
    for first in np.flatnonzero(mask):
        waiting = [divmod(int(first), mask.shape[1])]
        while waiting:
            row, column = waiting.pop()
            inside = 0 <= row < mask.shape[0] and 0 <= column < mask.shape[1]
            if inside and mask[row, column] and labels[row, column] < 0:
                labels[row, column] = first
                steps = (-1, 0, 1)
                waiting += [(row + down, column + across) for down in steps for across in steps]
    return labels


@pytest.mark.parametrize("part", [0.0, 0.1, 0.3, 0.5, 0.9, 1.0])
@pytest.mark.parametrize("size", [(1, 9), (9, 1), (13, 17), (30, 22)])
def test_parts_are_those_that_filling_finds(part: float, size: tuple[int, int]) -> None:
    mask = np.random.default_rng(size[0]).uniform(size=size) < part
    np.testing.assert_array_equal(_connected(mask), filled(mask))


@pytest.mark.timeout(5)
def test_a_large_mask_of_noise_takes_no_minutes() -> None:
    mask = np.random.default_rng(0).uniform(size=(700, 900)) < 0.5
    assert len(np.unique(_connected(mask))) > 100
