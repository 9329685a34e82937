"""Gardner et al., "Learning to predict indoor illumination from a single image", TOG 2017.

A photo to a 32 x 64 panorama of colours and one of light intensity. Followed: encoder, heads, the
cosine-filtered loss that sharpens with the epoch, the order of its weights, the final map with Gray
World. Left out or changed, since the paper does not settle it or our data make it needless:

- HDR panoramas are at hand, so the first stage (LDR masks from a detector) is left out: training
  starts with the second stage's targets. No recentring warp: spheres stand at the camera's place.
- A quarter of its resolution: the last two deconvolutions are left out. The light that is compared
  has 812 pixels; 2,048 texels hold it, and training takes a third of the time.
- The filter is normalised to its own sum. As printed it divides by the hemisphere's solid angle,
  with which the loss vanishes as the exponent grows.
- Intensity: log10(1 + radiance), 0 below the training set's median; output softplus.
"""

import math
from functools import lru_cache
from typing import Literal

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

from deeplight.camera_response import LUMINANCE, decode
from deeplight.mappings import latlong
from deeplight.training.network.mobilenet_v2 import MobileNetV2Encoder

NAME = "gardner_2017"
ALPHA = 3.0
"""The filter's exponent is ALPHA times the epoch."""
RGB_WEIGHT, MASK_WEIGHT, PLAIN_WEIGHT = 10.0, 1.0, 0.1
DARK_START = -4.0
ROWS = 32
"""Rows of its panoramas."""
_FILTER_HEIGHT = 24

Photos = Float[Tensor, "n 3 photo_height photo_width"]
Features = Float[Tensor, "n channels rows columns"]
Maps = Float[Tensor, "n 3 height width"]
Intensities = Float[Tensor, "n 1 height width"]
Encoder = Literal["published", "ours"]


