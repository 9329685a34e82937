"""Made-up detail: it looks like a place, lies level, and changes no light."""

import subprocess
import sys

import numpy as np
import pytest

from deeplight.camera_response import LUMINANCE
from deeplight.errors import ConfigError
from deeplight.estimators.fill import chosen, detailed, library, smooth_of
from deeplight.estimators.projection import ImagePlane, project_photo
from deeplight.estimators.surroundings import power_of
from deeplight.frames import rotation
from deeplight.mappings import latlong, resample

HEIGHT = 128
UPRIGHT = np.eye(3)
PLANE = ImagePlane.centred(64, 64, 0.7)
PHOTO = project_photo(np.full((64, 64, 3), 128, np.uint8), PLANE, HEIGHT)
TILTED = rotation("x", 0.4)


def smooth_light(direction: np.ndarray) -> np.ndarray:
    """Bright from one side, on a warm ground."""
    towards = latlong.directions(HEIGHT, 2 * HEIGHT)
    level = np.exp(1.2 * towards @ direction) * (1 + 0.5 * towards[..., 1])
    return (level[..., None] * np.array([1.0, 0.95, 0.85])).astype(np.float32)


LIGHT = smooth_light(np.array([0.6, 0.64, -0.48]))


@pytest.mark.parametrize("kind", ["any", "indoor", "outdoor"])
def test_power_and_smooth_light_stay(kind):
    rich, name = detailed(LIGHT, PHOTO, TILTED, kind)
    unseen = 1 - PHOTO.seen[..., None]
    np.testing.assert_allclose(power_of(rich * unseen), power_of(LIGHT * unseen), rtol=2e-3)
    before, after = (resample.shrink(v, 8, 16) for v in (LIGHT, rich))
    assert np.abs(np.log(after / before)).mean() < 0.05
    assert (np.diff(np.log(rich @ LUMINANCE), axis=1)).std() > 5 * (
        np.diff(np.log(LIGHT @ LUMINANCE), axis=1).std()
    )
    (place,) = (place for place in library() if place.name == name)
    assert kind in ("any", place.kind)


def ln_detail(rich: np.ndarray, smooth: np.ndarray, level_from_camera: np.ndarray) -> np.ndarray:
    """What was made up, in a level frame."""
    return resample.turned_latlong(np.log(rich / smooth), level_from_camera)


def test_detail_lies_level_however_the_camera_is_tilted():
    """Of a place whose light is the same, the detail is, too; in the camera's frame it is not."""
    turned_light = resample.turned_latlong(LIGHT, TILTED.T)
    nothing = project_photo(np.zeros((2, 2, 3), np.uint8), ImagePlane.centred(2, 2, 1e-3), HEIGHT)
    level, name = detailed(LIGHT, nothing, UPRIGHT)
    tilted, same = detailed(turned_light, nothing, TILTED)
    assert same == name
    wanted = ln_detail(level, LIGHT, UPRIGHT)
    inner = slice(16, -16)  # at the poles texels are narrow
    apart, left_tilted = (
        np.corrcoef(wanted[inner].ravel(), ln_detail(tilted, turned_light, turn)[inner].ravel())
        for turn in (TILTED, UPRIGHT)
    )
    assert apart[0, 1] > 0.9
    assert left_tilted[0, 1] < 0.5  # the twin


def test_a_place_is_recognised_turned_and_mirrored():
    place = library()[7]
    smooth = np.roll(np.exp(place.smooth), 5, axis=1)[:, ::-1]
    light = smooth.repeat(8, 0).repeat(8, 1).astype(np.float32)
    _, name = detailed(light, PHOTO, UPRIGHT)
    assert name == place.name
    assert np.abs(smooth_of(light) - np.log(smooth)).mean() < 0.6


def test_the_kind_is_the_networks_where_it_is_sure():
    assert chosen("auto", {"indoors": 0.9}) == "indoor"
    assert chosen("auto", {"indoors": 0.1}) == "outdoor"
    assert chosen("auto", {"indoors": 0.6}) == chosen("auto", {}) == "photo"
    assert chosen("outdoor", {"indoors": 0.9}) == "outdoor"
    assert chosen(None, {"indoors": 0.9}) is None


def test_another_fill_is_refused():
    """In a process of its own: here the annotations are checked, which users do not do."""
    code = "import deeplight as d, numpy as n; d.estimate(n.zeros((64, 48, 3), 'u1'), fill='none')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    last = done.stderr.strip().splitlines()[-1]
    assert ConfigError.__name__ in last
    assert "auto, photo, any, indoor, outdoor or None" in last


def test_the_library_is_small_and_its_details_are_ratios_around_one():
    assert len(library()) >= 20
    assert sum(len(place.picture) for place in library()) < 2e6
    for place in library()[:5]:
        detail = place.detail()
        assert detail.shape == (128, 256, 3)
        assert abs(float(detail.mean())) < 0.05
        assert float(detail.std()) > 0.05
