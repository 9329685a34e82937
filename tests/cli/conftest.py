"""A model small enough to make in a test: the photo's mean colour as light from everywhere."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from deeplight.cli.main import main
from deeplight.contract import CONTRACT_KEY, ModelContract


def write_tiny_model(path: Path, contract_json: str | None, light_size: int = 32) -> Path:
    """Write a network whose ln radiance is 2.2 ln(mean pixel) plus a fixed lamp up on the right."""
    onnx = pytest.importorskip("onnx")
    lamp = np.zeros((1, 3, light_size, light_size), np.float32)
    lamp[:, :, light_size // 4, 3 * light_size // 4] = 5
    constants = {
        "axes": np.array([2, 3], np.int64),
        "half": np.float32(0.5),
        "black": np.float32(1e-3),
        "gamma": np.float32(2.2),
        "lamp": lamp,
    }
    node = onnx.helper.make_node
    graph = onnx.helper.make_graph(
        [
            node("ReduceMean", ["photo", "axes"], ["mean"], keepdims=1),
            node("Add", ["mean", "half"], ["pixel"]),
            node("Max", ["pixel", "black"], ["lit"]),
            node("Log", ["lit"], ["logarithm"]),
            node("Mul", ["logarithm", "gamma"], ["colour"]),
            node("Add", ["colour", "lamp"], ["log_radiance"]),
        ],
        "tiny",
        [onnx.helper.make_tensor_value_info("photo", 1, ["N", 3, 192, 135])],
        [onnx.helper.make_tensor_value_info("log_radiance", 1, ["N", 3, light_size, light_size])],
        [onnx.numpy_helper.from_array(np.asarray(v), k) for k, v in constants.items()],
    )
    model = onnx.helper.make_model(graph, opset_imports=[onnx.helper.make_opsetid("", 18)])
    model.ir_version = 9
    if contract_json is not None:
        onnx.helper.set_model_props(model, {CONTRACT_KEY: contract_json})
    onnx.save(model, path)
    return path


@pytest.fixture(scope="session")
def tiny_model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model file that keeps the contract and takes no time."""
    path = tmp_path_factory.mktemp("model") / "tiny.onnx"
    return write_tiny_model(path, ModelContract(trained_on="nothing").to_json())


@pytest.fixture
def photos(tmp_path: Path) -> Path:
    """A folder with one ordinary photo, `scene.jpg`."""
    folder = tmp_path / "photos"
    folder.mkdir()
    pixels = np.random.default_rng(0).integers(0, 256, (24, 18, 3), dtype=np.uint8)
    Image.fromarray(pixels).resize((360, 480)).save(folder / "scene.jpg")
    return folder


@pytest.fixture
def estimate(tiny_model: Path, tmp_path: Path):
    """Run the command on some paths with the tiny model; results go to `out`.

    The environment is a small one, which takes less time, where no size is asked for; the preview,
    which takes longer than all the rest, is black unless it is to be `drawn`.
    """

    def run(
        *words: object, model: Path = tiny_model, small: bool = True, drawn: bool = False
    ) -> int:
        size = ["--height", "64"] if small and not {"--height", "--light-only"} & set(words) else []
        more = [*size, "--out", str(tmp_path / "out"), "--model", str(model)]
        with pytest.MonkeyPatch.context() as patch:
            if not drawn:
                black = np.zeros((8, 8, 3), np.uint8)
                patch.setattr("deeplight.estimators.results.preview", lambda *_: black)
            return main(["estimate", *map(str, words), *more])

    return run
