"""Batches of examples that are made while a run goes on: every epoch sees new ones, and once.

An epoch is a data set that is a function of its number, so a run that is killed and resumed sees
what it would have seen. While one is learnt from, the next is made; older ones are removed.
"""

from collections.abc import Collection, Iterator, Sequence
from concurrent.futures import Future, wait
from dataclasses import dataclass
from hashlib import sha256
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch.utils.data import DataLoader

from deeplight.errors import ConfigError, DataSetError
from deeplight.jobs import processes
from deeplight.training.data import (
    Batch,
    BatchSource,
    DataConfig,
    ExampleBytes,
    Order,
    PairOrder,
    step_loader,
    to_device,
)
from deeplight.training.epochs import Epochs, make_epoch
from deeplight.training.network.generator import Orientation
from deeplight.training.share import ALONE, Share

if TYPE_CHECKING:
    from deeplight.training.config import TrainConfig


@dataclass(frozen=True)
class Fresh:
    """What a run learns from instead of its data set's training split.

    Attributes:
        epochs: where examples come from.
        rig_names: as the run counts its rigs.
        orientation: of the photos.
    """

    epochs: Epochs
    rig_names: Sequence[str]
    orientation: Orientation

    def examples(self, number: int, split: str) -> ExampleBytes:
        """The examples of an epoch.

        Raises:
            DataSetError: its rig is not one of the run's.
        """
        data = self.epochs.epoch(number)
        if not set(data.rigs) <= set(self.rig_names):
            got = ", ".join(data.rigs)
            expected = f"the rigs of --data, {', '.join(self.rig_names)}, in new takes"
            raise DataSetError(expected, got, "make --data with `deeplight simulate`")
        return ExampleBytes(data.index(split), self.rig_names, self.orientation)


class FreshBatches:
    """Batches of the steps of a run, as `data.BatchSource` gives them, from new examples.

    An epoch is cut into whole batches; what is left of it is not used. One that is smaller than
    `Epochs.length`, since a panorama could not be read, begins again at its end.
    """

    def __init__(
        self,
        fresh: Fresh,
        config: DataConfig,
        seed: int,
        device: torch.device,
        share: Share = ALONE,
    ) -> None:
        self.fresh, self.config, self.seed = fresh, config, seed
        self.device, self.share = device, share

    def batches(self, batch_size: int, start: int, stop: int) -> Iterator[Batch]:
        """The batches of the steps from `start` to `stop`; `batch_size` is that of the whole."""
        step = start
        with processes(1) as background:  # who stops in the middle does not wait for it
            ahead: Future[None] | None = None
            while step < stop:
                number, first = divmod(step, self.steps(batch_size))
                if ahead is not None:
                    wait([ahead])  # an error comes again where it can be raised whole, below
                examples = self._examples(number)
                last = min(self.steps(batch_size), first + stop - step)
                step += last - first
                if step < stop:
                    ahead = background.submit(make_epoch, self.fresh.epochs, number + 1)
                for batch in self._loader(examples, number, batch_size, first, last):
                    yield to_device(Batch(*batch), self.device)

    def steps(self, batch_size: int) -> int:
        """Of each epoch.

        Raises:
            ConfigError: an epoch is smaller than a batch.
        """
        steps = self.fresh.epochs.length // batch_size
        if not steps:
            got = f"{self.fresh.epochs.length}"
            raise ConfigError(f"epochs of at least a batch of {batch_size}", got, "add takes")
        return steps

    def _examples(self, number: int) -> ExampleBytes:
        return self.fresh.examples(number, self.config.train_split)

    def _loader(
        self, examples: ExampleBytes, number: int, batch_size: int, first: int, last: int
    ) -> DataLoader[Batch]:
        places = examples.index.places if self.config.place_balanced else None
        order = Order(len(examples), self.seed, places).epoch(number)
        positions = np.arange(first * batch_size, last * batch_size)
        rows = order.take(positions, mode="wrap").reshape(-1, batch_size)
        own = [self.share.own(row).tolist() for row in rows]
        return step_loader(examples, own, self.config, self.device)


def with_fresh(fingerprint: str, epochs: Epochs | None, held_out: Collection[str]) -> str:
    """What names the data of a run, the new examples included.

    Raises:
        DataSetError: new examples would be made in places kept for validation or test.
    """
    if epochs is None:
        return fingerprint
    shared = sorted(set(epochs.places).intersection(held_out))
    if shared:
        expected = "new takes apart from the places of validation and test"
        raise DataSetError(expected, ", ".join(shared), "leave their panoramas out")
    return sha256(f"{fingerprint} {epochs.fingerprint}".encode()).hexdigest()


def source_of(
    examples: ExampleBytes,
    config: "TrainConfig",
    device: torch.device,
    share: Share,
    fresh: Fresh | None,
) -> BatchSource | FreshBatches:
    """Where a run's batches come from: `examples`, or new ones.

    Raises:
        ConfigError: new ones on several devices, each of which would film them.
    """
    seed, settings = config.run.seed, config.data
    if fresh is not None:
        if config.loss.steady:
            do = "simulate data sets beforehand and give them with --more"
            raise ConfigError("no --fresh with loss.steady", "both", do)
        if share.ranks > 1:
            do = "simulate data sets beforehand and give them with --more"
            raise ConfigError("one device with --fresh", f"{share.ranks}", do)
        return FreshBatches(fresh, settings, seed, device, share)
    places = examples.index.places if settings.place_balanced else None
    if config.loss.steady:
        refuse_for_pairs(config.schedule.batch_size, share)
        return BatchSource(
            examples, settings, PairOrder(examples.index.takes, seed, places), device, share
        )
    order = Order(len(examples), seed, places)
    return BatchSource(examples, settings, order, device, share)


def refuse_for_pairs(batch_size: int, share: Share) -> None:
    """A batch of pairs has an even number of examples, all on one device.

    Raises:
        ConfigError: it has not.
    """
    if batch_size % 2:
        raise ConfigError("an even schedule.batch_size for loss.steady", f"{batch_size}", "add one")
    if share.ranks > 1:
        raise ConfigError("one device for loss.steady", f"{share.ranks}", "leave --devices at 1")
