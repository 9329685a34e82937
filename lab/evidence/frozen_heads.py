"""What more places, one sphere alone or other data would change, found in minutes on a CPU.

    python -m lab.evidence.frozen_heads data/sim --imagenet mobilenet_v2_imagenet_folded.npz
    python -m lab.evidence.frozen_heads data/sim --imagenet ... --rows more --more data/varied

A stand-in for training the network: MobileNetV2's ImageNet features stay frozen and are computed
once; a small head (256 units, 40 principal components of ln radiance) learns on them from the
relighting loss, with the same number of steps in every row. It is not the network of the paper:
read its numbers next to each other, not next to the model's. Everything is measured on the
validation places, with the metrics of `deeplight evaluate`.
"""

import math
import statistics
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import torch
import tyro
from torch import Tensor, nn

from deeplight.dataset import SplitIndex, open_dataset
from deeplight.errors import ConfigError
from deeplight.evaluate.scores import Scores, rendered_radiance, score
from deeplight.io.atomic import replacing
from deeplight.reflectance import rig_bases
from deeplight.solve import light_from_spheres
from deeplight.sphere import SPHERES, Rig
from deeplight.training.data import balanced_order
from deeplight.training.fitted import principal_components
from deeplight.training.network.generator import START_RADIANCE
from deeplight.training.network.imagenet import load_imagenet
from deeplight.training.network.mobilenet_v2 import MobileNetV2Encoder
from lab.evidence.some_pixels import SomePixels

VALIDATION = ("val_indoor", "val_outdoor")
COMPONENTS, DIRECTIONS, HIDDEN, DROPOUT = 40, 384, 256, 0.3
BATCH, LEARNING_RATE, WEIGHT_DECAY, AVERAGE = 128, 3e-3, 1e-2, 0.99
FITS = 1000
REPORTED = ("l1_diffuse", "l1_matte_silver", "l1_mirror", "theta_rgb_deg")
WEIGHTS = {  # mirror, matte silver, diffuse
    "all, 0.4 / 0.2 / 0.4": (0.4, 0.2, 0.4),
    "all, the paper's 0.2 / 0.2 / 0.6": (0.2, 0.2, 0.6),
    "mirror only": (1.0, 0.0, 0.0),
    "matte silver only": (0.0, 1.0, 0.0),
    "diffuse only": (0.0, 0.0, 1.0),
}


@dataclass(frozen=True)
class Args:
    """Options of the benchmark."""

    data: Annotated[str, tyro.conf.Positional]
    """Folder of a data set with one rig."""
    imagenet: Path
    """Folded MobileNetV2 weights."""
    rows: tuple[Literal["places", "spheres", "more"], ...] = ("places", "spheres")
    """Which tables."""
    more: tuple[str, ...] = ()
    """Further data sets whose training examples are added in turn."""
    cache: Path = Path("out/frozen_heads")
    """Where features are kept."""
    every: int = 3
    """Take one training example as it is and the next one flipped."""
    steps: int = 300
    """Steps of every head."""
    seeds: int = 3
    """Heads of each row; the mean and their standard deviation are reported."""


@dataclass(frozen=True, eq=False)
class PhotoFeatures:
    """Photos as features, and the spheres filmed with them."""

    features: Tensor  # (n, 4800)
    spheres: np.ndarray  # (n, sphere, size, size, 3), bytes
    flipped: Tensor  # (n,), photo mirrored, spheres not
    places: np.ndarray

    def joined(self, other: "PhotoFeatures") -> "PhotoFeatures":
        """Both."""
        return PhotoFeatures(
            torch.cat((self.features, other.features)),
            np.concatenate((self.spheres, other.spheres)),
            torch.cat((self.flipped, other.flipped)),
            np.concatenate((self.places, other.places)),
        )


