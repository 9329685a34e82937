"""What an evaluation is given: models under names, and other methods' panoramas."""

from pathlib import Path

import numpy as np
import pytest

from deeplight.contract import ModelContract
from deeplight.errors import ConfigError, DataSetError, ModelError
from deeplight.estimators.onnx import OnnxEstimator, shipped_model
from deeplight.evaluate.models import NamedModel, named_models
from deeplight.evaluate.panorama_estimates import panorama_estimates
from deeplight.frames import normalised
from deeplight.io.radiance import write_exr, write_hdr
from deeplight.mappings import latlong, mirror_ball
from deeplight.preprocess import landscape_background, normalise

DISC = mirror_ball.coverage(32) > 0.99


# -- models --------------------------------------------------------------------------------------


@pytest.fixture
def runs(tmp_path: Path) -> Path:
    for name in ("mirror", "diffuse"):
        (tmp_path / "runs" / name).mkdir(parents=True)
        (tmp_path / "runs" / name / "run.toml").write_text("")
        (tmp_path / "runs" / name / "model.onnx").symlink_to(shipped_model())
    return tmp_path / "runs"


def names(*given: str) -> list[str]:
    return [model.name for model in named_models(given)]


def test_models_go_by_the_name_given_or_that_of_their_run(runs: Path) -> None:
    shipped = str(shipped_model())
    assert names() == names(shipped) == ["deeplight"]
    assert names(f"mine={shipped}", f"other={shipped}") == ["mine", "other"]
    assert names(str(runs)) == ["diffuse", "mirror"]
    assert names(str(runs / "mirror")) == ["mirror"]
    assert names(f"best={runs / 'mirror'}") == ["best"]
    (runs / "mirror" / "second.onnx").symlink_to(shipped_model())
    assert names(str(runs)) == ["diffuse", "mirror-model", "mirror-second"]


def test_a_users_model_is_named_as_it_is(tmp_path: Path) -> None:
    (tmp_path / "mine.onnx").write_bytes(shipped_model().read_bytes())
    assert names(str(tmp_path / "mine.onnx")) == ["mine"]


def test_a_run_without_its_record_is_refused(runs: Path) -> None:
    (runs / "mirror" / "run.toml").unlink()
    with pytest.raises(ModelError, match=r"run\.toml"):
        named_models([str(runs)])
    (runs / "empty").mkdir()
    with pytest.raises(ModelError, match="none in"):
        named_models([str(runs / "empty")])
    with pytest.raises(ConfigError, match="name of letters"):
        named_models([f"a/b={shipped_model()}"])
    with pytest.raises(ModelError):
        named_models(["mine=no_such.onnx"])


class Remembering(OnnxEstimator):
    """A network that remembers what it was shown."""

    def __init__(self, contract: ModelContract) -> None:
        self.contract = contract
        self.shown: list[np.ndarray] = []

    def estimate_inputs(self, inputs: np.ndarray) -> np.ndarray:
        self.shown.append(inputs)
        return np.zeros((len(inputs), 32, 32, 3), np.float32)


def test_a_landscape_network_sees_what_it_was_trained_on() -> None:
    photos = np.random.default_rng(0).integers(0, 256, (2, 192, 135, 3), np.uint8)
    network = Remembering(ModelContract.landscape())
    NamedModel("wide", network).estimate_inputs(normalise(photos))
    expected = normalise(np.stack([landscape_background(photo) for photo in photos]))
    np.testing.assert_allclose(network.shown[0], expected, atol=0.6 / 255)
    portrait = Remembering(ModelContract())
    NamedModel("narrow", portrait).estimate_inputs(normalise(photos))
    np.testing.assert_array_equal(portrait.shown[0], normalise(photos))


# -- panoramas -----------------------------------------------------------------------------------


def lamp_towards(direction: list[float]) -> np.ndarray:
    rays = latlong.directions(64, 128)
    near = rays @ normalised(np.array(direction, np.float32)) > 0.97
    return (0.1 + 50 * near[..., None] * np.ones(3)).astype(np.float32)


