"""Baseline: the light of the training photo that looks most like this one.

After Karsch et al., "Automatic scene inference for 3D object compositing", ACM Transactions on
Graphics 2014, who look up the light outside the picture in a database of panoramas by its features.
"""

import numpy as np
from jaxtyping import Float, Float32, Int64, UInt8

from deeplight.camera_response import decode
from deeplight.dataset import DataSet, SplitIndex
from deeplight.evaluate.baselines.baseline import DARKEST, Baseline
from deeplight.evaluate.baselines.mean_spheres import seen_in_mirror
from deeplight.lighting import LIGHTING_SIZE
from deeplight.mappings.resample import shrink
from deeplight.reflectance import ReflectanceBasis
from deeplight.sphere import SPHERES

NAME = "nearest_neighbour"
EXAMPLES = 10_000  # training photos compared with, evenly spread over the split
BRIGHTEST = 1000.0  # limit of how far a clipped pixel is raised

_THUMBNAIL = (12, 8)
_CELLS = (4, 4)
_ANGLES = 8
_CLIPPED = 250  # 8-bit values from here on have lost light


class NearestNeighbour(Baseline):
    """The light fitted to the spheres of the most similar training photo.

    Training examples hold no HDR light, so it comes from their 8-bit spheres: the mirror sphere,
    linearised, over its reflectivity; what it clipped is raised by the one factor per channel with
    which the diffuse sphere, rendered in it, is as bright as it was filmed.

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
            radiance = fitted_light(dict(zip(SPHERES, spheres, strict=True)), bases)
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


def fitted_light(
    spheres: dict[str, UInt8[np.ndarray, "size size 3"]], bases: dict[str, ReflectanceBasis]
) -> Float[np.ndarray, "light light 3"]:
    """Radiance that explains one example's mirror and diffuse sphere, camera frame.

    A sphere that is clipped all over tells no more than that: the factor stays at most `BRIGHTEST`.
    """
    mirror, diffuse = bases["mirror"], bases["diffuse"]
    filmed = decode(spheres["mirror"].reshape(-1, 3) / 255.0)
    radiance = seen_in_mirror(mirror, filmed)
    mask = diffuse.view.mask().ravel()
    wanted = decode(spheres["diffuse"].reshape(-1, 3)[mask] / 255.0)
    lost = _lost(spheres["mirror"], mirror)
    weights = diffuse.weights[mask].astype(np.float64)
    for channel in range(3):
        rest = np.where(lost[:, channel], 0, radiance[:, channel])
        clipped = weights @ (radiance[:, channel] - rest)
        usable = spheres["diffuse"].reshape(-1, 3)[mask, channel] < _CLIPPED
        if not usable.any():  # the diffuse sphere is white all over: as bright as it says
            usable[:] = True
        a, b = clipped[usable], wanted[usable, channel] - (weights @ rest)[usable]
        factor = float(a @ b / (a @ a)) if a.any() else 1.0
        radiance[:, channel] = rest + np.clip(factor, 1.0, BRIGHTEST) * (
            radiance[:, channel] - rest
        )
    return radiance.reshape(LIGHTING_SIZE, LIGHTING_SIZE, 3)


def _lost(sphere: UInt8[np.ndarray, "size size 3"], mirror: ReflectanceBasis) -> np.ndarray:
    """The directions whose light the mirror's picture clipped, by channel."""
    mask = mirror.view.mask().ravel()
    weights = mirror.weights[mask]
    clipped = (sphere.reshape(-1, 3)[mask] >= _CLIPPED).astype(np.float32)
    shown = np.maximum(weights.sum(0), 1e-9)[:, None]
    return np.asarray(weights.T @ clipped / shown > 0.5)
