"""What the training spheres look like on the whole: all that a constant baseline can know."""

import numpy as np

from deeplight.dataset import DataSet
from deeplight.solve import SphereCounts
from deeplight.sphere import SPHERES

EXAMPLES = 4000


def training_pixels(
    data: DataSet, split: str = "train", at_most: int = EXAMPLES
) -> list[SphereCounts]:
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
        weights = {name: bases[name].weights for name in SPHERES}
        masks = {name: bases[name].view.mask().ravel() for name in SPHERES}
        found.append(SphereCounts(weights, masks, by_sphere, len(chosen)))
    return found