def brightest(folder: str, key: str = "k") -> np.ndarray:
    log_radiance = panorama_estimates([folder])[0].estimate_keys([key])[0]
    at = np.where(DISC, log_radiance.sum(-1), -np.inf).argmax()
    return mirror_ball.pixel_directions(32).reshape(-1, 3)[at]


@pytest.mark.parametrize("direction", [[1.0, 0, 0], [0, 1.0, 0], [-0.5, 0.2, 0.8]])
def test_a_lamp_is_where_it_was_painted(tmp_path: Path, direction: list[float]) -> None:
    write_exr(tmp_path / "k.exr", lamp_towards(direction))
    found = brightest(f"other={tmp_path}")
    assert found @ normalised(np.array(direction)) > np.cos(np.radians(12))


def test_an_upright_panorama_is_turned_by_the_cameras_elevation(tmp_path: Path) -> None:
    """Looking up by 30 degrees, the camera sees the horizon 30 degrees below its axis."""
    write_hdr(tmp_path / "k.hdr", lamp_towards([1.0, 0.0, -1.0]))
    up = brightest(f"other={tmp_path},30")
    expected = normalised(np.array([1.0, -np.sin(np.radians(30)), -np.cos(np.radians(30))]))
    assert up @ expected > np.cos(np.radians(12))
    down = brightest(f"other={tmp_path},-30")
    assert down @ (expected * [1, -1, 1]) > np.cos(np.radians(12))
    (tmp_path / "elevations.csv").write_text("key,elevation_deg\nk,30\n")
    assert (brightest(f"other={tmp_path}") == up).all()


@pytest.mark.parametrize("height", [32, 64, 128, 512])
def test_energy_is_kept_from_a_panorama_of_any_size(tmp_path: Path, height: int) -> None:
    radiance = np.full((height, 2 * height, 3), 0.5, np.float32)
    radiance[height // 5, height // 2] = 40_000  # a sun of one texel
    write_exr(tmp_path / "k.exr", radiance)
    lighting = panorama_estimates([f"other={tmp_path},17"])[0].lighting("k")
    wanted = (latlong.solid_angles(height, 2 * height)[..., None] * radiance).sum((0, 1))
    assert lighting.power() == pytest.approx(wanted, rel=1e-3)


@pytest.mark.parametrize("item", ["other", "=folder", "other=", "other={here},95"])
def test_other_words_are_refused(tmp_path: Path, item: str) -> None:
    write_exr(tmp_path / "k.exr", lamp_towards([1.0, 0, 0]))
    with pytest.raises(ConfigError):
        panorama_estimates([item.format(here=tmp_path)])


def test_a_folder_that_lacks_something_is_reported(tmp_path: Path) -> None:
    with pytest.raises(DataSetError, match="folder of panoramas"):
        panorama_estimates([f"other={tmp_path / 'none'}"])
    with pytest.raises(DataSetError, match="none in"):
        panorama_estimates([f"other={tmp_path}"])
    write_exr(tmp_path / "k.exr", lamp_towards([1.0, 0, 0]))
    (method,) = panorama_estimates([f"other={tmp_path}"])
    assert method.covers("k")
    assert not method.covers("l")
    with pytest.raises(DataSetError, match=r"l\.exr"):
        method.estimate_keys(["l"])
    for text in ("key,elevation_deg\nk,up\n", "key,elevation_deg\nk,200\n", "name\nk\n"):
        (tmp_path / "elevations.csv").write_text(text)
        with pytest.raises(DataSetError, match="elevation"):
            panorama_estimates([f"other={tmp_path}"])
    (tmp_path / "elevations.csv").write_text("key,elevation_deg\nm,20\n")
    with pytest.raises(DataSetError, match="none for k"):
        panorama_estimates([f"other={tmp_path}"])[0].estimate_keys(["k"])