def main(args: Args) -> None:
    """Print the tables."""
    torch.set_num_threads(1)
    data = open_dataset(args.data)
    if len(data.rigs) != 1:
        raise ConfigError("a data set with one rig", f"{len(data.rigs)}", "use a simulated one")
    (rig,) = data.rigs.values()
    encoder = MobileNetV2Encoder("none").eval()
    load_imagenet(encoder, args.imagenet)
    train = training_views(args, args.data, encoder)
    kept = [views(data.index(s), encoder, args.cache / f"{s}.npy") for s in VALIDATION]
    bench = Bench(rig, train, kept[0].joined(kept[1]), args.steps)
    print("| head | diffuse | silver | mirror | angle of colour, ° |\n|---|---|---|---|---|")
    if "places" in args.rows:
        names = np.unique(train.places)
        for share in (0.25, 0.5, 1.0):
            count = round(share * len(names))
            bench.report(f"{count} places", train, args.seeds, count)
    for name, weights in WEIGHTS.items() if "spheres" in args.rows else ():
        bench.report(name, train, args.seeds, weights=weights)
    if "more" in args.rows:
        bench.report("as above", train, args.seeds)
        for address in args.more:
            added = training_views(args, address, encoder)
            words = f"and {len(added.places)} views of {address}"
            bench.report(words, train.joined(added), args.seeds)


def training_views(args: Args, address: str, encoder: MobileNetV2Encoder) -> PhotoFeatures:
    """Some of a data set's training examples, some as they are and some flipped."""
    index, name = open_dataset(address).index("train"), Path(address).name
    straight, mirrored = (
        views(
            index, encoder, args.cache / f"{name}-{args.every}-{start}.npy",
            np.arange(start, len(index), args.every), flip=start == 1,
        )
        for start in (0, 1)
    )  # fmt: skip
    return straight.joined(mirrored)


def views(
    index: SplitIndex, encoder: MobileNetV2Encoder, cached: Path,
    chosen: np.ndarray | None = None, flip: bool = False,
) -> PhotoFeatures:  # fmt: skip
    """The features of examples of a split, computed once."""
    numbers = np.arange(len(index)) if chosen is None else chosen
    spheres = np.stack([index.pixels(int(n))[1] for n in numbers])
    if not cached.is_file():
        found = torch.cat(list(features_of(index, encoder, numbers, flip)))
        with replacing(cached) as temporary:
            np.save(temporary, found.half().numpy())
    features = torch.from_numpy(np.load(cached, allow_pickle=False)).float()
    flipped = torch.full((len(numbers),), flip)
    return PhotoFeatures(features, spheres, flipped, index.places[numbers])


