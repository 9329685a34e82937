"""The generator G: a photo to ln radiance on the mirror ball [section 3.2 of the paper]."""

import math
from dataclasses import dataclass
from typing import Literal

import torch
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn import functional
from torch.nn.utils.fusion import fuse_conv_bn_eval, fuse_linear_bn_eval

from deeplight.camera_response import GAMMA
from deeplight.errors import ConfigError
from deeplight.training.network.heads import Heads
from deeplight.training.network.lamps import (
    DIMMER,
    LampBall,
    Lamps,
    mirror_image,
    numbers_of,
    parts_of,
    together,
)
from deeplight.training.network.mobilenet_v2 import (
    BATCH_NORM_EPSILON,
    FEATURE_CHANNELS,
    ConvNorm,
    MobileNetV2Encoder,
    Norm,
    scaled,
)

Orientation = Literal["portrait", "landscape"]

# (height, width) of the photo; both give 4,800 features ("to maintain our FC layer size").
PHOTO_SIZE: dict[Orientation, tuple[int, int]] = {"portrait": (192, 135), "landscape": (144, 192)}
FEATURE_SIZE: dict[Orientation, tuple[int, int]] = {"portrait": (6, 5), "landscape": (5, 6)}
LATENT_GRID = 4  # the latent vector becomes a 4 x 4 picture
OUTPUT_SIZES = (16, 32, 64)
START_RADIANCE = 0.3  # a grey room: nothing is clipped, so every sphere teaches from step one
START_SPREAD = 0.1  # standard deviation of ln radiance before training, about
MEAN_PIXEL = 0.45  # a well exposed photo's
DARKEST_MEAN = 0.03  # a darker photo counts as this


@dataclass(frozen=True)
class NetworkConfig:
    """The shape of the generator; defaults are the paper's where it states a number."""

    orientation: Orientation = "portrait"
    """portrait: 192 x 135 photos; landscape: 144 x 192 (height x width)."""
    latent_size: int = 256
    """Length of the latent vector, a multiple of 16."""
    decoder_widths: tuple[int, int] = (64, 32)
    """Channels of the first two decoder convolutions (our choice: the paper's figure has them)."""
    encoder_norm: Norm = "batch"
    """`none` trains the folded weights as convolution + bias."""
    decoder_norm: Norm = "batch"
    """Norm of the fully connected layer and the decoder, always without one at the end."""
    latent_dropout: float = 0.0
    """Share of the latent vector dropped in training."""
    width: float = 1.0
    """Channels of the encoder as a share of MobileNetV2's; the published smaller ones have 0.5 and
    0.35. ImageNet weights are for 1.0."""
    output_size: int = 32
    """Pixels along the mirror ball: 16, 32 or 64."""
    components: int = 0
    """Number of principal components of lighting fitted to training examples (see `fitted`), which
    the latent vector mixes; the decoder adds what they lack, nothing at first. 0: no components."""
    lamps: int = 0
    """Number of lamps, added to the radiance of a map that starts dimmer (see `lamps`)."""
    brightness: float = 0.0
    """Share of the photo's brightness that is taken out before the network and put back after it:
    at 1 the light follows an exposure change exactly. A photo's brightness is its mean pixel."""
    colour: bool = False
    """Add a share of the photo's mean colour to the light's: a share that is learnt, of each photo
    from what it shows, and starts at 0. What is there is the light's or the things', or the
    camera's white balance."""
    mirrored: bool = False
    """Read the features a second time, mirrored, and answer with the mean of both answers, the
    second turned back; the last lamp is the first one's mirror image. Then a photo and its mirror
    image give mirrored light but for what the encoder makes of a mirrored photo. Costs a decoder,
    no encoder."""
    heads: bool = False
    """Say something of the camera and of how sure the light is, too (see `heads`). They are taught
    to a trained network by `deeplight export --heads`, not in training."""


