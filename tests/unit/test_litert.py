"""LiteRT gives what onnxruntime gives; the files are of golden/make_litert.py, random weights."""

import shutil
import sys

import numpy as np
import pytest

from deeplight.cli.main import main
from deeplight.contract import CONTRACT_KEY
from deeplight.errors import MissingExtraError, ModelError
from deeplight.estimators.open import open_model

pytestmark = pytest.mark.needs("ai_edge_litert")


@pytest.fixture(scope="module")
def golden(root):
    return root / "tests" / "golden"


def photos(count, seed=0):
    random = np.random.default_rng(seed)
    return (random.uniform(-0.5, 0.5, (count, 3, 1, 1)) * np.ones((1, 1, 192, 135))).astype("f4")


@pytest.mark.parametrize("threads", [1, 2])
def test_litert_gives_what_onnxruntime_gives_for_any_batch(golden, threads):
    reference = open_model(golden / "tiny.onnx", 1)
    estimator = open_model(golden / "tiny.tflite", threads)
    for count in (1, 3, 2):
        expected = reference.estimate_inputs(photos(count))
        found = estimator.estimate_inputs(photos(count))
        np.testing.assert_allclose(found, expected, atol=1e-4, rtol=0)
        other = estimator.estimate_inputs(photos(count, seed=1))  # the twin that must fail
        assert np.abs(other - expected).max() > 1e-3
    assert estimator.contract == reference.contract


def test_eight_bits_give_nearly_the_same(golden):
    found, expected = (
        open_model(golden / name, 1).estimate_inputs(photos(4))
        for name in ("tiny-int8.tflite", "tiny.onnx")
    )
    spread = expected.std()
    assert np.abs(found - expected).mean() < 0.5 * spread  # eight channels have little to average
    other = open_model(golden / "tiny.onnx", 1).estimate_inputs(photos(4, seed=1))
    assert np.abs(found - other).mean() > np.abs(found - expected).mean()


def test_the_files_tell_nothing_of_the_machine_that_made_them(golden, root):
    for name in ("tiny.tflite", "tiny-int8.tflite"):
        content = (golden / name).read_bytes()
        assert CONTRACT_KEY.encode() in content
        assert str(root).encode() not in content
        assert b"site-packages" not in content


def damaged(content, how):
    if how == "cut":
        return content[: len(content) // 2]
    if how == "other":
        return b"not a model at all"
    if how == "empty":
        return b""
    assert how == "nameless"
    return content.replace(CONTRACT_KEY.encode(), b"deeplight.contrast")


@pytest.mark.parametrize("how", ["cut", "other", "empty", "nameless"])
def test_a_file_that_is_no_model_is_refused(golden, tmp_path, capfd, how):
    path = tmp_path / "model.tflite"
    path.write_bytes(damaged((golden / "tiny.tflite").read_bytes(), how))
    with pytest.raises(ModelError):
        open_model(path)
    assert capfd.readouterr().err == ""


def test_estimate_takes_a_tflite_file(golden, root, tmp_path, capfd):
    photo = next((root / "examples" / "photos").glob("*.jpg"))
    words = [str(photo), "--model", str(golden / "tiny.tflite"), "--out", str(tmp_path)]
    assert main(["estimate", *words]) == 0
    assert (tmp_path / f"{photo.stem}.exr").is_file()
    assert "XNNPACK" not in capfd.readouterr().err


def test_without_the_runtime_the_extra_is_reported(golden, monkeypatch):
    monkeypatch.setitem(sys.modules, "ai_edge_litert", None)
    monkeypatch.delitem(sys.modules, "deeplight.estimators.litert", raising=False)
    with pytest.raises(MissingExtraError, match=r"\.\[litert\]"):
        open_model(golden / "tiny.tflite")


def test_both_formats_are_counted_alike(golden):
    pytest.importorskip("onnx")
    pytest.importorskip("torch")
    from deeplight.deploy.counting import network_size
    from deeplight.training.model_file import load_network

    onnx, tflite, eight = (
        network_size(golden / f"tiny{end}") for end in (".onnx", ".tflite", "-int8.tflite")
    )
    network, _ = load_network(golden / "tiny.onnx")
    zeros = sum(p.numel() for p in network.parameters() if not p.any())  # ONNX does not store them
    assert tflite == eight
    assert tflite.parameters == sum(parameter.numel() for parameter in network.parameters())
    assert onnx.parameters == tflite.parameters - zeros
    assert onnx.multiply_adds == tflite.multiply_adds
    last = 16 * 16 * 3 * 8 * 9  # the last convolution alone
    assert last < onnx.multiply_adds < 100e6


def test_benchmark_writes_its_table(golden, tmp_path, capsys):
    pytest.importorskip("onnx")
    import csv
    import json

    models = [shutil.copy(golden / name, tmp_path) for name in ("tiny.onnx", "tiny.tflite")]
    words = [*models, "--threads", "1", "--rounds", "3", "--without-xnnpack", "--out"]
    assert main(["benchmark", *words, str(tmp_path / "out")]) == 0
    assert "tiny.onnx" in capsys.readouterr().out
    results = json.loads((tmp_path / "out" / "benchmark.json").read_text())
    assert results["machine"]["matrix_peak_gflops"]["1"] > 0.1
    runtimes = [row["runtime"] for row in results["rows"]]
    assert runtimes == ["onnxruntime", "LiteRT", "LiteRT without XNNPACK"]
    for row in results["rows"]:
        assert 0 < row["fastest_ms"] <= row["p10_ms"] <= row["median_ms"] <= row["p90_ms"]
        achieved = 2 * row["multiply_adds"] / (row["fastest_ms"] * 1e6)
        peak = results["machine"]["matrix_peak_gflops"]["1"]
        assert row["of_peak"] == pytest.approx(achieved / peak)
    with (tmp_path / "out" / "benchmark.csv").open() as file:
        assert len(list(csv.DictReader(file))) == 3


def test_benchmark_refuses_no_rounds(capsys):
    assert main(["benchmark", "--rounds", "0"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "at least 1" in line
