"""All baselines of a data set; what takes long to make is made once and kept next to it."""

import contextlib
from pathlib import Path
from typing import Any

import numpy as np

from deeplight.dataset import GROUPS, DataSet, splits_named
from deeplight.evaluate.baselines.baseline import Baseline, ConstantLighting
from deeplight.evaluate.baselines.khan_2006 import Khan2006
from deeplight.evaluate.baselines.nearest_neighbour import (
    NearestNeighbour,
    chosen_photos,
    descriptors_of,
)
from deeplight.evaluate.baselines.photo_mean import PhotoMean
from deeplight.evaluate.baselines.training_mean import NAME as MEAN_NAME
from deeplight.evaluate.baselines.training_mean import SPLIT as MEAN_SPLIT
from deeplight.evaluate.baselines.training_mean import training_mean
from deeplight.evaluate.baselines.training_pixels import training_pixels
from deeplight.io.arrays_file import read_arrays
from deeplight.io.atomic import replacing
from deeplight.solve import solve_constant, solve_mean

CACHE = ".constant-baselines.npz"
DESCRIPTORS = ".photo-descriptors.npz"
VERSION = 3  # of the methods: another one makes the stored results stale


def baselines_for(data: DataSet, split: str) -> list[Baseline]:
    """Give every baseline that is fair on `split`.

    `training_mean` is made from the true light of the "seen" split, so it is left out there; a
    training photo is its own nearest neighbour, so that is left out there.
    A data set without a training split has only the baselines that need none.

    Raises:
        DataSetError: an example cannot be read.
    """
    if not data.manifest.examples("train"):
        return [PhotoMean(), Khan2006()]
    tested = set(splits_named(split))
    fair = [
        constant
        for constant in constant_baselines(data)
        if constant.name != MEAN_NAME or not tested & set(GROUPS[MEAN_SPLIT])
    ]
    neighbour = [] if "train" in tested else [nearest_neighbour(data)]
    return [*fair, PhotoMean(), Khan2006(), *neighbour]


def constant_baselines(data: DataSet) -> list[ConstantLighting]:
    """Give `mean_spheres`, `best_constant` and, if it can be known, `training_mean`.

    The first call reads some thousand training examples; the result is stored in the data set's
    folder, if that can be written, and is made again when the data set has changed.

    Raises:
        DataSetError: the data set has no training split, or an example cannot be read.
    """
    made_of = f"{VERSION} {data.manifest_sha256} {data.bases_sha256}"
    stored = _load(data.folder / CACHE, made_of)
    if stored is not None:
        return [ConstantLighting(name, log_radiance) for name, log_radiance in stored.items()]
    pixels = training_pixels(data)
    mean = solve_mean(pixels)
    best = solve_constant(pixels, mean)
    baselines = [ConstantLighting("mean_spheres", mean), ConstantLighting("best_constant", best)]
    true_mean = training_mean(data)
    if true_mean is not None:
        baselines.append(true_mean)
    _save(data.folder / CACHE, made_of, {b.name: b.log_radiance for b in baselines})
    return baselines


def nearest_neighbour(data: DataSet) -> NearestNeighbour:
    """Give the baseline of the most similar training photo; photos are described once.

    Raises:
        DataSetError: the data set has no training split, or an example cannot be read.
    """
    index = data.index("train")
    numbers = chosen_photos(index)
    made_of = f"{VERSION} {data.manifest_sha256}"
    stored = _load(data.folder / DESCRIPTORS, made_of)
    if stored is None:
        descriptors = descriptors_of(index, numbers)
        _save(data.folder / DESCRIPTORS, made_of, {"descriptors": descriptors})
    else:
        descriptors = stored["descriptors"]
    return NearestNeighbour(data, descriptors, numbers)


def _load(path: Path, made_of: str) -> dict[str, Any] | None:
    try:
        stored = read_arrays(path)
        if str(stored.pop("made_of")) != made_of:
            return None
        return dict(stored)
    except (OSError, ValueError, KeyError):
        return None  # none yet, or damaged: made again


def _save(path: Path, made_of: str, arrays: dict[str, Any]) -> None:
    # A data set on a read-only disk: made again next time.
    with contextlib.suppress(OSError), replacing(path) as temporary, temporary.open("wb") as file:
        np.savez(file, made_of=np.array(made_of), **arrays)
