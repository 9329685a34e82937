"""Checkpoints come back as they were written, and only whole."""

import pytest
import torch
from safetensors import SafetensorError
from torch import nn

from deeplight.errors import ModelError
from deeplight.training import checkpoint
from deeplight.training.optimiser import MovingAverage

HEADER = checkpoint.Header(7, float("inf"), {"loss.form": "paper", "a.b": [1, 2]}, "abc")


def trained(steps, network, optimiser):
    for step in range(steps):
        torch.manual_seed(step)
        optimiser.zero_grad()
        network(torch.randn(4, 3, 5, 5)).square().mean().backward()
        optimiser.step()


def network_and_optimiser():
    torch.manual_seed(0)
    network = nn.Sequential(nn.Conv2d(3, 4, 3), nn.BatchNorm2d(4)).to(
        memory_format=torch.channels_last
    )
    return network, torch.optim.AdamW(network.parameters(), lr=0.01, fused=True)


def test_a_restored_optimiser_goes_on_as_if_nothing_had_happened(tmp_path):
    network, optimiser = network_and_optimiser()
    trained(3, network, optimiser)
    path = tmp_path / "c.safetensors"
    checkpoint.save(
        path, HEADER, network=network.state_dict(), optimiser=checkpoint.optimiser_state(optimiser)
    )
    trained(2, network, optimiser)

    header, states = checkpoint.load(path)
    restored, restored_optimiser = network_and_optimiser()
    restored.load_state_dict(states["network"])
    checkpoint.load_optimiser(restored_optimiser, states["optimiser"])
    trained(2, restored, restored_optimiser)
    assert header == HEADER
    for name, value in network.state_dict().items():
        assert torch.equal(value, restored.state_dict()[name])


@pytest.mark.parametrize("content", [b"", b"not a checkpoint", b"\x80\x04pickle" * 20])
def test_another_file_is_refused(tmp_path, content):
    path = tmp_path / "c.safetensors"
    path.write_bytes(content)
    with pytest.raises(ModelError):
        checkpoint.load(path)


def test_the_newest_two_are_kept(tmp_path):
    assert checkpoint.latest(tmp_path) is None
    for step in (5, 1000, 20, 999):
        checkpoint.save(checkpoint.checkpoint_path(tmp_path, step), HEADER)
    checkpoint.remove_old(tmp_path)
    assert sorted(p.name for p in (tmp_path / "checkpoints").iterdir()) == [
        "step-00000999.safetensors",
        "step-00001000.safetensors",
    ]
    assert checkpoint.latest(tmp_path) == checkpoint.checkpoint_path(tmp_path, 1000)


def test_the_moving_average_follows_parameters_and_copies_statistics():
    network, optimiser = network_and_optimiser()
    average = MovingAverage(network, 0.9)
    before = {name: value.clone() for name, value in average.state.items()}
    trained(1, network, optimiser)
    average.update(network, step=1000)
    now = network.state_dict()
    expected = before["0.weight"] + 0.1 * (now["0.weight"] - before["0.weight"])
    torch.testing.assert_close(average.state["0.weight"], expected)
    assert torch.equal(average.state["1.running_mean"], now["1.running_mean"])


def test_without_decay_the_average_is_the_network():
    network, optimiser = network_and_optimiser()
    average = MovingAverage(network, 0.0)
    trained(2, network, optimiser)
    average.update(network, step=1)
    for name, value in network.state_dict().items():
        assert torch.equal(average.state[name], value)


def test_a_checkpoint_that_cannot_be_written_is_the_systems_error(tmp_path, monkeypatch):
    def full(tensors, path, metadata):
        path.write_bytes(b"half")
        raise SafetensorError("No space left on device")

    monkeypatch.setattr(checkpoint, "save_file", full)
    with pytest.raises(OSError, match="No space left"):
        checkpoint.save(tmp_path / "c.safetensors", HEADER, network={"a": torch.zeros(1)})
    assert list(tmp_path.iterdir()) == []
