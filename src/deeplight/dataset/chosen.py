"""The examples that a run learns from: of one data set or several, of all places or some."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import UInt8

from deeplight.dataset.reading import SplitIndex
from deeplight.errors import DataSetError


class Chosen:
    """Examples of several indices, numbered through, in the order of the indices.

    Attributes:
        places, rigs: of all examples, as arrays of text.
        takes: names, those of two indices or places never alike.
    """

    def __init__(self, indices: Sequence[SplitIndex], places: int = 0, seed: int = 0) -> None:
        """Take all examples, or those of a number of places, which `seed` draws.

        The places of a smaller number are among those of a larger one, so that a learning curve
        adds places to those that were there.

        Raises:
            DataSetError: there are fewer places than that.
        """
        self._indices = tuple(indices)
        every = np.concatenate([index.places for index in indices])
        names = np.unique(every)
        if places > len(names):
            do = "lower data.places, or give more data"
            raise DataSetError(f"{places} training places", str(len(names)), do)
        drawn = np.random.default_rng(seed).permutation(names)[: places or len(names)]
        kept = np.flatnonzero(np.isin(every, drawn))
        counts = [len(index) for index in indices]
        self._part = np.repeat(np.arange(len(counts)), counts)[kept]
        self._number = np.concatenate([np.arange(count) for count in counts])[kept]
        self.places = every[kept]
        self.rigs = np.concatenate([index.rigs for index in indices])[kept]

        clips = [f"{part}: {place}: " for part, place in zip(self._part, self.places, strict=True)]
        self.takes = np.char.add(clips, np.concatenate([index.takes for index in indices])[kept])

    def __len__(self) -> int:
        return len(self.places)

    def details(self, number: int) -> Mapping[str, Any]:
        """Give `ExampleMeta.details` of an example, without its pictures."""
        return self._indices[self._part[number]].details(int(self._number[number]))

    def pixels(
        self, number: int
    ) -> tuple[UInt8[np.ndarray, "height width 3"], UInt8[np.ndarray, "3 size size 3"]]:
        """Give background and spheres of one example, as `SplitIndex.pixels` does."""
        return self._indices[self._part[number]].pixels(int(self._number[number]))
