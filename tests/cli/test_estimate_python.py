"""Estimating from Python: every kind of photo, wrong model files, the shipped model."""

import math
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import deeplight
from deeplight.contract import ModelContract
from deeplight.errors import ImageFileError, ModelError, ShapeError
from deeplight.estimators.estimate import estimate
from deeplight.estimators.onnx import OnnxEstimator, shipped_model
from deeplight.lighting import Lighting
from deeplight.preprocess import frame_photo, network_input

from .conftest import write_tiny_model


@pytest.fixture(scope="module")
def estimator(tiny_model: Path) -> OnnxEstimator:
    return OnnxEstimator(tiny_model)


def smooth_pixels() -> np.ndarray:
    small = np.random.default_rng(1).integers(0, 256, (6, 4, 3), dtype=np.uint8)
    return np.asarray(Image.fromarray(small).resize((320, 480), Image.Resampling.BICUBIC))


def test_path_pixels_floats_and_pillow_mean_the_same(estimator: OnnxEstimator, tmp_path: Path):
    pixels = smooth_pixels()
    Image.fromarray(pixels).save(tmp_path / "photo.png")
    wanted = estimator.estimate(tmp_path / "photo.png").radiance
    for photo in (
        str(tmp_path / "photo.png"),
        pixels,
        pixels / 255,
        Image.fromarray(pixels),
        Image.open(tmp_path / "photo.png"),
    ):
        np.testing.assert_allclose(estimator.estimate(photo).radiance, wanted, rtol=1e-5)
    changed = pixels.copy()
    changed[:240] //= 2
    assert not np.allclose(estimator.estimate(changed).radiance, wanted, rtol=1e-5)


def test_a_batch_of_inputs_gives_what_single_photos_give(estimator: OnnxEstimator):
    photos = [smooth_pixels(), smooth_pixels()[::-1]]
    framing = frame_photo(480, 320, math.radians(50))  # so narrow a view is looked at once
    inputs = np.stack([network_input(photo, framing) for photo in photos])
    log_radiance = estimator.estimate_inputs(inputs)
    assert log_radiance.shape == (2, 32, 32, 3)
    for photo, expected in zip(photos, log_radiance, strict=True):
        single = estimator.estimate(photo, 50).radiance
        np.testing.assert_allclose(single, Lighting.from_log_radiance(expected).radiance, rtol=1e-5)


def test_explain_gives_framing_notes_and_times(estimator: OnnxEstimator):
    explained = estimator.explain(smooth_pixels(), fov_deg=40)
    assert explained.framing.fov_source == "given"
    assert any("trained on" in note for note in explained.notes)
    assert set(explained.seconds) == {"read", "prepare", "network"}
    whole = estimator.explain(np.zeros((1920, 1080, 3), np.uint8), fov_deg=66)
    assert whole.notes == ()


@pytest.mark.parametrize(
    "photo",
    [
        np.zeros((100, 100, 2), np.uint8),
        np.zeros((5, 100, 3), np.uint8),
        np.zeros((100, 100, 3), np.int32),
        np.full((100, 100, 3), 2.0),
        np.full((100, 100, 3), np.nan),
    ],
    ids=["two channels", "small", "integers", "too bright", "nan"],
)
def test_pixels_that_are_no_photo_are_refused(estimator: OnnxEstimator, photo: np.ndarray):
    with pytest.raises(ShapeError):
        estimator.estimate(photo)


def test_the_public_name_is_the_function_of_the_package(
    estimator: OnnxEstimator, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("deeplight.estimators.estimate._default", [estimator])
    wanted = estimator.estimate(smooth_pixels()).radiance
    import_module("deeplight.estimators.sources")
    for call in (deeplight.estimate, estimate):
        given = call(smooth_pixels()).lighting.radiance
        np.testing.assert_allclose(given.mean(), wanted.mean(), rtol=0.1)


def test_a_damaged_picture_from_pillow_is_refused(estimator: OnnxEstimator, tmp_path: Path):
    Image.fromarray(smooth_pixels()).save(tmp_path / "photo.jpg")
    whole = (tmp_path / "photo.jpg").read_bytes()
    (tmp_path / "photo.jpg").write_bytes(whole[: len(whole) // 2])
    with Image.open(tmp_path / "photo.jpg") as cut, pytest.raises(ImageFileError):
        estimator.estimate(cut)


def test_wrong_model_files_are_reported_in_one_line(tmp_path: Path):
    (tmp_path / "text.onnx").write_text("no model")
    write_tiny_model(tmp_path / "bare.onnx", contract_json=None)
    newer = ModelContract().to_json().replace('"version": 3', '"version": 4')
    write_tiny_model(tmp_path / "newer.onnx", newer)
    write_tiny_model(tmp_path / "lies.onnx", ModelContract().to_json(), light_size=16)
    for name, message in {
        "missing.onnx": "no file",
        "text.onnx": "cannot load",
        "bare.onnx": "exported by deeplight",
        "newer.onnx": "version 4",
        "lies.onnx": "keeps its own contract",
        "": "a folder",
    }.items():
        with pytest.raises(ModelError, match=message) as caught:
            OnnxEstimator(tmp_path / name)
        assert "\n" not in str(caught.value)


def test_the_shipped_model_estimates():
    try:
        shipped_model()
    except ModelError:
        pytest.skip("the shipped model src/deeplight/weights/deeplight.onnx is not there yet")
    environment = estimate(smooth_pixels(), fov_deg=66)
    assert environment.radiance.shape == (256, 512, 3)
    assert environment.lighting.power().min() > 0
