"""The public names do what a user guesses: any photo-like value, many photos, any light out."""

import pickle
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import deeplight
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.io.photo_like import as_photo

FOCAL_35, EXIF_FOLDER, ORIENTATION = 0xA405, 0x8769, 0x0112


def grey_gradient(alpha: bool = False) -> np.ndarray:
    rows, columns = np.mgrid[0:96, 0:64]
    rgb = np.stack([rows * 2, columns * 3, 255 - rows * 2], -1).astype(np.uint8)
    opaque = np.where(columns < 20, 60, 255).astype(np.uint8)[..., None]
    return np.concatenate([rgb, opaque], -1) if alpha else rgb


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    exif = Image.Exif()
    exif[ORIENTATION] = 6
    exif.get_ifd(EXIF_FOLDER)[FOCAL_35] = 85
    path = tmp_path / "photo.png"
    Image.fromarray(grey_gradient(alpha=True)).save(path, exif=exif)
    return path


def test_one_picture_is_one_photo_however_it_is_given(photo: Path) -> None:
    wanted = as_photo(photo)
    assert wanted.pixels.shape == (64, 96, 3)
    assert wanted.vertical_fov_rad is not None
    with photo.open("rb") as opened, Image.open(photo) as pillow:
        for given in (str(photo), photo.read_bytes(), opened, pillow):
            got = as_photo(given)
            np.testing.assert_array_equal(got.pixels, wanted.pixels)
            assert got.vertical_fov_rad == wanted.vertical_fov_rad
    assert as_photo(Image.open(photo).rotate(180)).pixels[0, 0, 0] != wanted.pixels[0, 0, 0]


def test_arrays_of_every_depth_and_channel_count_are_the_same_photo() -> None:
    torch = pytest.importorskip("torch")
    rgb, rgba = grey_gradient(), grey_gradient(alpha=True)
    whole = as_photo(rgb).pixels
    for given in (rgb / 255, rgb.astype(np.uint16) * 257, rgb.astype(np.float32) / 255):
        np.testing.assert_array_equal(as_photo(given).pixels, whole)
    np.testing.assert_array_equal(as_photo(torch.tensor(rgb).permute(2, 0, 1)).pixels, whole)
    grey = rgb[..., 0]
    for given in (grey, grey[..., None], np.repeat(grey[..., None], 3, 2), torch.tensor(grey)):
        np.testing.assert_array_equal(as_photo(given).pixels[..., 1], grey)
    see_through = as_photo(rgba).pixels
    np.testing.assert_array_equal(see_through, as_photo(Image.fromarray(rgba)).pixels)
    assert (see_through != whole).any()


@pytest.mark.parametrize(
    "wrong",
    [None, 3, {"a": 1}, [1, 2], np.zeros((4, 4), int), b"no picture", np.zeros((50, 50, 2))],
)
def test_what_is_no_photo_is_one_clear_line(wrong: object) -> None:
    with pytest.raises(deeplight.InputError) as caught:
        deeplight.estimate(wrong)
    message = str(caught.value)
    assert message.startswith("expected ")
    assert "; got " in message
    assert "\n" not in message


def test_estimate_is_a_plain_function_that_runs_in_other_processes() -> None:
    assert pickle.loads(pickle.dumps(deeplight.estimate)) is deeplight.estimate
    here = deeplight.estimate(grey_gradient(), 66, height=64)
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        there = pool.submit(deeplight.estimate, grey_gradient(), 66, height=64).result()
    np.testing.assert_allclose(there.radiance, here.radiance, rtol=1e-5)


