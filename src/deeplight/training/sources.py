"""The data sets of a run: one that is validated on, and any number more to learn from."""

from collections.abc import Sequence
from functools import cached_property
from hashlib import sha256
from pathlib import Path

import numpy as np

from deeplight.dataset import GROUPS, Chosen, SplitIndex, open_dataset
from deeplight.errors import DataSetError
from deeplight.sphere import Rig
from deeplight.training.data import DataConfig


class Sources:
    """Several data sets seen as one; only the first one's validation splits are used."""

    def __init__(self, first: Path | str, more: Sequence[Path | str] = ()) -> None:
        """Open them; shards are looked at only when they are read.

        Raises:
            DataSetError: one is missing or broken, or two mean different rigs by one name.
        """
        self.sets = tuple(open_dataset(where) for where in (first, *more))
        self.rigs: dict[str, Rig] = {}
        for part in self.sets:
            for name, rig in part.rigs.items():
                if self.rigs.setdefault(name, rig).to_dict() != rig.to_dict():
                    expected = f"one rig named {name!r}"
                    do = "make it with the same rig, or under another name"
                    raise DataSetError(expected, f"another in {part.address}", do)

    @property
    def address(self) -> str:
        """Where they lie, in words."""
        return ", ".join(part.address for part in self.sets)

    @cached_property
    def fingerprint(self) -> str:
        """Names the content of all; of a single one it is its manifest's checksum."""
        sums = [part.manifest_sha256 for part in self.sets]
        return sums[0] if len(sums) == 1 else sha256("".join(sums).encode()).hexdigest()

    def training(self, config: DataConfig, seed: int) -> Chosen:
        """The examples to learn from."""
        return Chosen([part.index(config.train_split) for part in self.sets], config.places, seed)

    def validation(self, config: DataConfig) -> dict[str, SplitIndex]:
        """The splits to validate on: those of `config` that the first data set has.

        Raises:
            DataSetError: it has none of them.
        """
        first, wanted = self.sets[0], config.validation_splits
        there = [split for split in wanted if first.manifest.examples(split)]
        return {split: first.index(split) for split in there or wanted}

    def refuse_held_out(self, training: Chosen) -> None:
        """Nothing is learnt from a place that any of the data sets keeps for validation or test."""
        shared = sorted(self.held_out.intersection(np.unique(training.places).tolist()))
        if shared:
            expected = "training places apart from those of validation and test"
            raise DataSetError(expected, ", ".join(shared), "leave the data set that has them out")

    @property
    def held_out(self) -> set[str]:
        """Places that any of the data sets keeps for validation or test."""
        return {
            place
            for part in self.sets
            for split in (*GROUPS["val"], *GROUPS["test"])
            for place in part.manifest.places(split)
        }
