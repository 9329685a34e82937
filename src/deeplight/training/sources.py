"""The data sets of a run: one that is validated on, and any number more to learn from."""

from collections.abc import Sequence
from functools import cached_property
from hashlib import sha256
from pathlib import Path

import numpy as np

from deeplight.dataset import GROUPS, Chosen, SplitIndex, open_dataset
from deeplight.errors import DataSetError
from deeplight.reflectance import ReflectanceBasis
from deeplight.sphere import Rig
from deeplight.training.data import DataConfig


class Sources:
    """Several data sets seen as one; only the first one's validation splits are used."""

    def __init__(
        self, first: Path | str, more: Sequence[Path | str] = (), bases: Path | None = None
    ) -> None:
        """Open them; shards are looked at only when they are read.

        Args:
            bases: measured reflectance bases of all spheres; left out, each data set's own.

        Raises:
            DataSetError: one is missing or broken, or two mean different rigs by one name.
        """
        opened = (open_dataset(where) for where in (first, *more))
        self.sets = tuple(data.with_bases(bases) if bases else data for data in opened)
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

    def bases(self, rig: str, light_size: int) -> dict[str, ReflectanceBasis]:
        """What a rig's spheres reflect: measured if its data set carries that, else analytic.

        Raises:
            DataSetError: data sets that share the rig carry different bases.
        """
        having = [part for part in self.sets if rig in part.rigs]
        if len({part.bases_sha256 for part in having}) > 1:
            expected = f"one reflectance of the spheres of rig {rig!r}"
            got = f"different bases in {', '.join(part.address for part in having)}"
            raise DataSetError(expected, got, "name one file with --set loss.bases=FILE")
        return having[0].bases(rig, light_size)

    @cached_property
    def fingerprint(self) -> str:
        """A name of the content of all; of one without bases it is its manifest's checksum."""
        sums = [part.manifest_sha256 for part in self.sets]
        sums += [part.bases_sha256 for part in self.sets if part.bases_file is not None]
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
