"""The sky that Hold-Geoffroy 2017 fits: made-up ones come back."""

import numpy as np
import pytest

from deeplight.camera_response import LUMINANCE
from deeplight.evaluate.rivals.sky import Sky, brightest_region, fitted_sky, sky_radiance
from deeplight.mappings import latlong
from made_up_places import towards

pytestmark = pytest.mark.needs("scipy")


@pytest.mark.parametrize("turbidity", [2.0, 4.0, 8.0])
@pytest.mark.parametrize(("elevation", "azimuth"), [(20, -100), (45, 30), (70, 179)])
def test_a_made_up_sky_comes_back(elevation: float, azimuth: float, turbidity: float) -> None:
    sun = towards(elevation, azimuth)
    found = fitted_sky(Sky(sun, turbidity, 2.5).panorama(64))
    assert np.degrees(np.arccos(found.sun @ sun)) < 3
    assert found.turbidity == pytest.approx(turbidity, abs=0.5)
    assert found.scale == pytest.approx(2.5, rel=0.1)


def test_houses_in_front_of_the_sky_do_not_matter_much() -> None:
    sun = towards(50, 60)
    panorama = Sky(sun, 3.0, 1.0).panorama(64)
    panorama[20:34, :40] = [0.02, 0.015, 0.01]
    found = fitted_sky(panorama)
    assert found.turbidity == pytest.approx(3, abs=0.7)
    assert np.degrees(np.arccos(found.sun @ sun)) < 3


def test_the_sky_is_blue_opposite_the_sun_and_brightest_next_to_it() -> None:
    sun = towards(40, 0)
    near, opposite = sky_radiance(np.stack([towards(45, 5), towards(45, 180)]), sun, 2.5)
    assert opposite[2] > 1.3 * opposite[0]
    assert near @ LUMINANCE > 3 * (opposite @ LUMINANCE)
    hazy = sky_radiance(towards(45, 180)[None], sun, 9.0)[0]
    assert hazy[2] / hazy[0] < opposite[2] / opposite[0]


def test_the_suns_power_does_not_depend_on_the_panoramas_size() -> None:
    powers = []
    for height in (32, 64, 128):
        panorama = Sky(towards(40, 13), 3.0).panorama(height)
        powers.append(np.einsum("ij,ijc->c", latlong.solid_angles(height, 2 * height), panorama))
    np.testing.assert_allclose(powers[0], powers[2], rtol=0.02)
    np.testing.assert_allclose(powers[1], powers[2], rtol=0.02)


def test_a_region_behind_the_camera_is_one() -> None:
    panorama = np.full((64, 128, 3), 0.1)
    panorama[18:22, :3] = panorama[18:22, -3:] = 5.0
    panorama[18:22, 40:45] = 5.0  # 5 columns against 6 around the back
    assert brightest_region(panorama) @ towards(33.75, 180) > 0.99
