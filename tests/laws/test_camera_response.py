"""Equation 3 and the camera's curve."""

import hypothesis.strategies as st
import numpy as np
import pytest
from hypothesis import given

from deeplight.camera_response import CameraResponse, decode, encode, soft_clip

radiances = st.lists(st.floats(0, 1e6), min_size=1, max_size=20).map(np.array)
below_clip = st.lists(st.floats(0, 0.9), min_size=1, max_size=20).map(np.array)


@given(radiances)
def test_soft_clip_is_equation_3(p: np.ndarray) -> None:
    literal = 1 - np.log(1 + np.exp(np.clip(-40 * (p - 1), None, 700))) / 40
    np.testing.assert_allclose(soft_clip(p), literal, atol=1e-12)


@given(radiances)
def test_soft_clip_never_passes_1_nor_its_input(p: np.ndarray) -> None:
    assert (soft_clip(p) <= 1).all()
    assert (soft_clip(p) <= p + 1e-15).all()


def test_soft_clip_rises_and_stays_below_1() -> None:
    p = np.linspace(0, 1.6, 2000)  # beyond, 1 - e^-24 rounds to 1
    assert (np.diff(soft_clip(p)) > 0).all()
    assert (soft_clip(p) < 1).all()


def test_soft_clip_at_1_and_its_slopes() -> None:
    """What a clipped pixel teaches: half at white, next to nothing 20 % above it."""

    def slope(at: float) -> float:
        left, right = soft_clip(np.array([at - 1e-5, at + 1e-5]))
        return float(right - left) / 2e-5

    assert soft_clip(np.array([1.0]))[0] == pytest.approx(1 - np.log(2) / 40)
    assert soft_clip(np.array([1.0]))[0] == pytest.approx(0.98267, abs=1e-5)
    assert slope(1.0) == pytest.approx(0.5, abs=1e-6)
    assert slope(1.1) == pytest.approx(0.018, abs=5e-4)
    assert slope(1.2) == pytest.approx(3.4e-4, abs=2e-5)
    assert slope(0.5) == pytest.approx(1, abs=1e-6)


def test_soft_clip_leaves_dark_tones_and_sharpens_with_n() -> None:
    p = np.linspace(0, 0.8, 100)
    np.testing.assert_allclose(soft_clip(p), p, atol=1e-5)
    hard = np.minimum(np.linspace(0, 2, 100), 1)
    np.testing.assert_allclose(soft_clip(np.linspace(0, 2, 100), n=1e4), hard, atol=1e-4)


def test_soft_clip_keeps_float32_and_survives_the_sun() -> None:
    result = soft_clip(np.array([0, 1, 65504, 1e30], np.float32))
    assert result.dtype == np.float32
    assert np.isfinite(result).all()


@given(st.lists(st.floats(0, 1), min_size=1, max_size=20).map(np.array), st.floats(1.0, 3.0))
def test_gamma_there_and_back(pixel: np.ndarray, gamma: float) -> None:
    np.testing.assert_allclose(encode(decode(pixel, gamma), gamma), pixel, atol=1e-9)


def test_gamma_is_2_2_and_brightens_middle_tones() -> None:
    assert encode(np.array([0.5]))[0] == pytest.approx(0.5 ** (1 / 2.2))
    assert encode(np.array([-1.0]))[0] == 0


@given(
    below_clip,
    st.floats(-3, 3),
    st.tuples(*[st.floats(0.5, 2)] * 3),
)
def test_radiance_to_pixel_and_back(values, exposure_stops, white_balance) -> None:
    response = CameraResponse(exposure_stops=exposure_stops, white_balance=white_balance)
    radiance = np.repeat(values[:, None], 3, axis=1) / response.gain
    pixel = response.pixel_from_radiance(radiance)
    assert (pixel >= 0).all()
    assert (pixel <= 1).all()
    np.testing.assert_allclose(response.radiance_from_pixel(pixel), radiance, rtol=1e-3, atol=1e-5)


def test_one_stop_doubles_and_white_balance_is_per_channel() -> None:
    dim = np.full((1, 3), 0.1)
    brighter = CameraResponse(exposure_stops=1).pixel_from_radiance(dim)
    np.testing.assert_allclose(brighter, CameraResponse().pixel_from_radiance(2 * dim))
    warm = CameraResponse(white_balance=(2, 1, 0.5)).pixel_from_radiance(dim)[0]
    np.testing.assert_allclose(decode(warm), [0.2, 0.1, 0.05], rtol=1e-6)


def test_a_saturated_pixel_gives_a_finite_lower_bound() -> None:
    radiance = CameraResponse().radiance_from_pixel(np.ones((1, 3)))
    assert np.isfinite(radiance).all()
    assert (radiance >= 1).all()


@pytest.mark.parametrize("kind", [np.float32, np.float64])
@pytest.mark.parametrize("n", [1.0, 40.0])
def test_the_soft_clip_is_its_definition_to_the_last_bit(kind: type[np.generic], n: float) -> None:
    around = np.concatenate([np.linspace(1 - 60 / n, 1 + 60 / n, 4000), [0.0, 1.0, 1e30]])
    radiance = np.stack([around, around[::-1]]).astype(kind)
    wanted = (1 - np.logaddexp(0, -n * (radiance - 1)) / n).astype(kind)
    np.testing.assert_array_equal(soft_clip(radiance, n), wanted)
    np.testing.assert_array_equal(soft_clip(radiance.T, n), wanted.T)