@torch.no_grad()
def features_of(
    index: SplitIndex, encoder: MobileNetV2Encoder, numbers: np.ndarray, flip: bool
) -> Iterator[Tensor]:
    """Batch by batch."""
    for chunk in np.array_split(numbers, max(1, len(numbers) // 32)):
        photos = torch.from_numpy(np.stack([index.pixels(int(n))[0] for n in chunk]))
        photo = photos.permute(0, 3, 1, 2).float() / 255 - 0.5
        yield encoder(photo.flip(-1) if flip else photo).flatten(1)


class Head(nn.Module):
    """Features -> weights of the principal components of ln radiance."""

    def __init__(self, size: int, mean: Tensor, components: Tensor) -> None:
        super().__init__()
        self.inner = nn.Sequential(
            nn.Dropout(DROPOUT), nn.Linear(size, HIDDEN), nn.BatchNorm1d(HIDDEN), nn.ReLU6(),
            nn.Dropout(DROPOUT),
        )  # fmt: skip
        self.mix = nn.Linear(HIDDEN, len(components))
        nn.init.zeros_(self.mix.weight)
        nn.init.zeros_(self.mix.bias)
        self.mean, self.components = mean, components

    def forward(self, features: Tensor) -> Tensor:
        mixed: Tensor = self.mix(self.inner(features)) @ self.components.flatten(1)
        return self.mean + mixed.reshape(-1, *self.mean.shape)  # (n, 3, size, size)


class Bench:
    """What every row shares: the rig, the components, the validation views."""

    def __init__(self, rig: Rig, train: PhotoFeatures, val: PhotoFeatures, steps: int) -> None:
        self.val, self.steps, self.bases = val, steps, rig_bases(rig)
        self.pixels = SomePixels(self.bases)
        self.mean, self.components = principal_components(self.fits(train), COMPONENTS, True, True)

    def fits(self, train: PhotoFeatures) -> Tensor:
        """ln radiance that explains some of the training spheres."""
        numbers = np.linspace(0, len(train.spheres) - 1, FITS).astype(int)
        lights = np.stack(
            [
                light_from_spheres(
                    dict(zip(SPHERES, train.spheres[n], strict=True)), self.bases
                ).radiance
                for n in numbers
            ]
        )
        known = np.where(lights > 0, lights, START_RADIANCE)
        return torch.from_numpy(np.log(known)).float().permute(0, 3, 1, 2)

    def report(
        self, name: str, train: PhotoFeatures, seeds: int, places: int | None = None,
        weights: tuple[float, ...] = (0.4, 0.2, 0.4),
    ) -> None:  # fmt: skip
        """Train a head from each seed, with this number of places, and print a row."""
        rows = []
        for seed in range(seeds):
            names = np.random.default_rng(seed).permutation(np.unique(train.places))
            chosen = np.flatnonzero(np.isin(train.places, names[:places]))
            metrics = self.measured(train, chosen, weights, seed).metrics()
            rows.append([float(np.nanmean(metrics[metric])) for metric in REPORTED])
        cells = [
            f"{statistics.mean(values):.3f} ± {statistics.pstdev(values):.3f}"
            for values in zip(*rows, strict=True)
        ]
        print(f"| {name} | {' | '.join(cells)} |", flush=True)

    def measured(
        self, train: PhotoFeatures, chosen: np.ndarray, weights: tuple[float, ...], seed: int
    ) -> Scores:
        """Scores of a new head on the validation views."""
        torch.manual_seed(seed)
        average = train.features[chosen].mean(0)
        kept = min(DIRECTIONS, len(chosen) // 2)
        _, scale, directions = torch.svd_lowrank(train.features[chosen] - average, kept)
        turn = directions / (scale / math.sqrt(len(chosen)))
        head = Head(kept, self.mean, self.components)
        head = self.trained(head, (train.features - average) @ turn, train, chosen, weights, seed)
        with torch.no_grad():
            answer = head((self.val.features - average) @ turn)
        log_radiance = answer.permute(0, 2, 3, 1).contiguous().numpy()
        rendered = rendered_radiance(self.bases, log_radiance)
        filmed = {
            name: self.val.spheres[:, number].astype(np.float32) / np.float32(255)
            for number, name in enumerate(SPHERES)
        }
        return score(rendered, filmed, self.bases)

    def trained(
        self, head: Head, features: Tensor, train: PhotoFeatures, chosen: np.ndarray,
        weights: Sequence[float], seed: int,
    ) -> Head:  # fmt: skip
        """The moving average of a head's weights after the steps, all places equally often seen."""
        optimiser = torch.optim.AdamW(
            head.parameters(), lr=LEARNING_RATE, weight_decay=WEIGHT_DECAY
        )
        schedule = torch.optim.lr_scheduler.OneCycleLR(
            optimiser,
            LEARNING_RATE,
            self.steps,
            pct_start=0.05,
            div_factor=20,
            cycle_momentum=False,
        )
        ema = torch.optim.swa_utils.get_ema_multi_avg_fn(AVERAGE)  # type: ignore[no-untyped-call]
        average = torch.optim.swa_utils.AveragedModel(head, multi_avg_fn=ema, use_buffers=True)
        random = np.random.default_rng(seed)
        places = train.places[chosen]
        groups = [chosen[places == place] for place in np.unique(places)]
        for _ in range(self.steps):
            batch = balanced_order(groups, BATCH, random)
            answer = head(features[batch])
            flipped = train.flipped[batch][:, None, None, None]
            loss = self.pixels.loss(
                torch.where(flipped, answer.flip(-1), answer), train.spheres[batch], weights, random
            )
            optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            optimiser.step()
            schedule.step()
            average.update_parameters(head)
        averaged: Head = average.module.eval()  # type: ignore[assignment]
        return averaged


if __name__ == "__main__":
    main(tyro.cli(Args))
