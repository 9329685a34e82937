"""Small networks for tests of files that hold them."""

from pathlib import Path

import torch

from deeplight.cli.main import main
from deeplight.training import checkpoint
from deeplight.training.config import TrainConfig, flatten
from deeplight.training.network.generator import Generator
from deeplight.training.presets import preset


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