class Decoder(nn.Module):
    """Latent vector -> 4 x 4 picture -> three times (bilinear x2, 3x3 convolution) -> 32 x 32.

    A ball of 16 leaves the second convolution out, one of 64 has one more of half its width.
    """

    def __init__(
        self, latent_size: int, widths: tuple[int, int], norm: Norm, output_size: int = 32
    ) -> None:
        super().__init__()
        self.channels = latent_size // LATENT_GRID**2
        last = widths[0]
        self.up1 = ConvNorm(self.channels, last, norm)
        self.up2: nn.Module | None = None
        self.more: nn.Module | None = None
        if output_size >= 32:
            self.up2, last = ConvNorm(last, widths[1], norm), widths[1]
        if output_size == 64:
            half = max(1, last // 2)
            self.more, last = ConvNorm(last, half, norm), half
        self.up3 = nn.Conv2d(last, 3, 3, padding=1)  # linear: radiance has no upper bound

    def forward(self, latent: Float[Tensor, "n latent"]) -> Float[Tensor, "n 3 size size"]:
        x = latent.reshape(-1, self.channels, LATENT_GRID, LATENT_GRID)  # (n, 16, 4, 4)
        x = self.up1(twice_as_large(x))  # (n, 64, 8, 8)
        if self.up2 is not None:
            x = self.up2(twice_as_large(x))  # (n, 32, 16, 16)
        if self.more is not None:
            x = self.more(twice_as_large(x))  # (n, 16, 32, 32)
        log_radiance: Tensor = self.up3(twice_as_large(x))  # (n, 3, 32, 32)
        return log_radiance


class Mixture(nn.Module):
    """Latent vector -> a mixture of principal components of ln radiance; starts at their mean."""

    mean: Tensor
    components: Tensor

    def __init__(self, latent_size: int, count: int, size: int) -> None:
        super().__init__()
        self.mix = nn.Linear(latent_size, count)
        nn.init.zeros_(self.mix.weight)
        nn.init.zeros_(self.mix.bias)
        self.register_buffer("mean", torch.full((3, size, size), math.log(START_RADIANCE)))
        self.register_buffer("components", torch.zeros(count, 3, size, size))

    def forward(self, latent: Float[Tensor, "n latent"]) -> Float[Tensor, "n 3 size size"]:
        return self.mean + (self.mix(latent) @ self.components.flatten(1)).unflatten(
            1, self.mean.shape
        )


class Generator(nn.Module):
    """Photo in [-0.5, 0.5] -> ln radiance on the mirror ball (32 x 32), camera frame.

    Batch norm and ReLU6 follow every layer but the last (Implementation Details), which is linear.
    """

    def __init__(self, config: NetworkConfig | None = None, freeze_blocks: int = 0) -> None:
        super().__init__()
        config = config or NetworkConfig()
        if config.latent_size % LATENT_GRID**2:
            raise ConfigError("latent_size a multiple of 16", str(config.latent_size), "change it")
        if config.output_size not in OUTPUT_SIZES or config.width <= 0:
            raise ConfigError(
                f"network.output_size one of {OUTPUT_SIZES} and network.width above 0",
                f"{config.output_size} and {config.width:g}",
                "change it",
            )
        self.output_size = config.output_size
        self.encoder = MobileNetV2Encoder(config.encoder_norm, freeze_blocks, config.width)
        self.feature_size = height, width = FEATURE_SIZE[config.orientation]
        features = scaled(FEATURE_CHANNELS, config.width) * height * width  # 160 * 6 * 5 = 4,800
        self.latent: nn.Module = nn.Linear(features, config.latent_size)
        self.latent_norm: nn.Module = (
            nn.BatchNorm1d(config.latent_size, eps=BATCH_NORM_EPSILON)
            if config.decoder_norm == "batch"
            else nn.Identity()
        )
        self.activation = nn.ReLU6()
        self.dropout = nn.Dropout(config.latent_dropout)
        self.decoder = Decoder(
            config.latent_size, config.decoder_widths, config.decoder_norm, config.output_size
        )
        self.initialise()
        self.mixture: Mixture | None = None
        if config.components:
            self.mixture = Mixture(config.latent_size, config.components, config.output_size)
            assert self.decoder.up3.bias is not None
            nn.init.zeros_(self.decoder.up3.weight)
            nn.init.zeros_(self.decoder.up3.bias)
        self.brightness = config.brightness
        self.mirrored = config.mirrored
        self.heads: Heads | None = None
        if config.heads:
            self.heads = Heads(scaled(FEATURE_CHANNELS, config.width), height, width)
        self.colour = nn.Linear(config.latent_size, 1) if config.colour else None
        if self.colour is not None:
            nn.init.zeros_(self.colour.weight)
            nn.init.zeros_(self.colour.bias)
        self.lamps: Lamps | None = None
        if config.lamps:
            self.lamps = Lamps(config.latent_size, config.lamps, START_RADIANCE)
            self.ball = LampBall(config.output_size)
            with torch.no_grad():
                assert self.decoder.up3.bias is not None
                self.decoder.up3.bias.sub_(DIMMER)

    def initialise(self) -> None:
        """He's initialisation for ReLU; the output starts near ln 0.3 with little spread."""
        for module in self.modules():
            if isinstance(module, nn.Conv2d):
                nn.init.kaiming_normal_(module.weight, nonlinearity="relu")
                if module.bias is not None:
                    nn.init.zeros_(module.bias)
        last = self.decoder.up3
        nn.init.normal_(last.weight, std=START_SPREAD / math.sqrt(last.weight[0].numel()))
        assert last.bias is not None
        nn.init.constant_(last.bias, math.log(START_RADIANCE))

    def before_activation(self, photo: Float[Tensor, "n 3 height width"]) -> Tensor:
        """The latent vector before its norm and activation."""
        pre: Tensor = self.latent(self.features(photo).flatten(1))
        return pre

    def features(self, photo: Float[Tensor, "n 3 height width"]) -> Tensor:
        """What the encoder sees in a photo, (n, 160, 6, 5) of a portrait one."""
        # Contiguous: the order in which they are flattened is NCHW's, whatever the memory format.
        features: Tensor = self.encoder(photo).contiguous()
        return features

    def latent_of(self, features: Float[Tensor, "n channels rows columns"]) -> Tensor:
        """The latent vector, (n, 256)."""
        pre = self.latent(features.flatten(1))
        latent: Tensor = self.dropout(self.activation(self.latent_norm(pre)))
        return latent

    def forward(self, photo: Float[Tensor, "n 3 height width"]) -> Float[Tensor, "n 3 size size"]:
        return self.light(photo)[0]

    def light(
        self, photo: Float[Tensor, "n 3 height width"]
    ) -> tuple[Float[Tensor, "n 3 size size"], Float[Tensor, "n lamp 7"] | None]:
        """All ln radiance, lamps included, and the lamps by themselves (see `lamps.numbers_of`)."""
        photo, taken = self.evenly_bright(photo)
        return self.light_from(self.features(photo), photo, taken)

    def everything(
        self, photo: Float[Tensor, "n 3 height width"]
    ) -> tuple[Float[Tensor, "n 3 size size"], Float[Tensor, "n lamp 7"] | None, Tensor]:
        """Light and lamps as `light` gives them, and what the heads say, which it must have."""
        assert self.heads is not None
        photo, taken = self.evenly_bright(photo)
        features = self.features(photo)
        return (*self.light_from(features, photo, taken), self.heads(features))

    def light_from(
        self, features: Tensor, photo: Float[Tensor, "n 3 height width"], taken: Tensor | None
    ) -> tuple[Float[Tensor, "n 3 size size"], Float[Tensor, "n lamp 7"] | None]:
        """The rest of `light`, after the encoder; `photo` and `taken` are of `evenly_bright`."""
        latent = self.latent_of(features)
        log_radiance, lamps = self.map_of(latent), self.lamps_of(latent)
        if self.mirrored:
            latent_back = self.latent_of(features.flip(-1))
            log_radiance = (log_radiance + self.map_of(latent_back).flip(-1)) / 2
            others = self.lamps_of(latent_back)
            if lamps is not None and others is not None:
                lamps = (lamps + mirror_image(others)) / 2
        shift = self.put_back(taken, latent, photo)
        if shift is not None:
            log_radiance = log_radiance + shift[:, :, None, None]
        if lamps is None:
            return log_radiance, None
        direction, log_flux, concentration = parts_of(lamps)
        if shift is not None:
            log_flux = log_flux + shift[:, None]
        drawn = self.ball(direction, log_flux, concentration)
        return together(log_radiance, drawn), numbers_of(direction, log_flux, concentration)

    def map_of(self, latent: Float[Tensor, "n latent"]) -> Float[Tensor, "n 3 size size"]:
        """ln radiance but for the lamps and the photo's brightness."""
        log_radiance: Tensor = self.decoder(latent)
        return log_radiance if self.mixture is None else log_radiance + self.mixture(latent)

    def lamps_of(self, latent: Float[Tensor, "n latent"]) -> Float[Tensor, "n lamp 7"] | None:
        """The lamps' numbers as the head gives them."""
        return None if self.lamps is None else self.lamps(latent)

    def put_back(
        self, taken: Tensor | None, latent: Tensor, photo: Tensor
    ) -> Float[Tensor, "n 3"] | Float[Tensor, "n 1"] | None:
        """What the photo's brightness and colour add to ln radiance, map and lamps alike."""
        if self.colour is None:
            return taken
        colour: Tensor = self.colour(latent) * chroma(photo)
        return colour if taken is None else taken + colour

    def evenly_bright(
        self, photo: Float[Tensor, "n 3 height width"]
    ) -> tuple[Float[Tensor, "n 3 height width"], Float[Tensor, "n 1"] | None]:
        """A photo brought towards `MEAN_PIXEL`, and the ln radiance that this took from it.

        Pixel values are multiplied: that is a change of exposure, since they are a power of
        radiance. What was clipped stays equally bright, which the network may see.
        """
        if not self.brightness:
            return photo, None
        pixel = photo + 0.5
        mean = pixel.mean((1, 2, 3), keepdim=True).clamp_min(DARKEST_MEAN)
        taken = self.brightness * torch.log(mean / MEAN_PIXEL)
        return pixel * torch.exp(-taken) - 0.5, GAMMA * taken.flatten(1)


def chroma(photo: Float[Tensor, "n 3 height width"]) -> Float[Tensor, "n 3"]:
    """ln of a photo's mean colour over its mean brightness, as linear radiance; sums to 0."""
    mean = (photo.mean((2, 3)) + 0.5).clamp_min(DARKEST_MEAN)
    log_colour = GAMMA * torch.log(mean)
    return log_colour - log_colour.mean(1, keepdim=True)


def twice_as_large(x: Float[Tensor, "n c h w"]) -> Float[Tensor, "n c h2 w2"]:
    """Bilinear upsampling by two, pixel centres at (i + 0.5)."""
    return functional.interpolate(x, scale_factor=2, mode="bilinear", align_corners=False)


@torch.no_grad()
def fold_batch_norm(generator: Generator) -> None:
    """Fold every batch norm into the layer before it, in place; what is computed stays the same."""
    generator.eval()
    for module in generator.modules():
        if isinstance(module, ConvNorm) and isinstance(module.norm, nn.BatchNorm2d):
            module.conv = fuse_conv_bn_eval(module.conv, module.norm)
            module.norm = nn.Identity()
    if isinstance(generator.latent_norm, nn.BatchNorm1d):
        assert isinstance(generator.latent, nn.Linear)
        generator.latent = fuse_linear_bn_eval(generator.latent, generator.latent_norm)
        generator.latent_norm = nn.Identity()
