"""The network is the paper's (section 3.2, Implementation Details)."""

import math

import pytest
import torch
from torch import nn

from deeplight.training.network.generator import (
    PHOTO_SIZE,
    Generator,
    NetworkConfig,
    fold_batch_norm,
)
from deeplight.training.network.mobilenet_v2 import MobileNetV2Encoder, same_padding


def parameters(module):
    return sum(parameter.numel() for parameter in module.parameters())


def photos(orientation, n=4):
    generator = torch.Generator().manual_seed(0)
    return torch.rand(n, 3, *PHOTO_SIZE[orientation], generator=generator) - 0.5


def test_the_encoder_is_the_first_seventeen_layers_of_mobilenet_v2():
    encoder = MobileNetV2Encoder("batch")
    assert len(encoder.features) == 17
    # The published network has 3,504,872 parameters; its last block, last convolution and
    # classifier, which are not used, have 473,920 + 412,160 + 1,281,000.
    assert parameters(encoder) == 3_504_872 - 473_920 - 412_160 - 1_281_000


@pytest.mark.parametrize(("orientation", "grid"), [("portrait", (6, 5)), ("landscape", (5, 6))])
def test_sizes(orientation, grid):
    generator = Generator(NetworkConfig(orientation=orientation)).eval()
    with torch.no_grad():
        features = generator.encoder(photos(orientation))
        log_radiance = generator(photos(orientation))
    assert features.shape == (4, 160, *grid)
    assert generator.latent.weight.shape == (256, 4800)
    assert generator.decoder.channels == 16
    assert log_radiance.shape == (4, 3, 32, 32)


def test_batch_norm_follows_every_layer_but_the_last():
    generator = Generator()
    layers = [m for m in generator.modules() if isinstance(m, nn.Conv2d | nn.Linear)]
    norms = [m for m in generator.modules() if isinstance(m, nn.BatchNorm1d | nn.BatchNorm2d)]
    assert len(norms) == len(layers) - 1
    assert [
        layer for layer in layers if layer.bias is not None and isinstance(layer, nn.Conv2d)
    ] == [generator.decoder.up3]


def test_log_radiance_has_no_upper_bound():
    """A ReLU6 at the end would cap the sun at e^6."""
    generator = Generator().eval()
    with torch.no_grad():
        generator.decoder.up3.bias.fill_(11.0)
        assert generator(photos("portrait")).min() > 9.0


def test_it_starts_as_a_dim_room():
    torch.manual_seed(0)
    for norm in ("batch", "none"):
        generator = Generator(NetworkConfig(encoder_norm=norm, decoder_norm=norm))
        log_radiance = generator(photos("portrait")).detach()
        assert log_radiance.mean().item() == pytest.approx(math.log(0.3), abs=0.1)
        assert log_radiance.std() < 0.3


def test_strided_layers_see_what_tensorflows_see():
    """An even size is padded at its end alone, an odd one at both."""
    assert same_padding(192, 135) == (1, 1, 0, 1)
    encoder = MobileNetV2Encoder("none")
    sizes = []
    for layer in encoder.features:
        layer.register_forward_hook(lambda _m, _x, y: sizes.append(tuple(y.shape[2:])))
    with torch.no_grad():
        encoder(photos("portrait", 1))
    assert list(dict.fromkeys(sizes)) == [(96, 68), (48, 34), (24, 17), (12, 9), (6, 5)]


def test_frozen_blocks_do_not_learn():
    generator = Generator(freeze_blocks=9).train()
    before = {name: value.clone() for name, value in generator.state_dict().items()}
    generator(photos("portrait")).square().mean().backward()
    with torch.no_grad():
        for parameter in generator.parameters():
            if parameter.grad is not None:
                parameter.add_(parameter.grad + 1e-3)
    for name, value in generator.state_dict().items():
        parts = name.split(".")
        frozen = parts[:2] == ["encoder", "features"] and int(parts[2]) <= 9
        assert torch.equal(value, before[name]) == frozen, name


def test_folding_batch_norm_changes_nothing():
    generator = Generator()
    torch.manual_seed(0)
    for module in generator.modules():
        if isinstance(module, nn.BatchNorm1d | nn.BatchNorm2d):
            module.running_mean.normal_(0.0, 0.1)
            module.running_var.uniform_(0.5, 2.0)
            nn.init.uniform_(module.weight, 0.8, 1.2)
    generator.eval()
    with torch.no_grad():
        before = generator(photos("portrait", 2))
        fold_batch_norm(generator)
        after = generator(photos("portrait", 2))
    assert not any(isinstance(m, nn.BatchNorm1d | nn.BatchNorm2d) for m in generator.modules())
    torch.testing.assert_close(after, before, atol=1e-4, rtol=0)
