"""`deeplight export`: the file asked for or one line, and nothing half-written."""

import importlib.util

import numpy as np
import pytest

from deeplight.cli.main import main
from deeplight.deploy import onnx
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.mappings.mirror_ball import solid_angles
from deeplight.training import checkpoint
from deeplight.training.config import flatten
from deeplight.training.model_file import load_network
from deeplight.training.network.generator import Generator
from deeplight.training.presets import preset
from networks import lamps_network, shallow, traced_once, write_mean

pytestmark = pytest.mark.needs("onnxscript")


@pytest.fixture(scope="module")
def tiny(root):
    return root / "tests" / "golden" / "tiny.onnx"


def photos():
    return (np.random.default_rng(0).uniform(-0.5, 0.5, (2, 3, 192, 135))).astype(np.float32)


@pytest.mark.parametrize(("precision", "bound"), [("float32", 1e-5), ("float16", 0.1)])
def test_an_onnx_file_comes_back_the_same(
    everything_model, tmp_path, monkeypatch, shallow_networks, precision, bound
):
    monkeypatch.setattr(onnx, "traced", traced_once)
    out = tmp_path / "again.onnx"
    assert main(["export", str(everything_model), "--out", str(out), "--precision", precision]) == 0
    old, new = (OnnxEstimator(path, trusted=True) for path in (everything_model, out))
    difference = np.abs(old.estimate_inputs(photos()) - new.estimate_inputs(photos()))
    assert difference.max() < bound
    assert new.contract == old.contract
    if precision == "float16":
        assert difference.max() > 0  # it is another file
        assert out.stat().st_size < 0.8 * everything_model.stat().st_size


def test_a_runs_best_weights_are_exported_with_batch_norm_folded(tmp_path, shallow_networks):
    config = preset("small-width035", ["network.output_size=16", "network.latent_size=16"])
    generator = Generator(config.network)
    for module in generator.modules():  # a norm that does something
        if hasattr(module, "running_mean"):
            module.running_mean.normal_(0, 0.1)
    header = checkpoint.Header(5, 0.1, flatten(config), "abc")
    checkpoint.save(tmp_path / "run" / checkpoint.BEST, header, generator=generator.state_dict())
    out = tmp_path / "mine.onnx"
    words = [str(tmp_path / "run"), "--out", str(out), "--trained-on", "a test"]
    assert main(["export", *words]) == 0
    estimator = OnnxEstimator(out, trusted=True)
    import torch

    with torch.no_grad():
        expected = generator.eval()(torch.from_numpy(photos())).permute(0, 2, 3, 1).numpy()
    np.testing.assert_allclose(estimator.estimate_inputs(photos()), expected, atol=1e-4)
    assert estimator.contract.trained_on.startswith("a test; step 5")


def test_the_shipped_model_is_read_back_as_a_network(root):
    import torch

    path = root / "src" / "deeplight" / "weights" / "deeplight.onnx"
    network, contract = load_network(path)
    with torch.no_grad():
        found = network(torch.from_numpy(photos())).permute(0, 2, 3, 1).numpy()
    estimator = OnnxEstimator(path, trusted=True)
    np.testing.assert_allclose(found, estimator.estimate_inputs(photos()), atol=1e-4)
    assert contract == estimator.contract
    flipped = estimator.estimate_inputs(photos()[..., ::-1])  # the twin that must fail
    assert np.abs(found - flipped).max() > 1e-3


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--out", "a.onnx", "--precision", "int8"), "float32 or float16 for ONNX"),
        (("--out", "a.tflite", "--precision", "int8"), "--calibrate"),
        (("--out", "a.model"), "--format"),
        (("--out", "a.onnx", "--format", "tflite"), "a.onnx for tflite"),
    ],
)
def test_what_does_not_fit_is_one_line(tiny, tmp_path, monkeypatch, capfd, words, message):
    monkeypatch.chdir(tmp_path)
    assert main(["export", str(tiny), *words]) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert message in line
    assert not list(tmp_path.iterdir())


def test_no_model_is_one_line(tmp_path, capfd):
    for got in (tmp_path / "none.onnx", tmp_path):
        assert main(["export", str(got), "--out", str(tmp_path / "a.onnx")]) == 2
        (line,) = capfd.readouterr().err.splitlines()
        assert "expected a trained network" in line
    broken = tmp_path / "broken.onnx"
    broken.write_bytes(b"\x08\x08 no model")
    assert main(["export", str(broken), "--out", str(tmp_path / "a.onnx")]) == 2


@pytest.mark.skipif(
    importlib.util.find_spec("litert_torch") is not None, reason="the converter is installed"
)
def test_without_the_converter_its_extra_is_reported(tiny, tmp_path, capfd):
    assert main(["export", str(tiny), "--out", str(tmp_path / "a.tflite")]) == 2
    assert 'pip install ".[tflite]"' in capfd.readouterr().err


