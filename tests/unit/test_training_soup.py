"""Averaged weights: between their parts, and only of one network."""

from pathlib import Path

import pytest
import torch

from deeplight.errors import ModelError
from deeplight.training import checkpoint
from deeplight.training.config import TrainConfig, flatten
from deeplight.training.generator import Generator, NetworkConfig
from deeplight.training.soup import average_weights

SMALL = NetworkConfig(width=0.35, output_size=16, latent_size=16)


def saved(path: Path, seed: int, config: NetworkConfig = SMALL) -> Path:
    torch.manual_seed(seed)
    header = checkpoint.Header(7, 0.5, flatten(TrainConfig(network=config)), "data")
    checkpoint.save(path, header, generator=Generator(config).state_dict())
    return path


def test_the_mean_lies_between_its_parts(tmp_path: Path) -> None:
    a, b = saved(tmp_path / "a.safetensors", 1), saved(tmp_path / "b.safetensors", 2)
    header = average_weights([(a, 3.0), (b, 1.0)], tmp_path / "soup.safetensors")
    assert header.step == 7
    assert header.best_score == float("inf")
    _, soup = checkpoint.load(tmp_path / "soup.safetensors")
    first, second = (checkpoint.load(path)[1]["generator"] for path in (a, b))
    for name, value in soup["generator"].items():
        assert value.dtype == first[name].dtype
        expected = 0.75 * first[name] + 0.25 * second[name]
        torch.testing.assert_close(value, expected.to(value.dtype), rtol=1e-5, atol=1e-6)
    apart = max(abs(soup["generator"][n] - first[n]).max() for n in first)
    assert apart > 0.01  # a mean that is its first part would not pass
    Generator(SMALL).load_state_dict(soup["generator"])


def test_another_network_and_no_share_are_refused(tmp_path: Path) -> None:
    a = saved(tmp_path / "a.safetensors", 1)
    other = NetworkConfig(width=0.35, output_size=32, latent_size=16)
    b = saved(tmp_path / "b.safetensors", 1, other)
    for parts in ([(a, 1.0), (b, 1.0)], [(a, 1.0), (a, 0.0)], []):
        with pytest.raises(ModelError):
            average_weights(parts, tmp_path / "soup.safetensors")
    assert not (tmp_path / "soup.safetensors").exists()
