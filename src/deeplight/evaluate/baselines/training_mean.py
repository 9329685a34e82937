"""Baseline: the mean true light of new takes in the training places."""

import numpy as np

from deeplight.dataset import DataSet, splits_named
from deeplight.evaluate.baselines.baseline import DARKEST, ConstantLighting
from deeplight.lighting import LIGHTING_SIZE

NAME = "training_mean"
SPLIT = "seen"


def training_mean(data: DataSet) -> ConstantLighting | None:
    """Give the mean of ln radiance over the "seen" split; None where that has no true lighting.

    Training data holds no HDR light; this uses what only a simulation knows, to show what a
    constant map with that knowledge would reach.

    Raises:
        DataSetError: an example cannot be read.
    """
    if not any(data.manifest.examples(split) for split in splits_named(SPLIT)):
        return None
    index = data.index(SPLIT)
    numbers = np.flatnonzero(index.has_lighting)
    if not len(numbers):
        return None
    total = np.zeros((LIGHTING_SIZE, LIGHTING_SIZE, 3))
    for number in numbers:
        lighting = index[int(number)].true_lighting
        assert lighting is not None
        total += np.log(np.maximum(lighting.astype(np.float64), DARKEST))
    return ConstantLighting(NAME, (total / len(numbers)).astype(np.float32))