@pytest.fixture(scope="module")
def networks(tiny):
    """One with lamps, of few blocks, and one without."""
    with shallow():
        lamps = lamps_network()[0]
    return lamps, load_network(tiny)[0]


def test_several_networks_answer_with_the_mean_of_their_light(networks):
    """Its power is the mean power of all answers, exactly; and away from lamps so is the light."""
    import torch

    from deeplight.training.network.average import Average

    lamps, plain = networks
    with torch.no_grad():
        photo = torch.from_numpy(photos())
        answers = [n(photo).exp() for n in (lamps, plain)]
        answers += [n(photo.flip(-1)).exp().flip(-1) for n in (lamps, plain)]
        together = Average([lamps, plain], flips=True)(photo)
    expected = torch.stack(answers).mean(0).permute(0, 2, 3, 1).numpy()
    found = together.exp().permute(0, 2, 3, 1).numpy()
    area = solid_angles(16)[..., None]
    power = (found * area).sum((1, 2))
    np.testing.assert_allclose(power, (expected * area).sum((1, 2)), rtol=1e-3)
    assert np.median(np.abs(found / expected - 1)[:, area[..., 0] > 0]) < 0.02
    # The twin that must fail: one part alone.
    assert (
        np.abs(power / (answers[0].permute(0, 2, 3, 1).numpy() * area).sum((1, 2)) - 1).max() > 0.1
    )


@pytest.fixture(scope="module")
def averaged(flipped_model):
    return OnnxEstimator(flipped_model, trusted=True)


def test_a_file_answers_as_the_mean_does(networks, averaged):
    assert_answers_as(networks[:1], averaged, flips=True)


@pytest.mark.slow
def test_two_networks_are_one_file(tiny, tmp_path):
    networks = (lamps_network()[0], load_network(tiny)[0])
    assert_answers_as(networks, OnnxEstimator(write_mean(tmp_path, str(tiny))), flips=False)


def assert_answers_as(members, estimator, flips):
    import torch

    from deeplight.training.network.average import Average

    with torch.no_grad():
        photo = torch.from_numpy(photos())
        expected = Average(members, flips)(photo).permute(0, 2, 3, 1).numpy()
        alone = members[0](photo).permute(0, 2, 3, 1).numpy()
    found = estimator.estimate_inputs(photos())
    np.testing.assert_allclose(found, expected, atol=1e-3)
    assert np.abs(found - alone).max() > 0.01  # the twin: one answer alone


def test_lamps_that_agree_take_the_flux_of_one_that_stands_alone():
    import torch

    from deeplight.training.network.average import agreeing

    toward = [[0.0, 1.0, 0.0], [0.1, 0.995, 0.0], [0.0, -1.0, 0.0]]
    lamps = torch.tensor([[[*d, 0.0, 0.1, -0.1, 0.2] for d in toward]])
    shared = agreeing(lamps)[0, :, 3:6].exp()
    torch.testing.assert_close(shared.sum(0), lamps[0, :, 3:6].exp().sum(0))
    assert shared[0, 0] / shared[2, 0] > 100
    alone = lamps[:, [0, 2]]  # the twin: two that point apart keep theirs
    torch.testing.assert_close(agreeing(alone), alone)


def test_with_flips_a_mirrored_photo_has_mirrored_light_and_lamps(averaged):
    estimator = averaged
    light, lamps, _ = estimator.estimate_fully(photos())
    mirrored, their_lamps, _ = estimator.estimate_fully(photos()[..., ::-1])
    np.testing.assert_allclose(mirrored, light[:, :, ::-1], atol=1e-4)
    assert len(lamps[0]) == estimator.contract.lamps == 2 * 3
    for own, theirs in zip(lamps[0], their_lamps[0], strict=True):
        assert own.luminous_flux == pytest.approx(theirs.luminous_flux, rel=1e-3)
    strongest = max(lamps[0], key=lambda lamp: lamp.luminous_flux).direction * [-1, 1, 1]
    assert max(strongest @ lamp.direction for lamp in their_lamps[0]) > 1 - 1e-4


def test_an_average_is_no_part_of_another(averaged, tmp_path, capfd):
    again = ["export", str(averaged.path), "--out", str(tmp_path / "a.onnx")]
    assert main(again) == 2
    assert "the mean of several" in capfd.readouterr().err
    parts = [str(averaged.path.parent / "run")] * 2
    assert main(["export", *parts, "--out", str(tmp_path / "a.tflite")]) == 2
    assert "for TFLite" in capfd.readouterr().err
    assert not list(tmp_path.iterdir())
