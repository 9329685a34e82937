"""Hold-Geoffroy et al., "Deep outdoor illumination estimation", CVPR 2017.

A photo to the sun's position among 160 bins of the sky, turbidity and scale of a physical sky, and
the camera's elevation and field of view. Followed: network, bins, their targets, the losses.
Changed:

- Preetham's sky in place of Hosek and Wilkie's (`sky`), fitted to the HDR panorama itself.
- Sky parameters are standardised, KL is summed over bins, and BETA weighs them.
- Adam at 0.001 with batches of 64, for the paper's 0.01 and 128: at its rate the held-out
  loss stood at 10 after 39 steps, and that run was ended.
- Below the horizon the paper defines nothing: here the ground is Lambertian, albedo 0.3.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional as F

from deeplight.camera_response import LUMINANCE
from deeplight.evaluate.rivals.crops import Pair
from deeplight.evaluate.rivals.gardner_2017 import Encoder, dense, feature_count
from deeplight.evaluate.rivals.sky import Sky, fitted_sky
from deeplight.frames import rotation
from deeplight.mappings import resample
from deeplight.training.network.mobilenet_v2 import MobileNetV2Encoder

NAME = "hold_geoffroy_2017"
ELEVATIONS, AZIMUTHS = 5, 32
KAPPA = 80.0
BETA = 1.0
PARAMETERS = ("log_scale", "turbidity", "elevation_rad", "fov_rad")


class HoldGeoffroy2017(nn.Module):
    """Seven convolutions, one dense layer, two heads; ELU and batch norm but for the outputs.

    Args:
        photo_size: height and width of its photos; the paper's is 240 x 320.
        encoder: the paper's convolutions, or our MobileNetV2 in their place.
        width: channels as a share of the paper's (not of our encoder).
        frozen: blocks of our encoder that keep their weights.
        dropout: part of the features, and of the dense layer's answers, left out while it learns.
    """

    def __init__(
        self,
        photo_size: tuple[int, int] = (240, 320),
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
        count = feature_count(self.encoder, photo_size)
        latent = max(16, round(2048 * width))
        self.latent = dense(count, latent, dropout)
        self.sun = nn.Linear(latent, ELEVATIONS * AZIMUTHS)
        self.parameters_head = nn.Linear(latent, len(PARAMETERS))

    def forward(
        self, photos: Float[Tensor, "n 3 photo_height photo_width"]
    ) -> tuple[Float[Tensor, "n bins"], Float[Tensor, "n parameters"]]:
        """ln probability of every bin, and the standardised parameters."""
        return self.heads(self.encoder(photos))

    def heads(
        self, features: Float[Tensor, "n channels rows columns"]
    ) -> tuple[Float[Tensor, "n bins"], Float[Tensor, "n parameters"]]:
        """The same from what the encoder gave."""
        latent = self.latent(features.flatten(1))
        return F.log_softmax(self.sun(latent).float(), 1), self.parameters_head(latent).float()


def _published_encoder(width: float) -> nn.Sequential:
    layers = ((64, 7, 2), (128, 5, 2), (256, 3, 2), (256, 3, 1), (256, 3, 2), (256, 3, 1),
              (256, 3, 2))  # fmt: skip
    blocks: list[nn.Module] = []
    before = 3
    for full, kernel, stride in layers:
        after = max(4, round(full * width))
        blocks += [
            nn.Conv2d(before, after, kernel, stride, kernel // 2, bias=False),
            nn.BatchNorm2d(after),
            nn.ELU(),
        ]
        before = after
    return nn.Sequential(*blocks)


@lru_cache(maxsize=1)
def bin_directions() -> Float[np.ndarray, "bins 3"]:
    """Centres of 5 elevations x 32 azimuths over the sky; azimuth 0 is where the camera looks."""
    elevation = (np.arange(ELEVATIONS) + 0.5) * (np.pi / 2 / ELEVATIONS)
    azimuth = (np.arange(AZIMUTHS) + 0.5) * (2 * np.pi / AZIMUTHS) - np.pi
    up, around = (values.ravel() for values in np.meshgrid(elevation, azimuth, indexing="ij"))
    level = np.cos(up)
    return np.stack([level * np.sin(around), np.sin(up), -level * np.cos(around)], axis=-1)


def sun_target(sun: Float[np.ndarray, "3"]) -> Float[np.ndarray, " bins"]:
    """Probability of every bin: a von Mises-Fisher lobe of concentration KAPPA about the sun."""
    lobes = np.exp(KAPPA * (bin_directions() @ sun - 1))
    return np.asarray(lobes / lobes.sum())


@dataclass(frozen=True, eq=False)
class Standard:
    """Mean and spread of the parameters over the training pairs."""

    mean: Float[np.ndarray, " parameters"]
    spread: Float[np.ndarray, " parameters"]

    @classmethod
    def of(cls, values: Float[np.ndarray, "n parameters"]) -> "Standard":
        return cls(values.mean(0), np.maximum(values.std(0), 1e-3))


def labels_of(
    pairs: Sequence[Pair],
) -> tuple[Float[np.ndarray, "n bins"], Float[np.ndarray, "n parameters"]]:
    """Sun bins and parameters of each pair, from the sky that explains its place."""
    skies: dict[int, Sky] = {}
    bins, parameters = [], []
    for pair in pairs:
        if id(pair.place) not in skies:
            skies[id(pair.place)] = fitted_sky(pair.place)
        sky = skies[id(pair.place)]
        bins.append(sun_target(pair.level(sky.sun)))
        log_scale = float(np.log(max(sky.scale * float(pair.gain @ LUMINANCE), 1e-9)))
        parameters.append([log_scale, sky.turbidity, pair.elevation_rad, pair.fov_rad])
    return np.array(bins), np.array(parameters)


def loss(
    found: tuple[Float[Tensor, "n bins"], Float[Tensor, "n parameters"]],
    wanted: tuple[Float[Tensor, "n bins"], Float[Tensor, "n parameters"]],
    beta: float = BETA,
) -> Float[Tensor, ""]:
    """KL divergence of the sun's bins plus `beta` times the MSE of standardised parameters."""
    divergence = F.kl_div(found[0], wanted[0], reduction="batchmean")
    return divergence + beta * F.mse_loss(found[1], wanted[1])


def sky_of(
    log_bins: Float[np.ndarray, " bins"],
    parameters: Float[np.ndarray, " parameters"],
    standard: Standard,
) -> tuple[Sky, float]:
    """The sky and the camera's elevation in radians that one answer means."""
    log_scale, turbidity, elevation, _ = parameters * standard.spread + standard.mean
    sun = bin_directions()[int(np.argmax(log_bins))]
    sky = Sky(sun, float(np.clip(turbidity, 2, 10)), float(np.exp(log_scale)))
    return sky, float(np.clip(elevation, -np.pi / 2, np.pi / 2))


def radiance_of(sky: Sky, elevation_rad: float, height: int = 64) -> Float[np.ndarray, "h w 3"]:
    """The sky as the tilted camera sees it: a panorama in the camera's frame."""
    camera_from_level = rotation("x", elevation_rad).T
    return np.asarray(resample.turned_latlong(sky.panorama(height), camera_from_level))
