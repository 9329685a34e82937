"""Transfer against Mitsuba's path tracer: the same mesh in the same light on the same ground."""

import numpy as np
import pytest

from deeplight import frames, harmonics
from deeplight.compose import shapes
from deeplight.compose.mesh import Mesh
from deeplight.lighting import Lighting
from deeplight.mappings import latlong
from deeplight.transfer.ground import open_plane
from deeplight.transfer.precompute import Transfer, TransferSettings, precompute
from deeplight.transfer.reference import path_traced
from deeplight.transfer.view import Eye, view

pytestmark = pytest.mark.needs("mitsuba", "embreex")


# Of the two, per pixel: the largest bias of the object as a share of its mean, the largest RMS
# difference of the object and of the shadow. Mitsuba's own noise is in both.
QUICK = (40, 32, {"diffuse": (0.03, 0.15, 0.15), "glossy": (0.04, 0.18, 0.15)})
THOROUGH = (80, 768, {"diffuse": (0.01, 0.04, 0.03), "glossy": (0.03, 0.09, 0.06)})


@pytest.fixture(scope="module")
def light() -> np.ndarray:
    """Harmonics of a blurred sun in a blue sky."""
    directions = latlong.directions(64, 128).astype(float)
    sun = frames.normalised(np.array([0.5, 0.7, 0.5]))
    sky = np.array([0.4, 0.5, 0.7]) * np.clip(0.6 + directions[..., 1:2], 0.1, 1)
    glow = np.array([12, 11, 9]) * np.exp(40 * (directions @ sun - 1))[..., None]
    lighting = Lighting.from_latlong((sky + glow).astype(np.float32))
    return harmonics.spherical_harmonics(lighting, 4).astype(float)


@pytest.fixture(scope="module")
def bunny() -> Transfer:
    return precompute([Mesh(*shapes.bunny(24))], TransferSettings(samples=128, longest_edge=1.0))[0]


def eroded(mask: np.ndarray) -> np.ndarray:
    """Without the pixels along its edge."""
    for axis in (0, 1):
        mask = mask & np.roll(mask, 1, axis) & np.roll(mask, -1, axis)
    return mask


def differences(
    transfer: Transfer, light: np.ndarray, finish: str, size: int, samples: int
) -> tuple[float, float, float]:
    eye = Eye((0.9, 0.9, 2.2), (0, 0.38, 0), float(np.radians(28)), size, size)
    seen = view(transfer, light, finish, eye)
    want = path_traced(transfer, light, finish, eye, samples)
    solid, plane = eroded(seen.cover), eroded(~seen.cover)
    scale = want[solid].mean()
    error = (seen.radiance - want)[solid]
    open_light = 0.3 * open_plane(4) @ light
    plane &= np.abs(seen.shadow - 1).max(-1) > 0.02
    shadow = seen.shadow[plane] - (want / open_light)[plane]
    rms = [float(np.sqrt((values**2).mean())) for values in (error / scale, shadow)]
    return float(abs(error.mean()) / scale), rms[0], rms[1]


@pytest.mark.parametrize("finish", ["diffuse", "glossy"])
def test_pixels_are_the_path_tracers(bunny: Transfer, light: np.ndarray, finish: str) -> None:
    size, samples, limits = QUICK
    found = differences(bunny, light, finish, size, samples)
    assert (np.array(found) < limits[finish]).all(), found


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_pixels_of_a_finer_bunny_are_nearer(light: np.ndarray) -> None:
    size, samples, limits = THOROUGH
    settings = TransferSettings(samples=512, bounces=3, longest_edge=1.0)
    bunny = precompute([Mesh(*shapes.bunny(40))], settings)[0]
    for finish in ("diffuse", "glossy"):
        found = differences(bunny, light, finish, size, samples)
        assert (np.array(found) < limits[finish]).all(), found


def test_without_bounces_or_in_other_light_they_are_not(bunny: Transfer, light: np.ndarray) -> None:
    size, samples, limits = QUICK
    dark = precompute(
        [Mesh(*shapes.bunny(24))],
        TransferSettings(samples=64, bounces=0, glossy=None, longest_edge=1.0),
    )[0]
    assert differences(dark, light, "diffuse", size, samples)[0] > 2 * limits["diffuse"][0]
    turned = harmonics.turning(frames.rotation("y", np.pi), 4) @ light
    eye = Eye((0.9, 0.9, 2.2), (0, 0.38, 0), float(np.radians(28)), size, size)
    seen = view(bunny, turned, "diffuse", eye)
    want = path_traced(bunny, light, "diffuse", eye, samples)
    error = (seen.radiance - want)[eroded(seen.cover)]
    assert np.sqrt((error**2).mean()) / want[eroded(seen.cover)].mean() > limits["diffuse"][1]
