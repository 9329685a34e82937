"""A hue built into a network: a gain per channel for all of its light, and nothing else."""

import pytest
import torch

from deeplight.errors import ConfigError
from deeplight.sphere import PAPER_RIG
from deeplight.training.batches import Batch
from deeplight.training.generator import Generator, NetworkConfig, fold_batch_norm
from deeplight.training.losses import RigBases, encode, soft_clip
from deeplight.training.tint import HUES, hue_gap, ridge, tinted

CONFIG = NetworkConfig(width=0.35, latent_size=32, decoder_widths=(8, 6))


@pytest.fixture(scope="module")
def network():
    torch.manual_seed(3)
    generator = Generator(CONFIG)
    fold_batch_norm(generator)
    return generator


def some_photos(count=3):
    torch.manual_seed(4)
    return torch.rand(count, 3, 192, 135) - 0.5


def test_hues_are_apart_from_grey_and_from_each_other():
    torch.testing.assert_close(HUES @ HUES.T, torch.eye(2))
    torch.testing.assert_close(HUES.sum(1), torch.zeros(2), atol=1e-6, rtol=0)


@pytest.mark.parametrize("size", [16, 32])
@torch.no_grad()
def test_the_light_has_another_hue_and_is_else_the_same(size):
    torch.manual_seed(5)
    network = Generator(NetworkConfig(width=0.35, latent_size=32, output_size=size))
    fold_batch_norm(network)
    photos = some_photos()
    features = network.encoder(photos)
    means = features.mean((2, 3))
    weights, offsets = 0.02 * torch.randn(2, means.shape[1]), torch.tensor([0.3, -0.2])
    hue = means @ weights.T + offsets
    assert hue.abs().max() < 1.5
    made = tinted(network, weights, offsets)
    expected = network(photos) + (hue @ HUES)[:, :, None, None]
    torch.testing.assert_close(made(photos), expected, atol=2e-5, rtol=1e-5)
    assert (made(photos) - network(photos)).abs().max() > 0.05  # one that does nothing would fail
    torch.testing.assert_close(made(photos).mean(1), network(photos).mean(1), atol=2e-5, rtol=0)


@torch.no_grad()
def test_no_hue_changes_nothing(network):
    photos = some_photos()
    made = tinted(network, torch.zeros(2, 56), torch.zeros(2))
    torch.testing.assert_close(made(photos), network(photos), atol=2e-5, rtol=1e-5)


@torch.no_grad()
def test_what_is_filmed_under_tinted_light_is_learnt(network):
    """The spheres as the network renders them, tinted by what a feature map says."""
    photos = (some_photos(40) * 40 + 128).clamp(0, 255).byte().permute(0, 2, 3, 1).contiguous()
    photos += (torch.rand(40, 1, 1, 3) * 100).byte()
    bases, rig = RigBases.from_rigs([PAPER_RIG]), torch.zeros(40, dtype=torch.long)
    seen = network.encoder(photos.permute(0, 3, 1, 2).float() / 255 - 0.5)
    means = seen.mean((2, 3))
    told = (means[:, :2] - means[:, :2].mean(0)) / means[:, :2].std(0) * 0.1 + 0.05
    light = network.decoded(seen) + (told @ HUES)[:, :, None, None]
    pixels = encode(soft_clip(bases.render(light, rig))).clamp(0, 1)
    spheres = (pixels * 255).round().byte().transpose(2, 3).unflatten(2, (32, 32))
    features, gaps = hue_gap(network, bases, Batch(photos, spheres, rig))
    torch.testing.assert_close(features, means)
    assert (gaps - told).abs().max() < 0.03  # bytes, the soft clip and DARK
    weights, offsets = ridge(features.repeat(200, 1), gaps.repeat(200, 1))
    left = gaps - features @ weights.T - offsets
    assert left.std() < 0.7 * gaps.std()
    assert left.mean(0).abs().max() < 1e-4  # the mean is not shrunk


def test_networks_that_cannot_carry_it_are_refused():
    with pytest.raises(ConfigError, match="without batch norm"):
        tinted(Generator(CONFIG), torch.zeros(2, 56), torch.zeros(2))
