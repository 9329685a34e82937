"""Averages over cells: exact to the last bit where sums are, the same for any span of pixels."""

import numpy as np
import pytest

from deeplight.area_means import mean_over_cells, mean_over_squares


@pytest.mark.parametrize("factor", [1, 3, 5, 8, 11])
@pytest.mark.parametrize(("kind", "white"), [(np.uint8, 255), (np.uint16, 65535)])
def test_a_box_filter_by_a_whole_factor_is_rounded_once(
    factor: int, kind: type[np.generic], white: int
) -> None:
    size = (12 * factor, 7 * factor, 3)
    photo = np.random.default_rng(factor).integers(0, white // 256 + 1, size).astype(kind)
    boxes = photo.reshape(12, factor, 7, factor, 3).sum((1, 3), dtype=np.float32)
    exact = boxes / np.float32(factor**2 * white)
    np.testing.assert_array_equal(mean_over_squares(photo, factor), exact)


@pytest.mark.parametrize("cells", [1, 2, 11, 40, 101])
def test_cells_of_any_size_average_to_the_mean_of_the_whole(cells: int) -> None:
    photo = np.random.default_rng(cells).integers(0, 256, (211, 307, 3), dtype=np.uint8)
    means = mean_over_cells(photo, np.linspace(0, 211, 7), np.linspace(0, 307, cells + 1))
    assert means.shape == (6, cells, 3)
    np.testing.assert_allclose(means.mean((0, 1)), photo.mean((0, 1)) / 255, rtol=1e-6)


def test_a_pixel_is_in_its_own_cell_alone() -> None:
    photo = np.zeros((90, 130, 3), np.uint8)
    photo[38, 77] = 60, 120, 180
    means = mean_over_cells(photo, np.linspace(0, 90, 23), np.linspace(0, 130, 32))
    row, column = 38 * 22 // 90, 77 * 31 // 130
    share = np.array([60, 120, 180]) / 255 * (22 * 31) / (90 * 130)
    np.testing.assert_allclose(means[row, column], share, rtol=1e-6)
    means[row, column] = 0
    assert not means.any()