def test_many_photos_give_what_each_gives_and_bad_ones_are_reported(tiny_model: Path) -> None:
    network, calls = OnnxEstimator(tiny_model), []
    whole = network.run_fully
    network.run_fully = lambda inputs: calls.append(len(inputs)) or whole(inputs)  # type: ignore[method-assign, func-returns-value]
    photos = [np.roll(grey_gradient(), 7 * n, axis=0) for n in range(20)]
    mixed = [*photos[:3], "missing.jpg", *photos[3:]]
    done: list[int] = []
    failed: list[int] = []
    lights = deeplight.estimate_many(
        mixed,
        66,
        64,
        estimator=network,
        progress=done.append,
        on_error=lambda number, error: failed.append(number),
    )
    assert failed == [3]
    assert lights[3] is None
    assert done[-1] == 21
    assert len(calls) == 2  # the network saw several at once
    single = deeplight.estimate_many([photos[5]], 66, 64, estimator=network)[0]
    assert single is not None
    assert lights[6] is not None
    np.testing.assert_allclose(lights[6].radiance, single.radiance, rtol=1e-4, atol=1e-6)
    with pytest.raises(OSError, match="missing"):
        deeplight.estimate_many(mixed, estimator=network)


def test_an_environment_is_converted_and_read_back(tmp_path: Path) -> None:
    environment = deeplight.estimate(grey_gradient(), 66, height=64)
    (written,) = deeplight.convert(environment, tmp_path / "light.exr")
    back = deeplight.read_environment(written)
    np.testing.assert_allclose(back.radiance, environment.radiance, rtol=1e-6)
    brighter = deeplight.convert(written, tmp_path / "b.exr", edit=deeplight.Edit(stops=1))
    np.testing.assert_allclose(
        deeplight.read_environment(brighter[0]).radiance, 2 * environment.radiance, rtol=1e-6
    )
    with pytest.raises(deeplight.InputError):
        deeplight.convert(3, tmp_path / "c.exr")


def test_an_own_class_estimates(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    source = "from numpy import zeros, float32\n\n\nclass Dark:\n    name = 'dark'\n"
    source += "    def estimate_inputs(self, inputs):\n"
    source += "        return zeros((len(inputs), 32, 32, 3), float32) - 3\n"
    (tmp_path / "own_light.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path)
    network = deeplight.load_estimator("own_light:Dark")
    assert network.name == "dark"
    light = network.estimate(grey_gradient(), 66)
    np.testing.assert_allclose(light.radiance[16, 16], np.exp(-3), rtol=1e-5)
    for wrong in ("own_light:Light", "no_such_module:Dark", "own_light:zeros"):
        with pytest.raises(deeplight.InputError, match="estimator's class"):
            deeplight.load_estimator(wrong)


def test_photos_compose_and_fuse_through_public_names(tmp_path: Path) -> None:
    pytest.importorskip("mitsuba")
    from deeplight.compose.compose import ComposeSettings
    from deeplight.compose.trace import Quality

    photo = np.full((96, 64, 3), 120, np.uint8)
    light = deeplight.estimate(photo, 66, height=64)
    quick = ComposeSettings(quality=Quality(4, 4, 100))
    composed = deeplight.compose_photo(photo, ["sphere"], light, settings=quick)
    changed = (composed.composite.pixels != photo).any(-1)
    assert 0 < changed.mean() < 0.9
    assert any("camera pitch from the network" in note for note in composed.notes)


@pytest.mark.parametrize("pitch_deg", [-30.0, 10.0])
def test_a_given_pitch_holds_for_the_light_of_a_composite_too(
    monkeypatch: pytest.MonkeyPatch, pitch_deg: float
) -> None:
    pytest.importorskip("mitsuba")
    from deeplight.compose import photo as compose_of_photo
    from deeplight.compose.gravity import CameraPlacement
    from deeplight.estimators.sun import scene_in_sun

    tilts = []

    def noted(*args: object, **kwargs: object) -> None:
        scene, _ = scene_in_sun(*args, **kwargs)
        tilts.append(scene.tilt)
        raise KeyboardInterrupt

    monkeypatch.setattr(compose_of_photo, "scene_in_sun", noted)
    with pytest.raises(KeyboardInterrupt):
        deeplight.compose_photo(grey_gradient(), placement=CameraPlacement(pitch_deg=pitch_deg))
    assert tilts[0].pitch_rad == pytest.approx(np.radians(pitch_deg))
