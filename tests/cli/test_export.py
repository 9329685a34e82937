"""`deeplight export`: the file asked for or one line, and nothing half-written."""

import copy
import importlib.util

import numpy as np
import pytest

from deeplight.cli.main import main
from deeplight.deploy import onnx
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.training import checkpoint
from deeplight.training.config import flatten
from deeplight.training.model_file import load_network
from deeplight.training.network.generator import Generator
from deeplight.training.presets import preset

pytestmark = pytest.mark.needs("onnxscript")


@pytest.fixture(scope="module")
def tiny(root):
    return root / "tests" / "golden" / "tiny.onnx"


def photos():
    return (np.random.default_rng(0).uniform(-0.5, 0.5, (2, 3, 192, 135))).astype(np.float32)


@pytest.fixture(scope="module")
def traced_once():
    """`traced`, which takes seconds, answering the second time with a copy of the first answer."""
    honest, answers = onnx.traced, []

    def once(generator, contract):
        if not answers:
            answers.append(honest(generator, contract))
        return copy.deepcopy(answers[0])

    return once


@pytest.mark.parametrize(("precision", "bound"), [("float32", 1e-5), ("float16", 0.1)])
def test_an_onnx_file_comes_back_the_same(
    tiny, tmp_path, monkeypatch, traced_once, precision, bound
):
    monkeypatch.setattr(onnx, "traced", traced_once)
    out = tmp_path / "again.onnx"
    assert main(["export", str(tiny), "--out", str(out), "--precision", precision]) == 0
    old, new = OnnxEstimator(tiny), OnnxEstimator(out)
    difference = np.abs(old.estimate_inputs(photos()) - new.estimate_inputs(photos()))
    assert difference.max() < bound
    assert new.contract == old.contract
    if precision == "float16":
        assert difference.max() > 0  # it is another file
        assert out.stat().st_size < 0.8 * tiny.stat().st_size


def test_a_runs_best_weights_are_exported_with_batch_norm_folded(tmp_path):
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
    estimator = OnnxEstimator(out)
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
    estimator = OnnxEstimator(path)
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
