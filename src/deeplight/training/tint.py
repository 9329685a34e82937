"""A hue for a network whose light is grey: ridge regression, built into its own weights.

Channels that change places in training keep a network from knowing places by their colours, and
cost it what colours tell of the light. That is put back afterwards: from the means of the
encoder's feature maps, ridge regression finds the hue that the diffuse sphere has beyond what the
network gives it. The answer is a gain per channel for the whole light, which travels to the output
in channels of its own through the layers that are there; no layer is added.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor, nn

from deeplight.camera_response import GAMMA
from deeplight.errors import ConfigError
from deeplight.sphere import SPHERES
from deeplight.training.batches import Batch
from deeplight.training.generator import LATENT_GRID, Generator
from deeplight.training.losses import RigBases, soft_clip
from deeplight.training.mobilenet_v2 import ConvNorm

RIDGE = 1.0
"""Squared weights of standardised features count so much against one example's squared error."""
DARK = 0.003
"""Added to linear radiance before its logarithm: hue of what is darker is noise."""
HUES = torch.tensor([[1.0, -1.0, 0.0], [1.0, 1.0, -2.0]]) / torch.tensor([[2.0], [6.0]]).sqrt()
"""Two directions of ln (r, g, b) at right angles to grey and to each other, of length one."""
CENTRE, SCALE = 3.0, 2.0
"""A hue h is carried as 3 + 2 h, which ReLU6 lets pass for |h| < 1.5."""
CHUNK = 64


@torch.no_grad()
def hue_gap(
    generator: Generator, bases: RigBases, batch: Batch
) -> tuple[Float[Tensor, "n feature"], Float[Tensor, "n 2"]]:
    """Means of the feature maps, and the filmed hue of the diffuse sphere minus the rendered one.

    Args:
        generator: a network without batch norm, in evaluation mode.
        batch: bytes of training examples.
    """
    features, gaps = [], []
    for first in range(0, len(batch.photo), CHUNK):
        photo, spheres, rig = (part[first : first + CHUNK] for part in batch)
        seen = generator.encoder(photo.permute(0, 3, 1, 2).float() / 255 - 0.5)
        rendered = soft_clip(bases.render(generator.decoded(seen), rig))
        filmed = (spheres.flatten(2, 3).transpose(2, 3).float() / 255) ** GAMMA
        mask = bases.masks(rig)
        features.append(seen.mean((2, 3)))
        gaps.append(hue_of(filmed, mask) - hue_of(rendered, mask))
    return torch.cat(features), torch.cat(gaps)


def hue_of(
    linear: Float[Tensor, "n sphere 3 pixel"], mask: Float[Tensor, "n sphere 1 pixel"]
) -> Float[Tensor, "n 2"]:
    """Hue of the diffuse sphere's mean linear colour, in the directions of HUES."""
    diffuse = list(SPHERES).index("diffuse")
    inside = mask[:, diffuse]
    mean = (linear[:, diffuse] * inside).sum(2) / inside.sum(2)
    return (mean.clamp_min(0) + DARK).log() @ HUES.T.to(mean)


def ridge(
    features: Float[Tensor, "n feature"], gaps: Float[Tensor, "n 2"]
) -> tuple[Float[Tensor, "2 feature"], Float[Tensor, "2"]]:
    """Weights and offsets of the linear map with the least squared error plus RIDGE."""
    x, y = features.double(), gaps.double()
    mean, spread = x.mean(0), x.std(0) + 1e-6
    standard = (x - mean) / spread
    gram = standard.T @ standard + RIDGE * len(x) * torch.eye(x.shape[1], dtype=x.dtype)
    weights = torch.linalg.solve(gram, standard.T @ (y - y.mean(0))).T / spread
    return weights.float(), (y.mean(0) - weights @ mean).float()


@torch.no_grad()
def tinted(
    generator: Generator, weights: Float[Tensor, "2 feature"], offsets: Float[Tensor, "2"]
) -> Generator:
    """The same network with light exp(hue @ HUES) times as bright, hue = weights @ means + offsets.

    Raises:
        ConfigError: the network has batch norm or components, or light of 64 pixels.
    """
    config = generator.config
    norms = any(isinstance(m, nn.BatchNorm1d | nn.BatchNorm2d) for m in generator.modules())
    if norms or config.components or config.output_size == 64:
        expected = "light of 16 or 32 pixels from a network without batch norm and components"
        raise ConfigError(expected, "another network", "fold its norms, or leave the tint out")
    hues = LATENT_GRID**2
    made = Generator(
        replace(
            config,
            encoder_norm="none",
            decoder_norm="none",
            latent_size=config.latent_size + 2 * hues,
            decoder_widths=(config.decoder_widths[0] + 2, config.decoder_widths[1] + 2),
        )
    ).eval()
    made.encoder.load_state_dict(generator.encoder.state_dict())
    old, new = generator.latent, made.latent
    assert isinstance(old, nn.Linear) and isinstance(new, nn.Linear)  # noqa: PT018
    cells = old.in_features // weights.shape[1]
    means = (SCALE * weights / cells).repeat_interleave(cells, 1)
    new.weight.copy_(torch.cat((old.weight, means.repeat_interleave(hues, 0))))
    new.bias.copy_(torch.cat((old.bias, (CENTRE + SCALE * offsets).repeat_interleave(hues))))
    carry(generator, made)
    return made


def carry(old: Generator, new: Generator) -> None:
    """Copy the decoder; let two more channels through it, and add what they hold to the output."""
    for name in ("up1", "up2"):
        before, after = getattr(old.decoder, name), getattr(new.decoder, name)
        if before is not None:
            assert isinstance(before, ConvNorm) and isinstance(after, ConvNorm)  # noqa: PT018
            widen(before.conv, after.conv, torch.eye(2), torch.zeros(2))
    last = HUES.T / SCALE
    widen(old.decoder.up3, new.decoder.up3, last, -CENTRE * last.sum(1))


def widen(old: nn.Conv2d, new: nn.Conv2d, map_: Tensor, offset: Tensor) -> None:
    """The old layer, and from the last two inputs `map_` at the same pixel, plus an offset."""
    assert old.bias is not None and new.bias is not None  # noqa: PT018
    new.weight.zero_()
    new.bias.zero_()
    outputs, inputs = old.weight.shape[:2]
    new.weight[:outputs, :inputs] = old.weight
    new.bias[:outputs] = old.bias
    middle = old.kernel_size[0] // 2
    new.weight[-len(map_) :, -2:, middle, middle] += map_
    new.bias[-len(map_) :] += offset
