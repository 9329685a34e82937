"""All baselines of a data set; the constant ones are made once and kept beside it."""

import contextlib
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32

from deeplight.dataset import GROUPS, DataSet, splits_named
from deeplight.evaluate.baselines.baseline import Baseline, ConstantLighting
from deeplight.evaluate.baselines.best_constant import best_constant
from deeplight.evaluate.baselines.khan_2006 import Khan2006
from deeplight.evaluate.baselines.mean_spheres import mean_spheres
from deeplight.evaluate.baselines.photo_mean import PhotoMean
from deeplight.evaluate.baselines.training_mean import NAME as MEAN_NAME
from deeplight.evaluate.baselines.training_mean import SPLIT as MEAN_SPLIT
from deeplight.evaluate.baselines.training_mean import training_mean
from deeplight.evaluate.baselines.training_pixels import training_pixels
from deeplight.io.atomic import replacing

CACHE = ".constant-baselines.npz"
VERSION = 2  # of the methods: another one makes the stored results stale


def baselines_for(data: DataSet, split: str) -> list[Baseline]:
    """Give every baseline that is fair on `split`.

    `training_mean` is made from the true light of the "seen" split, so it is left out there.
    A data set without a training split has only the baselines that need none.

    Raises:
        DataSetError: an example cannot be read.
    """
    constants = constant_baselines(data) if data.manifest.examples("train") else []
    tested = set(splits_named(split))
    fair = [c for c in constants if c.name != MEAN_NAME or not tested & set(GROUPS[MEAN_SPLIT])]
    return [*fair, PhotoMean(), Khan2006()]


def constant_baselines(data: DataSet) -> list[ConstantLighting]:
    """Give `mean_spheres`, `best_constant` and, if it can be known, `training_mean`.

    The first call reads some thousand training examples; the result is stored in the data set's
    folder, if that can be written, and is made again when the data set has changed.

    Raises:
        DataSetError: the data set has no training split, or an example cannot be read.
    """
    made_of = f"{VERSION} {data.manifest_sha256}"
    stored = _load(data.folder / CACHE, made_of)
    if stored is not None:
        return [ConstantLighting(name, log_radiance) for name, log_radiance in stored.items()]
    pixels = training_pixels(data)
    mean = mean_spheres(pixels)
    baselines = [mean, best_constant(pixels, mean.log_radiance)]
    true_mean = training_mean(data)
    if true_mean is not None:
        baselines.append(true_mean)
    with contextlib.suppress(OSError):  # a data set on a read-only disk: made again next time
        _save(data.folder / CACHE, made_of, baselines)
    return baselines


def _load(path: Path, made_of: str) -> dict[str, Float32[np.ndarray, "size size 3"]] | None:
    try:
        with np.load(path, allow_pickle=False) as stored:
            if str(stored["made_of"]) != made_of:
                return None
            return {name: stored[name] for name in stored.files if name != "made_of"}
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None  # none yet, or damaged: made again


def _save(path: Path, made_of: str, baselines: list[ConstantLighting]) -> None:
    with replacing(path) as temporary, temporary.open("wb") as file:
        arrays: dict[str, Any] = {b.name: b.log_radiance for b in baselines}
        np.savez(file, made_of=np.array(made_of), **arrays)
