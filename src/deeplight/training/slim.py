"""A narrower network, or one with another output size, that starts as near a trained one as it can.

ImageNet weights exist for width 1.0 only. So the narrow network is fitted layer by layer, by least
squares, to what the wide one computes on some photos (as He et al., "Channel Pruning for
Accelerating Very Deep Neural Networks", ICCV 2017, do for channels left out):

- Between the blocks the signal is linear: of each stage its principal components are kept.
- Inside a block the channels with the largest effect on its output are kept with their depthwise
  filters; the 1x1 convolutions around these are fitted.
"""

from dataclasses import replace

import torch
from jaxtyping import Float, Int
from torch import Tensor, nn
from torch.nn import functional

from deeplight.errors import ConfigError
from deeplight.training.distil import lit_share, resized
from deeplight.training.network.generator import Generator, NetworkConfig
from deeplight.training.network.imagenet import named_convolutions, output_moments
from deeplight.training.network.lamps import DIMMER
from deeplight.training.network.mobilenet_v2 import (
    STAGES,
    ConvNorm,
    InvertedResidual,
    MobileNetV2Encoder,
)

RIDGE = 1e-3
"""Added to the variance of each input of a fit, as a share of their mean."""
FITTED_PHOTOS = 64
"""The last layer, whose output is large, is fitted on this number of the photos."""


@torch.no_grad()
def start_from(
    generator: Generator, config: NetworkConfig, wide: Generator, photos: Tensor
) -> None:
    """Give `generator` weights with which it imitates `wide` on `photos`.

    Args:
        generator: a new network of the shape of `config`.
        wide: a trained network without batch norm, in evaluation mode.
        photos: a few hundred, (n, 3, height, width) in [-0.5, 0.5].

    Raises:
        ConfigError: the two differ in more than width, output size and norms.
    """
    plain = Generator(without_norm(config)).eval()
    refuse_other_shape(plain, wide)
    if shapes_of(plain.encoder) == shapes_of(wide.encoder):
        plain.encoder.load_state_dict(wide.encoder.state_dict())
        copy_latent(plain, wide)
    else:
        basis, features = fit_encoder(plain.encoder, wide.encoder, photos)
        project_latent(plain, wide, basis, features)
    fit_decoder(plain, wide, photos)
    add_norms(generator, plain, photos)


def without_norm(config: NetworkConfig) -> NetworkConfig:
    """The same network with batch norm folded, read in one direction only."""
    return replace(config, encoder_norm="none", decoder_norm="none", mirrored=False, heads=False)


def shapes_of(module: nn.Module) -> list[torch.Size]:
    """The shapes of its weights: two widths may well begin with equally many channels."""
    return [parameter.shape for parameter in module.parameters()]


def refuse_other_shape(narrow: Generator, wide: Generator) -> None:
    """Only the encoder's channels and the output's size may differ."""
    for what, of in (
        ("latent_size", lambda g: g.latent.out_features),
        ("decoder_widths", lambda g: g.decoder.up1.conv.out_channels),
        ("lamps", lambda g: lamps_next_to(g, wide)),
        ("components", lambda g: 0 if g.mixture is None else len(g.mixture.components)),
    ):
        if of(narrow) != of(wide):
            raise ConfigError(
                f"network.{what} as the network it starts from has it, {of(wide)}",
                f"{of(narrow)}",
                "change it with --set, take another --preset (lamps for shipped), or other weights",
            )
    pairs = zip(shapes_of(narrow.encoder), shapes_of(wide.encoder), strict=True)
    if any(ours[0] > theirs[0] for ours, theirs in pairs):
        do = "lower it with --set, or take another teacher"
        raise ConfigError("network.width of at most the teacher's", "a wider network", do)


def lamps_next_to(generator: Generator, wide: Generator) -> int:
    """Lamps that must be as many as the teacher's; it may have none."""
    return 0 if generator.lamps is None or wide.lamps is None else generator.lamps.count


def fit_encoder(
    narrow: MobileNetV2Encoder, wide: MobileNetV2Encoder, photos: Tensor
) -> tuple[Tensor, Tensor]:
    """Fit all blocks, first to last; gives the last basis (channels, fewer) and wide features."""
    (stem, first), (thin_stem, thin_first) = ends_of(wide), ends_of(narrow)
    flow: Tensor = stem(photos)
    effect = first.project.conv.weight[:, :, 0, 0]
    kept = strongest(first.depthwise(flow), effect, thin_stem.conv.out_channels)
    copy_channels(thin_stem.conv, stem.conv, kept)
    copy_channels(thin_first.depthwise.conv, first.depthwise.conv, kept)
    thin, layer = thin_stem(photos), 1
    for _, _, blocks, _ in STAGES:
        numbers = range(layer, layer + blocks)
        flows = [flow]
        for number in numbers:
            flows.append(wide.features[number](flows[-1]))
        basis = principal(flows[1:], block_of(narrow, layer).project.conv.out_channels)
        for number, x, y in zip(numbers, flows, flows[1:], strict=False):
            thin = fit_block(block_of(narrow, number), block_of(wide, number), thin, x, y, basis)
        layer, flow = layer + blocks, flows[-1]
    return basis, flow


