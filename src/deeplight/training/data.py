"""Which examples belong to which step, and reading them without holding training back."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor
from torch.utils.data import DataLoader, Dataset

from deeplight.dataset import Chosen, SplitIndex
from deeplight.errors import ConfigError
from deeplight.jobs import begin_worker
from deeplight.preprocess import landscape_background
from deeplight.training.network.generator import PHOTO_SIZE, Orientation
from deeplight.training.share import ALONE, Share


@dataclass(frozen=True)
class DataConfig:
    """Which examples are used and how they are read."""

    train_split: str = "train"
    validation_splits: tuple[str, ...] = ("val_indoor", "val_outdoor")
    validation_examples: int = 512
    """At most this number of each validation split, evenly spread over it."""
    places: int = 0
    """Learn from this number of training places only, which `run.seed` draws; 0 is all of them."""
    place_balanced: bool = False
    """Draw every place equally often, however many examples it has."""
    workers: int = 2
    """Processes that decode; they do not change the result."""
    preload_gib: float = 2.0
    """A split no larger than this once decoded is held in memory (on the GPU if there is one)."""


POSE = "world_from_camera"
"""Of an example's details: how the camera was held."""


class Batch(NamedTuple):
    """Bytes: photo (n, height, width, 3), spheres (n, sphere, size, size, 3); and rig (n)."""

    photo: Tensor
    spheres: Tensor
    rig: Tensor


class ExampleBytes(Dataset[Batch]):
    """The examples of a split as tensors of bytes; a rig is its index in `rig_names`.

    For the landscape network portrait backgrounds are cut to their middle.
    """

    def __init__(
        self,
        index: SplitIndex | Chosen,
        rig_names: Sequence[str],
        orientation: Orientation = "portrait",
    ) -> None:
        self.index, self.orientation = index, orientation
        numbers = {name: number for number, name in enumerate(rig_names)}
        self.rigs = torch.tensor([numbers[name] for name in index.rigs.tolist()])

    def __len__(self) -> int:
        return len(self.index)

    def __getitem__(self, number: int) -> Batch:
        background, spheres = self.index.pixels(number)
        if self.orientation == "landscape" and len(background) == PHOTO_SIZE["portrait"][0]:
            background = landscape_background(background)
        return Batch(torch.tensor(background), torch.tensor(spheres), self.rigs[number])


class Order:
    """The endless sequence of example indices of a run, a pure function of seed and position.

    Epoch after epoch, each a new permutation, cut into batches without regard to where an epoch
    ends: no example is left out, and any step can be computed without the steps before it.
    """

    def __init__(self, count: int, seed: int, places: np.ndarray | None = None) -> None:
        self.count = count
        self.seed = seed
        self.groups = (
            None if places is None else [np.flatnonzero(places == p) for p in np.unique(places)]
        )
        self.cached: tuple[int, np.ndarray] = (-1, np.empty(0, np.int64))

    def epoch(self, number: int) -> Int[np.ndarray, "count"]:
        """The order of one epoch; place-balanced, it draws each place `count / places` times."""
        if self.cached[0] != number:
            random = np.random.default_rng([self.seed, number])
            order = (
                random.permutation(self.count)
                if self.groups is None
                else balanced_order(self.groups, self.count, random)
            )
            self.cached = (number, order)
        return self.cached[1]

    def batch(self, step: int, batch_size: int) -> Int[np.ndarray, "batch"]:
        """Indices of the examples of batch `step`."""
        positions = np.arange(step * batch_size, (step + 1) * batch_size)
        epochs = positions // self.count
        parts = [self.epoch(int(e))[positions[epochs == e] % self.count] for e in np.unique(epochs)]
        return np.concatenate(parts)


