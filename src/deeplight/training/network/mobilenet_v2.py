"""The encoder: the first seventeen layers of MobileNetV2 (Sandler et al., CVPR 2018).

Section 3.2 of LeGendre et al., CVPR 2019: "the first 17 MobileNetV2 layers" are the stem and
sixteen inverted residual blocks, `features[0:17]` of the width 1.0 network. A (3, 192, 135)
photo becomes (160, 6, 5) features, and so does its landscape twin in (160, 5, 6). In smaller
networks every width is scaled, as in the MobileNetV2 paper.
"""

from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional

Norm = Literal["batch", "none"]

# (expansion, output channels, blocks, stride of the first block), table 2 of the MobileNetV2
# paper up to the sixteenth block; the seventeenth (320 channels) is not used.
STAGES = (
    (1, 16, 1, 1),
    (6, 24, 2, 2),
    (6, 32, 3, 2),
    (6, 64, 4, 2),
    (6, 96, 3, 1),
    (6, 160, 3, 2),
)
STEM_CHANNELS = 32
FEATURE_CHANNELS = 160
LAYERS = 17
CHANNEL_MULTIPLE = 8
BATCH_NORM_EPSILON = 1e-3  # as in the TensorFlow network


class ConvNorm(nn.Module):
    """A convolution with TensorFlow's SAME padding, batch norm or a bias, and ReLU6 or nothing."""

    def __init__(
        self,
        channels_in: int,
        channels_out: int,
        norm: Norm,
        *,
        size: int = 3,
        stride: int = 1,
        groups: int = 1,
        activate: bool = True,
    ) -> None:
        super().__init__()
        # A stride-2 layer pads by its input's parity, see `same_padding`.
        self.conv = nn.Conv2d(
            channels_in,
            channels_out,
            size,
            stride,
            padding=size // 2 if stride == 1 else 0,
            groups=groups,
            bias=norm == "none",
        )
        self.norm = batch_norm(channels_out) if norm == "batch" else nn.Identity()
        self.activation = nn.ReLU6(inplace=True) if activate else nn.Identity()

    def forward(self, x: Tensor) -> Tensor:
        if self.conv.stride[0] == 2:
            x = functional.pad(x, same_padding(x.shape[-2], x.shape[-1]))
        return self.activation(self.norm(self.conv(x)))


class InvertedResidual(nn.Module):
    """Expand by 1x1, filter by depthwise 3x3, project by linear 1x1; add the input if it fits."""

    def __init__(
        self, channels_in: int, channels_out: int, expansion: int, stride: int, norm: Norm
    ) -> None:
        super().__init__()
        wide = channels_in * expansion
        self.expand = ConvNorm(channels_in, wide, norm, size=1) if expansion > 1 else nn.Identity()
        self.depthwise = ConvNorm(wide, wide, norm, stride=stride, groups=wide)
        self.project = ConvNorm(wide, channels_out, norm, size=1, activate=False)
        self.residual = stride == 1 and channels_in == channels_out

    def forward(self, x: Tensor) -> Tensor:
        y: Tensor = self.project(self.depthwise(self.expand(x)))
        return x + y if self.residual else y


class MobileNetV2Encoder(nn.Module):
    """`features[0:17]` of MobileNetV2, `width` times as wide as the published 1.0 network.

    The stem and the first `freeze_blocks` blocks run without gradients and in evaluation mode
    when `freeze_blocks` > 0; 0 trains everything.
    """

    def __init__(self, norm: Norm = "batch", freeze_blocks: int = 0, width: float = 1.0) -> None:
        super().__init__()
        channels = scaled(STEM_CHANNELS, width)
        features: list[nn.Module] = [ConvNorm(3, channels, norm, stride=2)]
        for expansion, full, blocks, stride in STAGES:
            wide = scaled(full, width)
            for block in range(blocks):
                features.append(
                    InvertedResidual(channels, wide, expansion, stride if block == 0 else 1, norm)
                )
                channels = wide
        self.features = nn.ModuleList(features)
        self.frozen_layers = freeze_blocks + 1 if freeze_blocks > 0 else 0
        self.features[: self.frozen_layers].requires_grad_(False)

    def train(self, mode: bool = True) -> "MobileNetV2Encoder":
        super().train(mode)
        self.features[: self.frozen_layers].eval()  # frozen batch norm keeps its statistics
        return self

    def forward(self, photo: Float[Tensor, "n 3 height width"]) -> Float[Tensor, "n channels h w"]:
        return self.learnt(self.frozen(photo))

    @torch.no_grad()
    def frozen(self, photo: Float[Tensor, "n 3 height width"]) -> Float[Tensor, "n early h w"]:
        """The photo's features after the frozen layers, or the photo where none is frozen."""
        x = photo
        for layer in self.features[: self.frozen_layers]:
            x = layer(x)
        return x

    def learnt(self, x: Float[Tensor, "n early rows columns"]) -> Float[Tensor, "n channels h w"]:
        """The rest of the encoder for what `frozen` gave."""
        for layer in self.features[self.frozen_layers :]:
            x = layer(x)
        return x


def scaled(channels: int, width: float) -> int:
    """`width` times as many channels, as a multiple of 8 that is not more than 10 % too few."""
    wanted = channels * width
    nearest = max(CHANNEL_MULTIPLE, int(wanted / CHANNEL_MULTIPLE + 0.5) * CHANNEL_MULTIPLE)
    return nearest if nearest >= 0.9 * wanted else nearest + CHANNEL_MULTIPLE


def batch_norm(channels: int) -> nn.BatchNorm2d:
    """Batch norm with TensorFlow's epsilon."""
    return nn.BatchNorm2d(channels, eps=BATCH_NORM_EPSILON)


def same_padding(height: int, width: int) -> tuple[int, int, int, int]:
    """(left, right, top, bottom) of TensorFlow's SAME padding for a 3x3 layer of stride 2.

    An odd size pads both sides, an even one only the end; PyTorch's own padding would shift
    every even layer by half a pixel of what the imported weights expect.
    """
    return width % 2, 1, height % 2, 1