def ends_of(encoder: MobileNetV2Encoder) -> tuple[ConvNorm, InvertedResidual]:
    """The stem and the first block."""
    stem = encoder.features[0]
    assert isinstance(stem, ConvNorm)
    return stem, block_of(encoder, 1)


def block_of(encoder: MobileNetV2Encoder, number: int) -> InvertedResidual:
    """A block by its number, from 1."""
    block = encoder.features[number]
    assert isinstance(block, InvertedResidual)
    return block


def fit_block(
    narrow: InvertedResidual,
    wide: InvertedResidual,
    thin: Tensor,
    x: Tensor,
    y: Tensor,
    basis: Float[Tensor, "channels fewer"],
) -> Tensor:
    """Fit one block; gives its output.

    Args:
        thin: what flows into the narrow block.
        x, y: what flows into the wide block and out of it.
        basis: y is wanted in it.
    """
    if isinstance(wide.expand, ConvNorm) and isinstance(narrow.expand, ConvNorm):
        effect = basis.T @ wide.project.conv.weight[:, :, 0, 0]
        count = narrow.depthwise.conv.out_channels
        kept = strongest(wide.depthwise(wide.expand(x)), effect, count)
        fit_pointwise(narrow.expand.conv, thin, wide.expand.conv(x)[:, kept])
        copy_channels(narrow.depthwise.conv, wide.depthwise.conv, kept)
    wanted = torch.einsum("nchw,cf->nfhw", y, basis)
    hidden = narrow.depthwise(narrow.expand(thin))
    fit_pointwise(narrow.project.conv, hidden, wanted - thin if narrow.residual else wanted)
    out: Tensor = narrow(thin)
    return out


def strongest(
    hidden: Float[Tensor, "n c h w"], effect: Float[Tensor, "out c"], count: int
) -> Int[Tensor, "kept"]:
    """The channels that move a block's output most: their spread times their weights' length."""
    moved = hidden.std((0, 2, 3)) * effect.norm(dim=0)
    return moved.topk(count).indices.sort().values


def principal(flows: list[Tensor], count: int) -> Float[Tensor, "channels fewer"]:
    """Orthonormal directions of largest variance of all positions of some feature maps."""
    rows = torch.cat([flow.transpose(0, 1).flatten(1) for flow in flows], 1)
    _, vectors = torch.linalg.eigh(torch.cov(rows.double()))
    return vectors[:, -count:].float()


def copy_channels(narrow: nn.Conv2d, wide: nn.Conv2d, kept: Int[Tensor, "kept"]) -> None:
    """The filters and biases of some output channels."""
    narrow.weight.copy_(wide.weight[kept])
    if narrow.bias is not None and wide.bias is not None:
        narrow.bias.copy_(wide.bias[kept])


def fit_pointwise(conv: nn.Conv2d, x: Tensor, y: Tensor) -> None:
    """The 1x1 convolution that is nearest to giving y for x."""
    weight, bias = least_squares(x.transpose(0, 1).flatten(1), y.transpose(0, 1).flatten(1))
    conv.weight.copy_(weight[:, :, None, None])
    if conv.bias is not None:
        conv.bias.copy_(bias)


def least_squares(
    x: Float[Tensor, "c rows"], y: Float[Tensor, "d rows"]
) -> tuple[Float[Tensor, "d c"], Float[Tensor, "d"]]:
    """(weight, bias) of the ridge regression y = weight x + bias."""
    x_mean, y_mean = x.mean(1), y.mean(1)
    centred = x - x_mean[:, None]
    spread = (centred @ centred.T).double() / x.shape[1]
    shared = (centred @ (y - y_mean[:, None]).T).double() / x.shape[1]
    spread.diagonal().add_(RIDGE * spread.diagonal().mean() + 1e-12)
    weight = torch.linalg.solve(spread, shared).T.float()
    return weight, y_mean - weight @ x_mean


def project_latent(narrow: Generator, wide: Generator, basis: Tensor, features: Tensor) -> None:
    """The fully connected layer on the projected features; what is lost stays at its mean."""
    assert isinstance(wide.latent, nn.Linear)
    assert isinstance(narrow.latent, nn.Linear)
    weight = wide.latent.weight.reshape(len(wide.latent.weight), len(basis), -1)  # (256, 160, 30)
    mean = features.mean(0).flatten(1)
    lost = mean - basis @ (basis.T @ mean)
    narrow.latent.weight.copy_(torch.einsum("lcp,cf->lfp", weight, basis).flatten(1))
    narrow.latent.bias.copy_(wide.latent.bias + torch.einsum("lcp,cp->l", weight, lost))


