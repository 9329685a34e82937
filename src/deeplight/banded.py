"""Products with matrices that are zero but for a narrow band, as resampling along an axis is.

Numpy is slow where its inner loop is a texel's three channels; products of narrow bands are not.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
from jaxtyping import Float, Float32, Int, Shaped

BLAS_ALONE = 1 << 18
"""Multiplications of a product that OpenBLAS makes with one thread: after a larger one its threads
wait for more in a busy loop."""


Ids = Int[np.ndarray, "parts some more"]


@dataclass(frozen=True, eq=False)
class Bands:
    """A matrix from pixels to results, in parts of neighbouring results: few zeros are left in it.

    Attributes:
        first: pixel that each part begins at.
        weight: of that and the following pixels in the part's results.
        count: of results; the last part may have more.
    """

    first: Int[np.ndarray, " parts"]
    weight: Float32[np.ndarray, "parts pixels results"]
    count: int

    def for_channels(self, channels: int) -> Self:
        """The same for lines in which each pixel is `channels` numbers, one after the other."""
        parts, pixels, results = self.weight.shape
        spread = np.zeros((parts, pixels, channels, results, channels), np.float32)
        for channel in range(channels):
            spread[:, :, channel, :, channel] = self.weight
        weight = spread.reshape(parts, pixels * channels, results * channels)
        return type(self)(self.first * channels, weight, self.count * channels)

    def along_lines(
        self, lines: Float32[np.ndarray, "lines pixels"]
    ) -> Float32[np.ndarray, "lines results"]:
        """Bring each line to its results."""
        parts, taken, given = self.weight.shape
        found = np.empty((len(lines), parts * given), np.float32)
        for part, (first, weight) in enumerate(zip(self.first.tolist(), self.weight, strict=True)):
            results = found[:, part * given : (part + 1) * given]
            np.matmul(lines[:, first : first + taken], weight, out=results)
        return found[:, : self.count]

    def across_lines(
        self, lines: Shaped[np.ndarray, "pixels *numbers"]
    ) -> Float32[np.ndarray, "results *numbers"]:
        """Mix whole lines; of any type, made float32 by parts, which stay near the processor."""
        parts, taken, given = self.weight.shape
        numbers = lines.shape[1:]
        found = np.empty((parts, given, math.prod(numbers)), np.float32)
        for results, first, weight in zip(found, self.first.tolist(), self.weight, strict=True):
            some = lines[first : first + taken].reshape(taken, -1)
            np.matmul(weight.T, some.astype(np.float32, copy=False), out=results)
        return found.reshape(-1, *numbers)[: self.count]


def bands(
    first: Int[np.ndarray, " results"],
    last: Int[np.ndarray, " results"],
    length: int,
    weight: Callable[[Ids, Ids], Float[np.ndarray, "parts pixels results"]],
    together: int,
) -> Bands:
    """The matrix of results that have their first and last pixel out of `length`, both rising.

    Args:
        weight: of pixels, as (parts, pixels, 1), in results, as (parts, 1, results); numbers of.
        together: results of a part.
    """
    parts = -(-len(first) // together)
    results = np.arange(parts)[:, None] * together + np.arange(together)
    results = results.clip(max=len(first) - 1)
    pixels = min(int((last[results[:, -1]] - first[results[:, 0]]).max()) + 1, length)
    begin = first[results[:, 0]].clip(max=length - pixels)
    at = begin[:, None] + np.arange(pixels)
    weights = weight(at[:, :, None], results[:, None, :]).astype(np.float32)
    return Bands(begin, weights, len(first))


def together(pixels: float, others: int, most: int) -> int:
    """Results of a part, at most `most`, whose product wakes no thread.

    Args:
        pixels: that one result more takes.
        others: further numbers in the product, times channels squared.
        most: beyond which the zeros in a part cost more than a part saves.
    """
    costs = ((n, n * (n * pixels + 2) * others) for n in range(most, 1, -1))
    return next((n for n, cost in costs if cost <= BLAS_ALONE), 1)
