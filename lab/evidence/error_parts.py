"""What the model's errors are made of: brightness, hue, and how the light is spread.

    python -m lab.evidence.error_parts data/sim

On the validation places, each estimate is changed with the help of the truth (one brightness, one
hue for all of its light), or without it (contrast, or dimmed but for the brightest pixels), and is
measured again. What the first kind gains is the most that a better brightness or hue could bring;
the second kind shows what one sphere gains at the cost of another.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import tyro
from torch import Tensor

from deeplight.camera_response import GAMMA
from deeplight.dataset import open_dataset
from deeplight.sphere import SPHERES
from deeplight.training.augment import prepare
from deeplight.training.data import ExampleBytes
from deeplight.training.losses import RigBases, masked_l1, soft_clip
from deeplight.training.model_file import load_network
from deeplight.training.validation import some_of

SHIPPED = Path(__file__).resolve().parents[2] / "src/deeplight/weights/deeplight.onnx"
SPLITS = ("val_indoor", "val_outdoor")
SCALES = torch.linspace(-1.5, 1.5, 25)  # added to ln radiance
DARK = 0.003  # added to linear values before a logarithm
DIFFUSE = list(SPHERES).index("diffuse")
CHUNK = 96


@dataclass(frozen=True)
class Args:
    """Options of the benchmark."""

    data: Annotated[str, tyro.conf.Positional]
    """Folder of a data set with validation splits."""
    model: Path = SHIPPED
    """A trained network: .onnx, best.safetensors or a run's folder."""


class Bench:
    """The validation examples and the network's light for them."""

    def __init__(self, args: Args) -> None:
        data, (network, _) = open_dataset(args.data), load_network(args.model)
        self.bases = RigBases.of([data.bases(rig) for rig in data.rigs])
        indices = [data.index(split) for split in SPLITS]
        parts = [
            prepare(*some_of(ExampleBytes(index, list(data.rigs)), len(index), 0))
            for index in indices
        ]
        self.places = np.concatenate([index.places for index in indices])
        self.spheres = torch.cat([part.spheres for part in parts])
        self.rig = torch.cat([part.rig for part in parts])
        self.light = torch.cat(
            [network(chunk) for part in parts for chunk in torch.split(part.photo, CHUNK)]
        )

    def chunks(self, light: Tensor) -> Iterator[tuple[Tensor, Tensor, Tensor]]:
        """Rendered spheres, filmed ones and masks."""
        for first in range(0, len(light), CHUNK):
            rows = slice(first, first + CHUNK)
            rig = self.rig[rows]
            yield self.bases.render(light[rows], rig), self.spheres[rows], self.bases.masks(rig)

    def errors(self, light: Tensor) -> Tensor:
        """L1 of each example and sphere."""
        return torch.cat([masked_l1(*chunk, "plain") for chunk in self.chunks(light)])

    def colours(self) -> tuple[Tensor, Tensor]:
        """ln of the diffuse sphere's mean linear colour, rendered and filmed."""
        both = [
            (mean_colour(soft_clip(rendered), mask), mean_colour(filmed**GAMMA, mask))
            for rendered, filmed, mask in self.chunks(self.light)
        ]
        rendered, filmed = (torch.cat(part) for part in zip(*both, strict=True))
        return rendered, filmed


def mean_colour(linear: Tensor, mask: Tensor) -> Tensor:
    """Of the diffuse sphere: (n, 3), as a logarithm."""
    inside = mask[:, DIFFUSE]
    mean = (linear[:, DIFFUSE] * inside).sum(2) / inside.sum(2)
    return (mean.clamp_min(0) + DARK).log()


def contrast(light: Tensor, power: float) -> Tensor:
    """Radiance to a power, with the same total."""
    total = torch.logsumexp(light.flatten(1), 1)
    gap = total - torch.logsumexp((power * light).flatten(1), 1)
    return power * light + gap[:, None, None, None]


def dimmed(light: Tensor, factor: float, share: float = 0.05) -> Tensor:
    """`factor` times as bright but for the brightest `share` of pixels; these keep the total."""
    brightness = light.exp().mean(1, keepdim=True).flatten(1)
    bright = brightness >= torch.quantile(brightness, 1 - share, dim=1, keepdim=True)
    bright = bright.reshape(len(light), 1, *light.shape[-2:]).expand_as(light)
    radiance = light.exp()
    dim, rest = (torch.where(m, radiance, 0).sum((1, 2, 3)) for m in (~bright, bright))
    gain = (rest + (1 - factor) * dim) / rest
    return torch.where(bright, radiance * gain[:, None, None, None], radiance * factor).log()


def variants(bench: Bench, gap: Tensor) -> Mapping[str, Tensor]:
    """L1 of each example and sphere by what was done to the light.

    `gap` is how much ln of the diffuse sphere's filmed colour is above that of the rendered one.
    """
    light = bench.light
    scaled = torch.stack([bench.errors(light + float(scale)) for scale in SCALES])
    hue = (gap - gap.mean(1, keepdim=True))[:, :, None, None]
    return {
        "as it is": bench.errors(light),
        "the best brightness of each example for each sphere": scaled.min(0).values,
        "the filmed hue of each example": bench.errors(light + hue),
        "0.78 times as bright": bench.errors(light - 0.25),
        "radiance to the power of 1.3": bench.errors(contrast(light, 1.3)),
        "0.7 times as bright but for 5 % of pixels": bench.errors(dimmed(light, 0.7)),
    }


@torch.no_grad()
def main(args: Args) -> None:
    """Print a table and the parts of the error of brightness."""
    torch.set_num_threads(1)
    bench = Bench(args)
    rendered, filmed = bench.colours()
    print("| light | diffuse | silver | mirror |\n|---|---|---|---|")
    for words, errors in variants(bench, filmed - rendered).items():
        mirror, silver, diffuse = errors.mean(0).tolist()
        print(f"| {words} | {diffuse:.3f} | {silver:.3f} | {mirror:.3f} |")
    error = (rendered - filmed).mean(1).numpy()
    names = np.unique(bench.places)
    means = {name: error[bench.places == name].mean() for name in names}
    within = error - np.array([means[place] for place in bench.places])
    root, share = np.sqrt((error**2).mean()), (within**2).mean() / (error**2).mean()
    spread = filmed.mean(1).numpy().std()
    print(f"\nln of the diffuse sphere's brightness: {spread:.2f} standard deviation,")
    print(f"{root:.2f} root mean square error; {share:.0%} of it (squared) within places")


if __name__ == "__main__":
    main(tyro.cli(Args))
