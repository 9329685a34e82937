"""What small lamps ask of a composite: no sparks, and a surface that keeps its colour."""

import numpy as np
import pytest

from deeplight.camera_response import LUMINANCE
from deeplight.compose.denoise import without_sparks
from deeplight.compose.surface import ALBEDO_LIMITS, limited


def test_a_lone_bright_pixel_is_dimmed_and_a_reflection_stays():
    radiance = np.full((12, 12, 3), 0.2)
    radiance[3, 3] = 40.0  # a spark
    radiance[7:10, 7:10] = 40.0  # a lamp's reflection
    cleaned = without_sparks(radiance, np.ones((12, 12)))
    assert cleaned[3, 3].max() < 0.3
    np.testing.assert_array_equal(cleaned[7:10, 7:10], radiance[7:10, 7:10])
    untouched = np.ones((12, 12), bool)
    untouched[3, 3] = False
    np.testing.assert_array_equal(cleaned[untouched], radiance[untouched])


def test_a_half_covered_edge_is_no_spark():
    cover = np.ones((8, 8))
    cover[:, 4] = 0.5
    cover[:, 5:] = 0
    radiance = 0.7 * cover[..., None] * np.ones(3)
    np.testing.assert_array_equal(without_sparks(radiance, cover), radiance)


@pytest.mark.parametrize("measured", [[0.2, 0.04, 0.01], [0.01, 0.004, 0.002], [2.0, 1.5, 1.2]])
def test_a_limited_albedo_keeps_its_colour(measured):
    albedo = limited(np.array(measured))
    assert albedo / albedo.sum() == pytest.approx(np.array(measured) / sum(measured))
    low, high = ALBEDO_LIMITS
    assert low - 1e-9 <= albedo @ LUMINANCE <= high + 1e-9
    assert albedo.max() <= high + 1e-9
