"""The three-sphere protocol: as published it is blind to much, corrected it is not."""

from itertools import product

import numpy as np
import pytest

from deeplight.evaluate.protocols.stylelight_2022 import (
    AS_PUBLISHED,
    CORRECTED,
    FORMS,
    Form,
    compared,
    tone_mapped,
)
from deeplight.mappings import mirror_ball
from deeplight.sphere import SPHERES

METRICS = ("angular_deg", "si_rmse", "rmse", "normalised_rmse")


def lights(seed: int, count: int = 3) -> np.ndarray:
    inside = (mirror_ball.coverage(32) > 0)[..., None]
    q = np.random.default_rng(seed).normal(-1, 1, (count, 32, 32, 3))
    return (np.exp(q) * inside).astype(np.float32)


@pytest.mark.parametrize("form", FORMS)
def test_the_true_light_has_no_error_and_another_has(form: Form) -> None:
    same, other = compared(lights(0), lights(0), form), compared(lights(1), lights(0), form)
    assert sorted(same) == sorted(f"{m}_{s}" for m, s in product(METRICS, SPHERES))
    for name in same:
        assert same[name] == pytest.approx(np.zeros(3), abs=2e-3), name
        assert (other[name] > 5 * same[name] + 1e-3).all(), name


def test_as_published_brightness_does_not_matter() -> None:
    """Every light is scaled by its own median; corrected, only the scale-invariant one forgives."""
    true, brighter = lights(0), lights(0) * np.float32(8)
    blind, seeing = compared(brighter, true, AS_PUBLISHED), compared(brighter, true, CORRECTED)
    for sphere in SPHERES:
        assert blind[f"rmse_{sphere}"] == pytest.approx(np.zeros(3), abs=1e-4)
        assert (seeing[f"rmse_{sphere}"] > 0.1).all()
        assert seeing[f"si_rmse_{sphere}"] == pytest.approx(np.zeros(3), abs=1e-3)


def test_the_tone_map_brings_the_median_to_a_half_and_squeezes_the_sun() -> None:
    sunny = lights(0)
    sunny[0, 10, 10] = 1e4
    mapped = tone_mapped(sunny)
    lit = mapped[0][sunny[0] > 0]
    assert np.median(lit) == pytest.approx(0.5, abs=0.05)  # theirs counts the poles more often
    assert mapped[0, 10, 10, 0] < 100
    np.testing.assert_allclose(tone_mapped(sunny * np.float32(3)), mapped, rtol=1e-4)


def test_squares_are_summed_over_channels_as_published() -> None:
    """Grey light that is wrong by one step: sqrt(3) of what a mean would give."""
    true = np.ones((1, 32, 32, 3), np.float32)
    lopsided = true.copy()
    lopsided[:, :16] *= 2**2.4  # encoded: twice the lower half
    found = compared(lopsided, true, AS_PUBLISHED)["rmse_mirror"][0]
    mean_only = compared(lopsided, true, Form("mean", False))["rmse_mirror"][0]
    assert np.isfinite([found, mean_only]).all()
    one = compared(true * np.float32(2), true, CORRECTED)
    assert one["rmse_mirror"][0] == pytest.approx(0.5 * 0.8, rel=0.05)  # median 0.5, 80 % reflected


def test_black_pixels_are_perfect_only_as_published() -> None:
    true, black = lights(0), np.zeros((3, 32, 32, 3), np.float32)
    assert (compared(black, true, AS_PUBLISHED)["angular_deg_diffuse"] == 0).all()
    assert np.isnan(compared(black, true, CORRECTED)["angular_deg_diffuse"]).all()
