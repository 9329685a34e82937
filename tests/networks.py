"""Small networks for tests of files that hold them."""

import copy
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
import torch
from onnx import ModelProto
from onnx.numpy_helper import from_array
from torch import nn

from deeplight.cli.main import main
from deeplight.contract import HEADS, ModelContract
from deeplight.deploy import onnx
from deeplight.training import checkpoint, model_file, slim
from deeplight.training.config import TrainConfig, flatten
from deeplight.training.network import mobilenet_v2
from deeplight.training.network.generator import Generator, NetworkConfig
from deeplight.training.presets import preset

SMALL = NetworkConfig(
    latent_size=32,
    decoder_widths=(8, 8),
    encoder_norm="none",
    decoder_norm="none",
    width=0.35,
    lamps=3,
    brightness=0.9,
    colour=True,
)
EVERYTHING = replace(SMALL, heads=True, mirrored=True)
EVERYTHING_CONTRACT = ModelContract(
    lamps=3, brightness=0.9, heads=HEADS, mirrored=True, trained_on="nothing"
)


@contextmanager
def shallow() -> Iterator[None]:
    """Networks of one block a stage while it lasts, six of sixteen: a third of the time to export.

    For laws of files that hold for any depth; that the whole network comes back from one is tested
    on the shipped file, and by the long tests of `tests/parity/test_onnx.py`.
    """
    stages = tuple((expansion, wide, 1, by) for expansion, wide, _, by in mobilenet_v2.STAGES)
    with pytest.MonkeyPatch.context() as patch:
        for module in (mobilenet_v2, model_file, slim):
            patch.setattr(module, "STAGES", stages)
        yield


def random_network(config: NetworkConfig, seed: int = 0) -> Generator:
    """A network whose lamps and colour differ from photo to photo, as those of a trained one."""
    torch.manual_seed(seed)
    made = Generator(config).eval()
    if made.lamps is not None:
        nn.init.normal_(made.lamps.head.weight, std=0.1)
    if made.colour is not None:
        nn.init.normal_(made.colour.weight, std=0.1)
    return made


_honest, _traces = onnx.traced, dict[str, ModelProto]()


def traced_once(network: nn.Module, contract: ModelContract) -> ModelProto:
    """Stand in for `deploy.onnx.traced`, which takes seconds: layers that were traced before get
    these weights, by name."""
    key = f"{network} {contract}"
    if key not in _traces:
        _traces[key] = _honest(network, contract)
    model, weights = copy.deepcopy(_traces[key]), network.state_dict()
    for stored in model.graph.initializer:
        if stored.name in weights:
            stored.CopyFrom(from_array(weights[stored.name].numpy(), stored.name))
    return model


def lamps_network() -> tuple[Generator, TrainConfig]:
    """A network with lamps and few channels, of random weights: always the same ones."""
    torch.manual_seed(0)
    small = ["network.output_size=16", "network.latent_size=16", "network.mirrored=false"]
    config = preset("lamps-width035", small)
    return Generator(config.network).eval(), config


def write_mean(folder: Path, *more: str) -> Path:
    """Export that network, as the best of a run, with `more` words of `deeplight export`."""
    generator, config = lamps_network()
    header = checkpoint.Header(5, 0.1, flatten(config), "abc")
    checkpoint.save(folder / "run" / checkpoint.BEST, header, generator=generator.state_dict())
    out = folder / "mean.onnx"
    assert main(["export", str(folder / "run"), *more, "--out", str(out)]) == 0
    return out
