"""The exported file computes what torch computes, and says how to call it."""

import copy
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import onnx
import onnxruntime
import pytest
import torch
from torch import nn

from deeplight.contract import CONTRACT_KEY, ModelContract
from deeplight.deploy.onnx import ready_to_trace, store_as_float16, traced, write_model
from deeplight.errors import ModelError
from deeplight.training.network.generator import Generator, NetworkConfig
from networks import shallow

pytestmark = pytest.mark.needs("onnxscript")

CONTRACT = ModelContract(trained_on="nothing yet")


@pytest.fixture(
    scope="module", params=["few blocks", pytest.param("whole", marks=pytest.mark.slow)]
)
def generator(request):
    with shallow() if request.param == "few blocks" else nullcontext():
        yield as_if_trained()


def as_if_trained():
    # He's weights keep the size of signals; random weights behind batch norm would be chaotic
    # and blow up rounding errors as no trained network does. Folding is tested on its own.
    torch.manual_seed(0)
    generator = Generator(NetworkConfig(encoder_norm="none", decoder_norm="none")).eval()
    nn.init.normal_(generator.decoder.up3.weight, std=0.1)  # the spread of a trained network
    return generator


@pytest.fixture(scope="module")
def model(generator):
    return traced(generator, CONTRACT)


@pytest.fixture(scope="module")
def files(model, tmp_path_factory):
    folder = tmp_path_factory.mktemp("onnx")
    for half in (False, True):
        write_model(copy.deepcopy(model), CONTRACT, folder / f"{half}.onnx", half)
    return {half: folder / f"{half}.onnx" for half in (False, True)}


def run(path, photo):
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    return session.run(None, {"photo": photo})[0]


def photos(n, seed=0):
    """Smooth pictures, each of its own colour: noise would differ in nothing a network sees."""
    random = np.random.default_rng(seed)
    coarse = torch.from_numpy(
        random.uniform(0, 1, (n, 3, 4, 3)) * random.uniform(0, 1, (n, 3, 1, 1))
    )
    photo = nn.functional.interpolate(coarse, (192, 135), mode="bicubic").clamp(0, 1) - 0.5
    return photo.float().numpy()


@pytest.mark.parametrize(("half", "bound"), [(False, 1e-4), (True, 0.05)])
@pytest.mark.parametrize("n", [1, 3])
def test_onnxruntime_computes_what_torch_computes(generator, files, half, bound, n):
    with torch.no_grad():
        expected = generator(torch.from_numpy(photos(n))).numpy()
    found = run(files[half], photos(n))
    assert found.dtype == np.float32
    assert expected.std() > 0.2
    np.testing.assert_allclose(found, expected, atol=bound, rtol=0)
    other = run(files[half], photos(n, seed=1))  # the twin that must fail
    assert np.abs(other - expected).max() > bound


def test_half_the_file(files):
    sizes = {half: path.stat().st_size for half, path in files.items()}
    assert sizes[True] < 0.55 * sizes[False]
    assert sizes[True] < 15e6


def test_the_contract_is_inside(files):
    for path in files.values():
        stored = {entry.key: entry.value for entry in onnx.load(path).metadata_props}
        assert ModelContract.from_json(stored[CONTRACT_KEY]) == CONTRACT


def test_a_weight_beyond_half_precision_is_refused(model):
    broken = copy.deepcopy(model)
    name = next(t for t in broken.graph.initializer if len(t.dims) == 4)
    values = onnx.numpy_helper.to_array(name).copy()
    values[0, 0, 0, 0] = 1e6
    name.CopyFrom(onnx.numpy_helper.from_array(values, name.name))
    with pytest.raises(ModelError, match="65504"):
        store_as_float16(broken)


def test_a_model_file_says_nothing_of_the_machine_that_made_it(files):
    for path in files.values():
        content = path.read_bytes()
        assert b"mobilenet_v2.py" not in content
        assert b"stack_trace" not in content
        assert str(Path(__file__).parents[2]).encode() not in content


def test_the_shipped_model_says_nothing_of_it_either(root):
    content = (root / "src" / "deeplight" / "weights" / "deeplight.onnx").read_bytes()
    assert b".py" not in content
    assert b"stack_trace" not in content


def test_a_network_is_left_as_it_was_when_tracing_fails():
    """Training that exports now and then must go on with what it had."""
    generator = Generator(NetworkConfig(width=0.35)).train()
    layers = [module for module in generator.modules() if isinstance(module, nn.ReLU6)]
    before = [layer.inplace for layer in layers]
    assert True in before
    with pytest.raises(ZeroDivisionError):
        fail_to_trace(generator)
    assert generator.training
    assert [layer.inplace for layer in layers] == before


def fail_to_trace(generator):
    with ready_to_trace(generator):
        assert not generator.training
        assert not any(m.inplace for m in generator.modules() if isinstance(m, nn.ReLU6))
        raise ZeroDivisionError
