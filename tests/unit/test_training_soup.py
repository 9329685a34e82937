"""Averaged weights: between their parts, and only of one network."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from deeplight.errors import ModelError
from deeplight.training import checkpoint
from deeplight.training.config import TrainConfig, flatten
from deeplight.training.model_file import load_network
from deeplight.training.network.generator import Generator, NetworkConfig
from deeplight.training.weight_averaging import average_weights

SMALL = NetworkConfig(width=0.35, output_size=16, latent_size=16)


def saved(path: Path, seed: int, config: NetworkConfig = SMALL) -> Path:
    torch.manual_seed(seed)
    states = Generator(config).state_dict()
    for value in states.values():
        if not value.is_floating_point():
            value.fill_(7)
    header = checkpoint.Header(7, 0.5, flatten(TrainConfig(network=config)), "data")
    checkpoint.save(path, header, generator=states)
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
        if not value.is_floating_point():  # how many batches a norm saw
            expected = expected.round().to(value.dtype)
        torch.testing.assert_close(value, expected, rtol=1e-5, atol=1e-6)
    apart = max(abs(soup["generator"][n] - first[n]).max() for n in first)
    assert apart > 0.01  # a mean that is its first part would not pass
    Generator(SMALL).load_state_dict(soup["generator"])


def test_the_mean_of_equal_parts_is_the_part_in_any_order(tmp_path: Path) -> None:
    a, b = saved(tmp_path / "a.safetensors", 1), saved(tmp_path / "b.safetensors", 2)
    soups = []
    for parts in ([(a, 0.7), (a, 0.3)], [(a, 2.0), (b, 1.0)], [(b, 0.1), (a, 0.2)]):
        average_weights(parts, tmp_path / "soup.safetensors")
        soups.append(checkpoint.load(tmp_path / "soup.safetensors")[1]["generator"])
    part = checkpoint.load(a)[1]["generator"]
    for name, value in part.items():
        torch.testing.assert_close(soups[0][name], value, rtol=1e-6, atol=1e-7)
        torch.testing.assert_close(soups[1][name], soups[2][name], rtol=1e-5, atol=1e-6)


@torch.no_grad()
def test_of_a_checkpoint_the_averaged_weights_are_taken(tmp_path: Path) -> None:
    now, mean = saved(tmp_path / "now.safetensors", 1), saved(tmp_path / "mean.safetensors", 2)
    header, states = checkpoint.load(now)
    average = checkpoint.load(mean)[1]["generator"]
    path = tmp_path / "step-00000007.safetensors"
    checkpoint.save(path, header, generator=states["generator"], average=average)
    photo = torch.rand(1, 3, 192, 135) - 0.5
    found, wanted, other = (load_network(file)[0](photo) for file in (path, mean, now))
    torch.testing.assert_close(found, wanted)
    assert (found - other).abs().max() > 1e-3
    average_weights([(path, 1.0)], tmp_path / "soup.safetensors")
    torch.testing.assert_close(load_network(tmp_path / "soup.safetensors")[0](photo), wanted)


def test_networks_for_other_photos_are_not_mixed(tmp_path: Path) -> None:
    """Their weights have the same shapes."""
    a = saved(tmp_path / "a.safetensors", 1)
    b = saved(tmp_path / "b.safetensors", 1, replace(SMALL, orientation="landscape"))
    with pytest.raises(ModelError, match="another network"):
        average_weights([(a, 1.0), (b, 1.0)], tmp_path / "soup.safetensors")
    assert not (tmp_path / "soup.safetensors").exists()


def test_another_network_and_no_share_are_refused(tmp_path: Path) -> None:
    a = saved(tmp_path / "a.safetensors", 1)
    other = NetworkConfig(width=0.35, output_size=32, latent_size=16)
    b = saved(tmp_path / "b.safetensors", 1, other)
    for parts in ([(a, 1.0), (b, 1.0)], [(a, 1.0), (a, 0.0)], []):
        with pytest.raises(ModelError):
            average_weights(parts, tmp_path / "soup.safetensors")
    assert not (tmp_path / "soup.safetensors").exists()


@torch.no_grad()
def test_an_exported_network_can_be_a_part(root: Path, tmp_path: Path) -> None:
    a = root / "tests/golden/tiny.onnx"
    first, _ = load_network(a)
    with_norms = replace(SMALL, width=0.05, decoder_widths=(8, 8))  # as it was before its export
    b = saved(tmp_path / "b.safetensors", 2, with_norms)
    average_weights([(a, 1.0), (b, 3.0)], tmp_path / "soup.safetensors")
    soup, _ = load_network(tmp_path / "soup.safetensors")
    second, _ = load_network(b)
    for name, value in soup.state_dict().items():
        expected = 0.25 * first.state_dict()[name] + 0.75 * second.state_dict()[name]
        torch.testing.assert_close(value, expected, rtol=1e-4, atol=1e-5)
    with pytest.raises(ModelError, match="exported files only"):
        average_weights([(a, 1.0)], tmp_path / "other.safetensors")
