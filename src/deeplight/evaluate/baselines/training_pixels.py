"""What the training spheres look like on the whole: all that a constant baseline can know."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float64, Int64

from deeplight.camera_response import decode
from deeplight.dataset import DataSet
from deeplight.reflectance import ReflectanceBasis
from deeplight.sphere import SPHERES

EXAMPLES = 4000


@dataclass(frozen=True, eq=False)
class RigPixels:
    """How often each pixel of each sphere of one rig had each 8-bit value in training.

    For a constant lighting this says as much as the examples themselves: its loss, the gradient of
    its loss, and the mean pictures follow exactly.

    Attributes:
        bases: reflectance basis of each sphere.
        counts: (sphere of `SPHERES`, pixel row-major, channel, value 0 to 255).
        examples: how many were counted.
    """

    bases: dict[str, ReflectanceBasis]
    counts: Int64[np.ndarray, "3 pixels 3 256"]
    examples: int

    def mask(self, sphere: str) -> Bool[np.ndarray, " pixels"]:
        """The pixels that show nothing but sphere, row-major."""
        return self.bases[sphere].view.mask().ravel()

    def mean_linear(self, sphere: str) -> Float64[np.ndarray, "pixels 3"]:
        """Give the mean of the decoded pictures of a sphere."""
        linear = decode(np.arange(256) / 255)
        mean: np.ndarray = self.counts[SPHERES.index(sphere)] @ linear / self.examples
        return mean


def training_pixels(
    data: DataSet, split: str = "train", at_most: int = EXAMPLES
) -> list[RigPixels]:
    """Count the sphere pixels of `split`, evenly spread over it; one item for each rig.

    Raises:
        DataSetError: the data set has no such split, or an example cannot be read.
    """
    index = data.index(split)
    numbers = np.unique(np.linspace(0, len(index) - 1, min(at_most, len(index))).astype(int))
    found = []
    for rig in np.unique(index.rigs[numbers]):
        bases = data.bases(str(rig))
        size = bases["mirror"].view.size
        counts = np.zeros((len(SPHERES) * size * size * 3, 256), np.int64)
        every_value = np.arange(len(counts))
        chosen = numbers[index.rigs[numbers] == rig]
        for number in chosen:
            _, spheres = index.pixels(int(number))
            counts[every_value, spheres.ravel()] += 1
        by_sphere = counts.reshape(len(SPHERES), size * size, 3, 256)
        found.append(RigPixels(bases, by_sphere, len(chosen)))
    return found