class Residual(nn.Module):
    """Two convolutions, K x K then 3 x 3, over a projected shortcut."""

    def __init__(self, before: int, after: int, kernel: int, stride: int) -> None:
        super().__init__()
        self.body = nn.Sequential(
            nn.Conv2d(before, after, kernel, stride, (kernel - 1) // 2, bias=False),
            nn.BatchNorm2d(after),
            nn.ELU(),
            nn.Conv2d(after, after, 3, 1, 1, bias=False),
            nn.BatchNorm2d(after),
        )
        self.shortcut = nn.Conv2d(before, after, 1, stride, bias=False)

    def forward(
        self, values: Float[Tensor, "n before h w"]
    ) -> Float[Tensor, "n after new_h new_w"]:
        body = self.body(values)
        short = self.shortcut(values)[..., : body.shape[2], : body.shape[3]]
        padded = F.pad(body, (0, short.shape[3] - body.shape[3], 0, short.shape[2] - body.shape[2]))
        return F.elu(padded + short)


class Gardner2017(nn.Module):
    """The two-headed network.

    Args:
        photo_size: height and width of its photos; the paper's is 192 x 256.
        encoder: the paper's, or our MobileNetV2 for a comparison of everything but that.
        width: channels as a share of the paper's (not of our encoder).
        frozen: blocks of our encoder that keep their weights.
        dropout: part of the features, and of the dense layer's answers, left out while it learns.
    """

    def __init__(
        self,
        photo_size: tuple[int, int] = (192, 256),
        encoder: Encoder = "published",
        width: float = 1.0,
        frozen: int = 0,
        dropout: float = 0.0,
    ) -> None:
        super().__init__()
        self.photo_size = photo_size
        self.encoder = (
            _published_encoder(width)
            if encoder == "published"
            else MobileNetV2Encoder("none", frozen)
        )
        features = feature_count(self.encoder, photo_size)
        latent = _scaled(1024, width)
        self.latent = dense(features, latent, dropout)
        mask = [_scaled(c, width) for c in (256, 256, 128, 96, 64)]
        colour = [_scaled(c, width) for c in (192, 192, 128, 64, 32)]
        self.intensity = _head(latent, mask, 1)
        self.colour = _head(latent, colour, 3)
        # Most texels are no light: started there, the few that are need not drown the rest first.
        nn.init.constant_(self.intensity[-1].bias, DARK_START)  # type: ignore[arg-type]

    def forward(self, photos: Photos) -> tuple[Maps, Intensities]:
        """Colours 0 to 1 and log10(1 + intensity) for photos in [-0.5, 0.5]."""
        return self.heads(self.encoder(photos))

    def heads(self, features: Features) -> tuple[Maps, Intensities]:
        """The same from what the encoder gave."""
        latent = self.latent(features.flatten(1))
        colours = (torch.tanh(self.colour(latent).float()) + 1) / 2
        return colours, F.softplus(self.intensity(latent).float())


def dense(features: int, latent: int, dropout: float) -> nn.Sequential:
    """The dense layer under the heads, with its norm."""
    return nn.Sequential(
        nn.Dropout(dropout),
        nn.Linear(features, latent),
        nn.BatchNorm1d(latent),
        nn.ELU(),
        nn.Dropout(dropout),
    )


@torch.no_grad()
def feature_count(encoder: nn.Module, photo_size: tuple[int, int]) -> int:
    """Features that an encoder gives of a photo; its norms do not learn from the trial."""
    features: Tensor = encoder.eval()(torch.zeros(1, 3, *photo_size))
    encoder.train()
    return features.flatten(1).shape[1]


def targets(
    panoramas: Float[Tensor, "n 3 rows columns"], median: float
) -> tuple[Maps, Intensities]:
    """What the heads learn: clipped colours, and log10(1 + luminance), 0 below the median.

    Panoramas of more than `ROWS` rows are averaged first, by solid angle.
    """
    if panoramas.shape[2] > ROWS:
        solid = torch.tensor(latlong.solid_angles(*panoramas.shape[2:]).copy()).to(panoramas)
        step = panoramas.shape[2] // ROWS
        panoramas = F.avg_pool2d(panoramas * solid, step) / F.avg_pool2d(solid[None], step)
    weights = torch.tensor(LUMINANCE, dtype=panoramas.dtype, device=panoramas.device)
    luminance = (panoramas * weights[:, None, None]).sum(1, keepdim=True)
    intensity = torch.where(luminance > median, torch.log10(1 + luminance), 0.0)
    return panoramas.clamp(0, 1), intensity


def loss(
    found: tuple[Maps, Intensities], wanted: tuple[Maps, Intensities], epoch: float
) -> Float[Tensor, ""]:
    """Solid-angle L2 of colours, filtered L2 of intensity, and a little of it unfiltered.

    Args:
        epoch: as a real number; the filter sharpens with it.
    """
    height, width = found[0].shape[2:]
    solid = torch.tensor(latlong.solid_angles(height, width).copy(), dtype=found[0].dtype)
    solid = solid.to(found[0].device) / solid.mean()
    colour = (solid * (found[0] - wanted[0]) ** 2).mean()
    plain = (solid * (found[1] - wanted[1]) ** 2).mean()
    # In steps of a tenth, since a filter takes longer to make than a step of training.
    rounded = 1.1 ** round(math.log(max(epoch, 0.05), 1.1))
    blur = filter_matrix(rounded).to(found[1].device)
    size = (_FILTER_HEIGHT, 2 * _FILTER_HEIGHT)
    small = F.interpolate(found[1] - wanted[1], size=size, mode="area").flatten(1)
    filtered = ((small @ blur.T) ** 2).mean()
    return RGB_WEIGHT * colour + MASK_WEIGHT * filtered + PLAIN_WEIGHT * plain


@lru_cache(maxsize=2)
def filter_matrix(epoch: float) -> Float[Tensor, "texels texels"]:
    """Cosine lobes of exponent ALPHA * epoch about every texel of 24 x 48; rows sum to 1."""
    rays = latlong.directions(_FILTER_HEIGHT, 2 * _FILTER_HEIGHT).reshape(-1, 3)
    solid = latlong.solid_angles(_FILTER_HEIGHT, 2 * _FILTER_HEIGHT).ravel()
    lobes = np.maximum(rays @ rays.T, 0) ** (ALPHA * epoch) * solid
    return torch.tensor(lobes / lobes.sum(1, keepdims=True), dtype=torch.float32)


def radiance_of(
    colours: Float[np.ndarray, "height width 3"],
    log_intensity: Float[np.ndarray, "height width"],
    photo: Float[np.ndarray, "photo_height photo_width 3"],
) -> Float[np.ndarray, "height width 3"]:
    """The final map: (10^intensity - 1) of light over the decoded colours, by Gray World.

    Light has no colour of its own: that, and the colours' mean, are the photo's mean colour (its
    luminance stays the network's).

    Args:
        photo: encoded pixels 0 to 1.
    """
    mean = decode(photo).reshape(-1, 3).mean(0)
    tint = mean / max(float(mean @ LUMINANCE), 1e-6)
    solid = latlong.solid_angles(*log_intensity.shape)
    own = np.average(colours, axis=(0, 1), weights=solid)
    balance = tint * float(own @ LUMINANCE) / np.maximum(own, 1e-6)
    light = np.maximum(10**log_intensity - 1, 0)[..., None] * tint
    lit = (light.max(-1, keepdims=True) > 1).astype(colours.dtype)
    return np.asarray(light * lit + colours * balance * (1 - lit), np.float32)


def _published_encoder(width: float) -> nn.Sequential:
    c = [_scaled(n, width) for n in (64, 96, 96, 128, 192, 256)]
    return nn.Sequential(
        *_conv(3, c[0], 9),
        *_conv(c[0], c[1], 4),
        Residual(c[1], c[2], 3, 1),
        Residual(c[2], c[3], 4, 2),
        Residual(c[3], c[4], 4, 2),
        Residual(c[4], c[5], 4, 2),
    )


def _conv(before: int, after: int, kernel: int) -> list[nn.Module]:
    layer = nn.Conv2d(before, after, kernel, 2, (kernel - 1) // 2, bias=False)
    return [layer, nn.BatchNorm2d(after), nn.ELU()]


def _head(latent: int, channels: list[int], out: int) -> nn.Sequential:
    """A dense layer to 4 x 8, then doubled to `ROWS` rows; no norm at the end."""
    first = channels[0]
    layers: list[nn.Module] = [
        nn.Linear(latent, first * 32),
        nn.BatchNorm1d(first * 32),
        nn.ELU(),
        nn.Unflatten(1, (first, 4, 8)),
    ]
    doublings = int(np.log2(ROWS // 4))
    for before, after in zip(channels, [*channels[1:], channels[-1]], strict=True):
        if doublings == 0:
            break
        doublings -= 1
        layers += [
            nn.ConvTranspose2d(before, after, 4, 2, 1, bias=False),
            nn.BatchNorm2d(after),
            nn.ELU(),
        ]
        first = after
    return nn.Sequential(*layers, nn.Conv2d(first, out, 5, 1, 2))


def _scaled(channels: int, width: float) -> int:
    return max(4, round(channels * width))