def copy_latent(narrow: Generator, wide: Generator) -> None:
    """The fully connected layer; for photos of the other shape its weights are stretched to theirs.

    Left stays left and top stays top, and so does the sum of the weights of each channel.
    """
    assert isinstance(wide.latent, nn.Linear)
    assert isinstance(narrow.latent, nn.Linear)
    old, new = wide.feature_size, narrow.feature_size
    weight = wide.latent.weight
    maps = weight.reshape(len(weight), -1, *old)  # (256, 160, 6, 5)
    if old != new:
        stretched = functional.interpolate(maps, new, mode="bilinear", align_corners=False)
        maps = stretched + (maps.mean((2, 3)) - stretched.mean((2, 3)))[:, :, None, None]
    narrow.latent.weight.copy_(maps.flatten(1))
    narrow.latent.bias.copy_(wide.latent.bias)


def fit_decoder(narrow: Generator, wide: Generator, photos: Tensor) -> None:
    """Layers that both have are copied; the last one is fitted where the sizes differ."""
    size = narrow.output_size
    theirs = dict(wide.decoder.named_children())
    for name, layer in narrow.decoder.named_children():
        if name in theirs and (name != "up3" or size == wide.output_size):
            layer.load_state_dict(theirs[name].state_dict())
    if narrow.mixture is not None and wide.mixture is not None:
        narrow.mixture.mix.load_state_dict(wide.mixture.mix.state_dict())
        narrow.mixture.mean.copy_(resized(wide.mixture.mean[None], size)[0])
        whole = functional.interpolate(wide.mixture.components, (size, size), mode="area")
        narrow.mixture.components.copy_(whole)
    if narrow.lamps is not None:
        start_lamps(narrow, wide)
    if narrow.colour is not None and wide.colour is not None:
        narrow.colour.load_state_dict(wide.colour.state_dict())
    if size != wide.output_size:
        fit_last(narrow, photos[:FITTED_PHOTOS], resized(wide(photos[:FITTED_PHOTOS]), size))


def start_lamps(narrow: Generator, wide: Generator) -> None:
    """The teacher's lamps; where it has none, its map is dimmed and new lamps make up for it."""
    assert narrow.lamps is not None
    assert narrow.decoder.up3.bias is not None
    if wide.lamps is not None:
        narrow.lamps.load_state_dict(wide.lamps.state_dict())
    else:
        narrow.decoder.up3.bias.sub_(DIMMER)


def fit_last(narrow: Generator, photos: Tensor, wanted: Float[Tensor, "n 3 size size"]) -> None:
    """The last convolution, by least squares over the pixels on the ball."""
    last = narrow.decoder.up3
    nn.init.zeros_(last.weight)
    assert last.bias is not None
    nn.init.zeros_(last.bias)
    seen: list[Tensor] = []
    hook = last.register_forward_pre_hook(lambda _, inputs: seen.append(inputs[0]))
    missing = wanted - narrow(photos)
    hook.remove()
    lit = lit_share(wanted.shape[-1]).flatten() > 0
    x = functional.unfold(seen[0], 3, padding=1)[:, :, lit].transpose(0, 1).flatten(1)
    y = missing.flatten(2)[:, :, lit].transpose(0, 1).flatten(1)
    weight, bias = least_squares(x, y)
    last.weight.copy_(weight.reshape(last.weight.shape))
    last.bias.copy_(bias)


def add_norms(generator: Generator, plain: Generator, photos: Tensor) -> None:
    """Fill `generator` with the function of `plain`, its norms set to the photos' statistics."""
    moments, layers = output_moments(plain, photos), dict(named_convolutions(generator))
    for name, source in named_convolutions(plain):
        fill_with_norm(layers[name].conv, layers[name].norm, source.conv, moments[name])
    latent = plain.before_activation(plain.evenly_bright(photos)[0])
    spread = (latent.mean(0), latent.var(0, unbiased=False))
    fill_with_norm(generator.latent, generator.latent_norm, plain.latent, spread)
    generator.decoder.up3.load_state_dict(plain.decoder.up3.state_dict())
    if generator.mixture is not None and plain.mixture is not None:
        generator.mixture.load_state_dict(plain.mixture.state_dict())
    if generator.lamps is not None and plain.lamps is not None:
        generator.lamps.load_state_dict(plain.lamps.state_dict())
    if generator.colour is not None and plain.colour is not None:
        generator.colour.load_state_dict(plain.colour.state_dict())


def fill_with_norm(
    layer: nn.Module, norm: nn.Module, source: nn.Module, moments: tuple[Tensor, Tensor]
) -> None:
    """Copy a layer; its norm undoes itself: gamma = sqrt(var + eps), beta = mean, as in `imagenet`.

    Args:
        moments: mean and variance of the source's output, bias included.
    """
    assert isinstance(layer, nn.Conv2d | nn.Linear)
    assert isinstance(source, nn.Conv2d | nn.Linear)
    layer.weight.copy_(source.weight)
    if layer.bias is not None and source.bias is not None:
        layer.bias.copy_(source.bias)
    if isinstance(norm, nn.BatchNorm1d | nn.BatchNorm2d):
        assert norm.running_mean is not None
        assert norm.running_var is not None
        mean, variance = moments
        norm.running_mean.copy_(mean)
        if layer.bias is None and source.bias is not None:
            norm.running_mean.sub_(source.bias)
        norm.running_var.copy_(variance)
        norm.weight.copy_(torch.sqrt(variance + norm.eps))
        norm.bias.copy_(mean)
