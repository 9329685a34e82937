"""Made-up detail: it looks like a place and changes no light."""

import subprocess
import sys

import numpy as np
import pytest

from deeplight.camera_response import LUMINANCE
from deeplight.estimators.fill import filled, library, smooth_of
from deeplight.estimators.surroundings import power_of
from deeplight.mappings import latlong, resample

HEIGHT = 64


def smooth_light(direction: np.ndarray) -> np.ndarray:
    """Bright from one side, on a warm ground."""
    towards = latlong.directions(HEIGHT, 2 * HEIGHT)
    level = np.exp(1.2 * towards @ direction) * (1 + 0.5 * towards[..., 1])
    return (level[..., None] * np.array([1.0, 0.95, 0.85])).astype(np.float32)


NOTHING = np.zeros((HEIGHT, 2 * HEIGHT), np.float32)


@pytest.mark.parametrize("kind", ["any", "indoor", "outdoor"])
def test_power_and_smooth_light_stay(kind):
    light = smooth_light(np.array([0.6, 0.64, -0.48]))
    rich, name = filled(light, NOTHING, kind)
    np.testing.assert_allclose(power_of(rich), power_of(light), rtol=1e-4)
    before, after = (resample.shrink(v, 8, 16) for v in (light, rich))
    assert np.abs(np.log(after / before)).mean() < 0.05
    assert (np.diff(np.log(rich @ LUMINANCE), axis=1)).std() > 5 * (
        np.diff(np.log(light @ LUMINANCE), axis=1).std()
    )
    (place,) = (place for place in library() if place.name == name)
    assert kind in ("any", place.kind)


def test_a_place_is_recognised_turned_and_mirrored():
    place = library()[7]
    smooth = np.roll(np.exp(place.smooth), 5, axis=1)[:, ::-1]
    light = smooth.repeat(4, 0).repeat(4, 1).astype(np.float32)
    _, name = filled(light, NOTHING)
    assert name == place.name
    assert np.abs(smooth_of(light) - np.log(smooth)).mean() < 0.6


def test_another_fill_is_refused():
    """In a process of its own: here the annotations are checked, which users do not do."""
    code = "import deeplight as d, numpy as n; d.estimate(n.zeros((64, 48, 3), 'u1'), fill='none')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    last = done.stderr.strip().splitlines()[-1]
    assert "ConfigError" in last
    assert "photo, any, indoor, outdoor or None" in last


def test_the_library_is_small_and_its_details_are_ratios_around_one():
    assert len(library()) >= 20
    assert sum(len(place.picture) for place in library()) < 2e6
    for place in library()[:5]:
        detail = place.detail()
        assert detail.shape == (128, 256, 3)
        assert abs(float(detail.mean())) < 0.05
        assert float(detail.std()) > 0.05
