"""Small networks for tests of files that hold them."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import torch

from deeplight.cli.main import main
from deeplight.contract import ModelContract
from deeplight.deploy.onnx import export_onnx
from deeplight.training import checkpoint, model_file, slim
from deeplight.training.config import TrainConfig, flatten
from deeplight.training.network import mobilenet_v2
from deeplight.training.network.generator import Generator
from deeplight.training.presets import preset


@contextmanager
def shallow() -> Iterator[None]:
    """Networks of one block a stage while it lasts, six of sixteen: a third of the time to export.

    For laws of files that hold for any depth; that the whole network comes back from one is tested
    in `tests/parity/test_onnx.py` and on the golden file.
    """
    stages = tuple((expansion, wide, 1, by) for expansion, wide, _, by in mobilenet_v2.STAGES)
    with pytest.MonkeyPatch.context() as patch:
        for module in (mobilenet_v2, model_file, slim):
            patch.setattr(module, "STAGES", stages)
        yield


def written_shallow(network: Callable[[], Generator], contract: ModelContract, path: Path) -> Path:
    """Export what `network` makes of few blocks, in full precision."""
    with shallow():
        export_onnx(network(), contract, path, float16=False)
    return path


def lamps_network() -> tuple[Generator, TrainConfig]:
    """A network with lamps and few channels, of random weights: always the same ones."""
    torch.manual_seed(0)
    config = preset("lamps-width035", ["network.output_size=16", "network.latent_size=16"])
    return Generator(config.network).eval(), config


def write_mean(folder: Path, *more: str) -> Path:
    """Export that network, as the best of a run, with `more` words of `deeplight export`."""
    generator, config = lamps_network()
    header = checkpoint.Header(5, 0.1, flatten(config), "abc")
    checkpoint.save(folder / "run" / checkpoint.BEST, header, generator=generator.state_dict())
    out = folder / "mean.onnx"
    assert main(["export", str(folder / "run"), *more, "--out", str(out)]) == 0
    return out
