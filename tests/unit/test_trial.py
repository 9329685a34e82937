"""Model files that a stranger made: refused in one line, whatever they do."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest

from deeplight.contract import CONTRACT_KEY, ModelContract
from deeplight.errors import ModelError
from deeplight.estimators import trial
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.estimators.open import open_model

CASES = Path(__file__).parents[3] / "shared" / "cases" / "hostile"
SIZE = 4
CONTRACT = ModelContract(width=6, height=8, output_size=SIZE)
SHAPE = ("shape", np.array([1, 3, SIZE, SIZE], np.int64))


def model(
    path: Path, *nodes: Any, constants: Any = (SHAPE,), contract: str = CONTRACT.to_json()
) -> Path:
    """A network whose output is `out`: the photo's mean, unless nodes say otherwise."""
    helper = onnx.helper
    nodes = nodes or (helper.make_node("Expand", ["mean", "shape"], ["log_radiance"]),)
    mean = helper.make_node("ReduceMean", [CONTRACT.input_name], ["mean"])
    photo = helper.make_tensor_value_info(CONTRACT.input_name, 1, ["n", 3, 8, 6])
    light = helper.make_tensor_value_info("log_radiance", 1, ["n", 3, SIZE, SIZE])
    given = [onnx.numpy_helper.from_array(value, name) for name, value in constants]
    graph = helper.make_graph([mean, *nodes], "graph", [photo], [light], given)
    made = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=8)
    entry = made.metadata_props.add()
    entry.key, entry.value = CONTRACT_KEY, contract
    path.write_bytes(made.SerializeToString())
    return path


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "model.onnx"


def test_a_good_model_of_a_stranger_runs(path: Path) -> None:
    estimator = OnnxEstimator(model(path))
    grey = np.full((1, 3, 8, 6), 0.25, np.float32)
    assert estimator.estimate_inputs(grey) == pytest.approx(0.25)


def loop(path: Path) -> Path:
    helper = onnx.helper
    body = helper.make_graph(
        [helper.make_node("Identity", ["go"], ["on"])],
        "body",
        [helper.make_tensor_value_info("i", 7, []), helper.make_tensor_value_info("go", 9, [])],
        [helper.make_tensor_value_info("on", 9, [])],
    )
    true = ("true", np.array(True))
    count = ("count", np.array(2**62, np.int64))
    nodes = [
        helper.make_node("Loop", ["count", "true"], [], body=body),
        helper.make_node("Expand", ["mean", "shape"], ["log_radiance"]),
    ]
    return model(path, *nodes, constants=[SHAPE, true, count])


def huge(path: Path) -> Path:
    helper = onnx.helper
    nodes = [
        helper.make_node("ConstantOfShape", ["wide"], ["zeros"]),
        helper.make_node("ReduceSum", ["zeros"], ["nothing"], keepdims=0),
        helper.make_node("Add", ["mean", "nothing"], ["sum"]),
        helper.make_node("Expand", ["sum", "shape"], ["log_radiance"]),
    ]
    return model(path, *nodes, constants=[SHAPE, ("wide", np.array([2**32], np.int64))])


def slow(path: Path) -> Path:
    helper = onnx.helper
    side = np.array([3000, 3000], np.int64)
    nodes = [helper.make_node("Expand", ["flat", "side"], ["m0"])]
    nodes += [helper.make_node("MatMul", [f"m{i}", f"m{i}"], [f"m{i + 1}"]) for i in range(40)]
    nodes += [
        helper.make_node("ReduceMax", ["m40"], ["most"], keepdims=0),
        helper.make_node("Clip", ["most", "zero", "zero"], ["nothing"]),
        helper.make_node("Add", ["mean", "nothing"], ["sum"]),
        helper.make_node("Expand", ["sum", "shape"], ["log_radiance"]),
    ]
    flat = helper.make_node("ReduceMin", [CONTRACT.input_name], ["flat0"], keepdims=0)
    nodes = [flat, helper.make_node("Identity", ["flat0"], ["flat"]), *nodes]
    constants = [SHAPE, ("side", side), ("zero", np.array(0, np.float32))]
    return model(path, *nodes, constants=constants)


def empty(path: Path) -> Path:
    return model(path, constants=[("shape", np.array([0, 3, SIZE, SIZE], np.int64))])


def outside(path: Path) -> Path:
    made = onnx.load(model(path))
    tensor = made.graph.initializer[0]
    onnx.external_data_helper.set_external_data(tensor, "other.bin", length=32)
    tensor.ClearField("raw_data")
    path.write_bytes(made.SerializeToString())
    return path


def impossible(path: Path) -> Path:
    return model(
        path, contract=json.dumps(json.loads(CONTRACT.to_json()) | {"frame_aspect": 1e308})
    )


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (loop, "a loop"),
        (huge, "memory|cannot be run"),
        (slow, "more than 1 s"),
        (empty, r"gives \(0, 3"),
        (outside, "another file"),
        (impossible, "frame_aspect"),
    ],
)
def test_a_hostile_model_is_refused(
    make: Any, why: str, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trial, "CPU_S", 1 if make is slow else 10)
    with pytest.raises(ModelError, match=why) as refused:
        OnnxEstimator(make(path))
    assert "\n" not in str(refused.value)


def test_a_contract_of_endless_depth_is_refused() -> None:
    with pytest.raises(ModelError):
        ModelContract.from_json("[" * 100_000)


@pytest.mark.skipif(not CASES.exists(), reason="needs ../shared/cases")
@pytest.mark.parametrize(
    "name",
    [
        "c_aspect.onnx",
        "emptyout.onnx",
        "onnx-1-1-other.onnx",
        "loop.onnx",
        "tflite-1-265-other.tflite",
    ],
)
def test_the_collected_models_are_refused(name: str) -> None:
    if name.endswith(".tflite"):
        pytest.importorskip("ai_edge_litert")
    with pytest.raises(ModelError) as refused:
        open_model(CASES / name)
    assert "\n" not in str(refused.value)
