"""Baseline: the light of the training photo that looks most like this one.

After Karsch et al., "Automatic scene inference for 3D object compositing", ACM Transactions on
Graphics 2014, who look up the light outside the picture in a database of panoramas by its features.
"""

import numpy as np
from jaxtyping import Float, Float32, Int64

from deeplight.dataset import DataSet, SplitIndex
from deeplight.evaluate.baselines.baseline import DARKEST, Baseline
from deeplight.mappings.resample import shrink
from deeplight.solve import light_from_spheres
from deeplight.sphere import SPHERES

NAME = "nearest_neighbour"
EXAMPLES = 10_000  # training photos compared with, evenly spread over the split

_THUMBNAIL = (12, 8)
_CELLS = (4, 4)
_ANGLES = 8


class NearestNeighbour(Baseline):
    """The light fitted to the spheres of the most similar training photo.

    Training examples hold no HDR light, so it comes from their 8-bit spheres, by
    `light_from_spheres`.

    Args:
        descriptors: of the training photos, from `descriptors_of`.
        numbers: their numbers in the training split.
    """

    def __init__(
        self,
        data: DataSet,
        descriptors: Float32[np.ndarray, "photos features"],
        numbers: Int64[np.ndarray, " photos"],
    ) -> None:
        self._data, self._index = data, data.index("train")
        self._descriptors, self._numbers = descriptors, numbers
        self._squares = (descriptors**2).sum(1)
        self._lights: dict[int, Float32[np.ndarray, "size size 3"]] = {}

    @property
    def name(self) -> str:
        return NAME

    def estimate_inputs(
        self, inputs: Float32[np.ndarray, "batch 3 height width"]
    ) -> Float32[np.ndarray, "batch size size 3"]:
        pixels = np.clip(inputs.transpose(0, 2, 3, 1) + np.float32(0.5), 0, 1)
        wanted = np.stack([descriptor(picture) for picture in pixels])
        distance = self._squares - 2 * wanted @ self._descriptors.T  # and a constant per photo
        return np.stack([self._light(int(self._numbers[n])) for n in distance.argmin(1)])

    def _light(self, number: int) -> Float32[np.ndarray, "size size 3"]:
        if number not in self._lights:
            _, spheres = self._index.pixels(number)
            bases = self._data.bases(str(self._index.rigs[number]))
            radiance = light_from_spheres(dict(zip(SPHERES, spheres, strict=True)), bases).radiance
            self._lights[number] = np.log(np.maximum(radiance, DARKEST)).astype(np.float32)
        return self._lights[number]


def chosen_photos(index: SplitIndex, at_most: int = EXAMPLES) -> Int64[np.ndarray, " photos"]:
    """The training photos to compare with."""
    return np.unique(np.linspace(0, len(index) - 1, min(at_most, len(index))).astype(np.int64))


def descriptors_of(
    index: SplitIndex, numbers: Int64[np.ndarray, " photos"]
) -> Float32[np.ndarray, "photos features"]:
    """Describe training photos.

    Raises:
        DataSetError: one cannot be read.
    """
    pictures = (index.pixels(int(number))[0] for number in numbers)
    return np.stack([descriptor(picture.astype(np.float32) / 255) for picture in pictures])


def descriptor(picture: Float[np.ndarray, "height width 3"]) -> Float32[np.ndarray, " features"]:
    """What a photo looks like in 416 numbers: its colours and its edges.

    A thumbnail of 12 x 8 pixels, and for each of 4 x 4 cells a histogram of 8 edge directions
    weighted by their strength, at its root so that one strong edge is not everything (as GIST,
    Oliva and Torralba 2001, in small). Edges count as much as colours, over the whole.
    """
    thumbnail = shrink(picture, *_THUMBNAIL).ravel() - 0.5
    return np.concatenate([thumbnail, _edges(picture.mean(2))]).astype(np.float32)


def _edges(grey: Float[np.ndarray, "height width"]) -> Float[np.ndarray, " features"]:
    down, across = np.gradient(grey)
    strength = np.hypot(down, across)
    angle = (np.arctan2(down, across) % np.pi / np.pi * _ANGLES).astype(int) % _ANGLES
    cells = [
        np.minimum(np.arange(size) * count // size, count - 1)
        for size, count in zip(grey.shape, _CELLS, strict=True)
    ]
    cell = cells[0][:, None] * _CELLS[1] + cells[1][None, :]
    bins = (cell * _ANGLES + angle).ravel()
    total = np.bincount(bins, strength.ravel(), _CELLS[0] * _CELLS[1] * _ANGLES)
    rooted = np.sqrt(total / np.bincount(cell.ravel()).repeat(_ANGLES))
    return rooted * np.sqrt(3 * _THUMBNAIL[0] * _THUMBNAIL[1] / rooted.size)
