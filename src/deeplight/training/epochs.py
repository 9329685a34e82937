"""New examples in epochs, each a data set made by its number; without torch.

The process that makes the next epoch imports this module alone, so it starts in a fraction of the
time and memory of one that trains.
"""

from collections.abc import Collection
from typing import Protocol, runtime_checkable

from deeplight.dataset import DataSet


@runtime_checkable
class Epochs(Protocol):
    """Where new examples come from; `simulate.epochs.FilmedEpochs` is ours.

    It can be pickled: the next epoch is made in another process.
    """

    @property
    def fingerprint(self) -> str:
        """A name made of all that decides them."""

    @property
    def places(self) -> Collection[str]:
        """That they are made of."""

    @property
    def length(self) -> int:
        """Examples of each epoch, at most."""

    def epoch(self, number: int) -> DataSet:
        """The data set of an epoch: the same whenever it is asked for, made if it is not there.

        Older epochs may be gone afterwards.
        """


def make_epoch(epochs: Epochs, number: int) -> None:
    """Make an epoch in another process; it is found on the disk."""
    epochs.epoch(number)
