"""ImageNet weights for the encoder, from an `.npz` with batch norm folded into the convolutions."""

from pathlib import Path

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn

from deeplight.errors import ModelError
from deeplight.io.arrays_file import read_arrays
from deeplight.training.network.mobilenet_v2 import STEM_CHANNELS, ConvNorm, MobileNetV2Encoder

# The weights were trained on photos in [-1, 1]; ours are in [-0.5, 0.5].
INPUT_GAIN = 2.0


def load_imagenet(encoder: MobileNetV2Encoder, path: Path, photos: Tensor | None = None) -> None:
    """Fill `encoder` with the folded ImageNet weights of `path`.

    An encoder with batch norm needs `photos` (n, 3, height, width) in [-0.5, 0.5]: the norm is
    put back around the folded weights from the statistics of these, so that the network's
    function stays what it was (in evaluation mode exactly; in training mode as far as the
    batch's statistics are those of the photos).

    Raises:
        OSError: there is no such file, or reading it is not permitted.
        ModelError: the file is damaged, lacks a layer or has another shape, the encoder has
            another width, or batch norm has no photos.
    """
    arrays = read_folded(path)
    stem = dict(named_convolutions(encoder))["features.0"].conv.out_channels
    if stem != STEM_CHANNELS:
        raise ModelError(
            "network.width=1.0 for ImageNet weights, which exist for that width only",
            f"a stem of {stem} instead of {STEM_CHANNELS} channels",
            "leave --imagenet out or set network.width=1.0",
        )
    folded = MobileNetV2Encoder("none")
    for name, layer in named_convolutions(folded):
        copy_folded(layer.conv, arrays, name, path)
    with torch.no_grad():
        dict(named_convolutions(folded))["features.0"].conv.weight.mul_(INPUT_GAIN)
    batch_normed = isinstance(dict(named_convolutions(encoder))["features.0"].norm, nn.BatchNorm2d)
    if not batch_normed:
        encoder.load_state_dict(folded.state_dict())
        return
    if photos is None:
        raise ModelError("photos to calibrate batch norm", "none", "pass a few hundred")
    restore_batch_norm(encoder, folded, photos)


def read_folded(path: Path) -> dict[str, np.ndarray]:
    """The arrays of the `.npz`, by name.

    Raises:
        OSError: there is no such file, or reading it is not permitted.
        ModelError: it is no .npz, or damaged.
    """
    if path.is_dir():
        raise ModelError("an .npz of MobileNetV2 weights", f"{path}, a folder", "give the file")
    try:
        return read_arrays(path)
    except ValueError as error:
        got = f"{path} with {error}"
        raise ModelError("an .npz of MobileNetV2 weights", got, "check the file") from error


def named_convolutions(encoder: nn.Module) -> list[tuple[str, ConvNorm]]:
    """Every convolution of the encoder with its module name, in the order of evaluation."""
    return [(n, m) for n, m in encoder.named_modules() if isinstance(m, ConvNorm)]


def copy_folded(conv: nn.Conv2d, arrays: dict[str, np.ndarray], name: str, path: Path) -> None:
    """Copy one layer; the stem is called `features.0.conv` in the file."""
    stored = "features.0.conv" if name == "features.0" else name
    for part, parameter in (("weight", conv.weight), ("bias", conv.bias)):
        array = arrays.get(f"{stored}.{part}")
        if array is None or parameter is None or array.shape != tuple(parameter.shape):
            got = "nothing" if array is None else f"shape {array.shape}"
            what = f"{stored}.{part} in {path.name}"
            raise ModelError(what, got, "use the folded MobileNetV2 1.0")
        with torch.no_grad():
            parameter.copy_(torch.from_numpy(array.astype(np.float32)))


@torch.no_grad()
def restore_batch_norm(
    encoder: MobileNetV2Encoder,
    folded: MobileNetV2Encoder,
    photos: Float[Tensor, "n 3 height width"],
    batch_size: int = 64,
) -> None:
    """Give `encoder` the folded network's function with batch norm set to the photos' statistics.

    For a convolution y without its bias b: mean and var are y's, gamma = sqrt(var + eps) and
    beta = mean + b, so gamma (y - mean) / sqrt(var + eps) + beta = y + b.
    """
    moments = output_moments(folded, photos, batch_size)
    layers = dict(named_convolutions(encoder))
    for name, source in named_convolutions(folded):
        norm, bias = layers[name].norm, source.conv.bias
        assert isinstance(norm, nn.BatchNorm2d)
        assert bias is not None
        mean, variance = moments[name]
        layers[name].conv.weight.copy_(source.conv.weight)
        norm.running_mean, norm.running_var = mean - bias, variance
        norm.weight.copy_(torch.sqrt(variance + norm.eps))
        norm.bias.copy_(mean)


@torch.no_grad()
def output_moments(
    encoder: nn.Module, photos: Float[Tensor, "n 3 height width"], batch_size: int = 64
) -> dict[str, tuple[Tensor, Tensor]]:
    """Mean and variance per channel of every convolution's output (before the activation)."""
    sums: dict[str, Tensor] = {}

    def record(name: str, y: Tensor) -> None:
        wide = y.double()
        count = torch.full_like(wide[0, :, 0, 0], y[:, 0].numel())
        moments = torch.stack((count, wide.sum((0, 2, 3)), wide.square().sum((0, 2, 3))))
        sums[name] = sums[name] + moments if name in sums else moments

    hooks = [
        layer.norm.register_forward_hook(lambda _m, _x, y, name=name: record(name, y))
        for name, layer in named_convolutions(encoder)
    ]
    try:
        for chunk in torch.split(photos, batch_size):
            encoder(chunk)
    finally:
        for hook in hooks:
            hook.remove()
    return {name: moments_of(*total) for name, total in sums.items()}


def moments_of(count: Tensor, total: Tensor, squares: Tensor) -> tuple[Tensor, Tensor]:
    """(mean, variance) in float32 from a count, a sum and a sum of squares."""
    mean = total / count
    return mean.float(), (squares / count - mean.square()).clamp_min(0.0).float()
