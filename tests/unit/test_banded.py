"""A matrix in bands gives what the whole one gives, and no product of its wakes a thread."""

import numpy as np
import pytest

from deeplight.banded import BLAS_ALONE, bands, together
from deeplight.estimators.surroundings import enlarged


def moving_mean(length: int, reach: int, several: int) -> tuple[np.ndarray, object]:
    """The mean of `reach` pixels from each on, whole and in bands."""
    first = np.arange(length - reach + 1)
    whole = np.zeros((length, len(first)), np.float32)
    for column in first:
        whole[column : column + reach, column] = 1 / reach

    def weight(pixel: np.ndarray, result: np.ndarray) -> np.ndarray:
        return ((pixel >= result) & (pixel < result + reach)) / reach

    return whole, bands(first, first + reach - 1, length, weight, several)


@pytest.mark.parametrize("reach", [1, 4, 29])
@pytest.mark.parametrize("several", [1, 5, 64])
def test_bands_give_what_the_whole_matrix_gives(reach: int, several: int) -> None:
    whole, mixing = moving_mean(30, reach, several)
    lines = np.random.default_rng(reach).uniform(size=(7, 30, 3)).astype(np.float32)
    wanted = np.einsum("lpc,pr->lrc", lines, whole)
    along = mixing.for_channels(3).along_lines(lines.reshape(7, -1))
    np.testing.assert_allclose(along.reshape(wanted.shape), wanted, atol=1e-6)
    columns = np.ascontiguousarray(lines.swapaxes(0, 1)).reshape(30, -1)
    across = mixing.across_lines(columns)
    np.testing.assert_allclose(across.reshape(-1, 7, 3).swapaxes(0, 1), wanted, atol=1e-6)


@pytest.mark.parametrize(("pixels", "others"), [(0.4, 2304), (5.0, 1700), (22.0, 2000)])
def test_a_part_is_small_enough_for_one_thread(pixels: float, others: int) -> None:
    several = together(pixels, others, 16)
    assert several > 1
    assert several * (several * pixels + 2) * others <= BLAS_ALONE


@pytest.mark.parametrize(("rows", "height"), [(24, 64), (48, 50), (96, 256)])
def test_a_panorama_is_enlarged_between_its_texels_and_around_the_back(
    rows: int, height: int
) -> None:
    small = np.random.default_rng(rows).uniform(size=(rows, 2 * rows, 3)).astype(np.float32)
    down = (np.arange(height) + 0.5) * rows / height - 0.5
    along = (np.arange(2 * height) + 0.5) * rows / height - 0.5
    wanted = np.empty((height, 2 * height, 3))
    for channel in range(3):
        columns = [np.interp(down, np.arange(rows), line) for line in small[..., channel].T]
        lines = np.array(columns).T
        wanted[..., channel] = [
            np.interp(along, np.arange(2 * rows), line, period=2 * rows) for line in lines
        ]
    np.testing.assert_allclose(enlarged(small, height), wanted, atol=1e-5)
    np.testing.assert_allclose(enlarged(small, height, slice(5, 20)), wanted[5:20], atol=1e-5)