class PairOrder(Order):
    """As `Order`, of pairs of frames that follow each other in a take: a batch's first half are the
    first frames, its second half the second ones.

    Raises:
        ConfigError: no take has two frames.
    """

    def __init__(self, takes: np.ndarray, seed: int, places: np.ndarray | None = None) -> None:
        self.first = np.flatnonzero(takes[1:] == takes[:-1])
        if not len(self.first):
            do = "film takes of at least two frames, or leave loss.steady at 0"
            raise ConfigError("frames that follow each other for loss.steady", "none", do)
        super().__init__(len(self.first), seed, None if places is None else places[self.first])

    def batch(self, step: int, batch_size: int) -> Int[np.ndarray, "batch"]:
        """Indices of the examples of batch `step`, an even number of them."""
        first = self.first[super().batch(step, batch_size // 2)]
        return np.concatenate((first, first + 1))


def balanced_order(
    groups: Sequence[np.ndarray], count: int, random: np.random.Generator
) -> Int[np.ndarray, "count"]:
    """`count` indices in random order, each group as often as the others, give or take one."""
    shares = np.full(len(groups), count // len(groups))
    shares[random.permutation(len(groups))[: count % len(groups)]] += 1
    drawn = [
        np.concatenate([random.permutation(group) for _ in range(-(-share // len(group)))])[:share]
        for group, share in zip(groups, shares, strict=True)
        if share
    ]
    return random.permutation(np.concatenate(drawn))


@dataclass(frozen=True)
class StepIndices:
    """Sampler over the batches of the steps from `start` to `stop`: this process's rows of each."""

    order: Order
    batch_size: int
    start: int
    stop: int
    share: Share = ALONE

    def __iter__(self) -> Iterator[list[int]]:
        for step in range(self.start, self.stop):
            yield self.share.own(self.order.batch(step, self.batch_size)).tolist()

    def __len__(self) -> int:
        return self.stop - self.start


def decoded_gib(examples: ExampleBytes) -> float:
    """Memory that all examples take once decoded."""
    first = examples[0]
    return len(examples) * (first.photo.nbytes + first.spheres.nbytes) / 2**30


def _begin_worker(_number: int) -> None:
    begin_worker()


def preload(examples: Dataset[Batch], workers: int, batch_size: int = 16) -> Batch:
    """All examples decoded, in order."""
    first = examples[0]
    count = len(examples)  # type: ignore[arg-type]
    whole = Batch(*(part.new_empty((count, *part.shape)) for part in first))
    start = 0
    for batch in DataLoader(
        examples, batch_size, num_workers=workers, worker_init_fn=_begin_worker
    ):
        for table, part in zip(whole, batch, strict=True):
            table[start : start + len(part)] = part
        start += len(batch[0])
    return whole


def step_loader(
    examples: ExampleBytes, rows: Iterable[list[int]], config: DataConfig, device: torch.device
) -> DataLoader[Batch]:
    """The decoded batches of a run's steps: the examples of each of `rows`."""
    return DataLoader(
        examples,
        batch_sampler=rows,
        num_workers=config.workers,
        prefetch_factor=2 if config.workers else None,
        pin_memory=device.type == "cuda",
        worker_init_fn=_begin_worker,
    )


def take(table: Batch, indices: np.ndarray) -> Batch:
    """Examples of a preloaded table; the rig stays on the CPU."""
    rows = torch.from_numpy(indices)
    on_device = rows.to(table.photo.device, non_blocking=True)
    return Batch(table.photo[on_device], table.spheres[on_device], table.rig[rows])


def to_device(batch: Batch, device: torch.device) -> Batch:
    """Photo and spheres to the device; the rig stays on the CPU, where the loss groups by it."""
    return Batch(
        batch.photo.to(device, non_blocking=True),
        batch.spheres.to(device, non_blocking=True),
        batch.rig,
    )


class BatchSource:
    """Batches of the steps of a run, on the device: this process's rows of each."""

    def __init__(
        self,
        examples: ExampleBytes,
        config: DataConfig,
        order: Order,
        device: torch.device,
        share: Share = ALONE,
    ) -> None:
        self.examples, self.config, self.order, self.device = examples, config, order, device
        self.share = share
        self.table: Batch | None = None
        if decoded_gib(examples) <= config.preload_gib:
            self.table = to_device(preload(examples, config.workers), device)

    def turns(self, batch_size: int, step: int) -> Float[Tensor, "pairs 3 3"]:
        """How the camera turned within each pair of a `PairOrder`'s batch: the second frame's
        directions from the first one's.

        Raises:
            ConfigError: an example does not say how its camera was held.
        """
        details = [self.examples.index.details(int(n)) for n in self.order.batch(step, batch_size)]
        if not all(POSE in each for each in details):
            do = "use data of `deeplight simulate`, or leave loss.steady at 0"
            raise ConfigError("examples that say how the camera was held", "others", do)
        poses = torch.tensor([each[POSE] for each in details], dtype=torch.float32)
        first, second = poses.chunk(2)
        return (second.mT @ first).to(self.device)

    def batches(self, batch_size: int, start: int, stop: int) -> Iterator[Batch]:
        """The batches of the steps from `start` to `stop`; `batch_size` is that of the whole."""
        if self.table is not None:
            for step in range(start, stop):
                yield take(self.table, self.share.own(self.order.batch(step, batch_size)))
            return
        rows = StepIndices(self.order, batch_size, start, stop, self.share)
        for batch in step_loader(self.examples, rows, self.config, self.device):
            yield to_device(Batch(*batch), self.device)


def refuse_other_size(examples: ExampleBytes, orientation: Orientation) -> None:
    """Landscape backgrounds need the landscape network."""
    expected, (height, width, _) = PHOTO_SIZE[orientation], examples[0].photo.shape
    if (height, width) != expected:
        raise ConfigError(
            f"photos of {expected[0]} x {expected[1]} for network.orientation={orientation}",
            f"{height} x {width}",
            "choose the other orientation",
        )
