"""Where the main light is when the model misses it: in the photo, next to it, behind the camera.

    python -m lab.evidence.direction_parts data/sim

Prints a table for docs/results.md: medians over the validation frames that have a main light.
"""

import math
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro
from jaxtyping import Bool, Float

from deeplight.contract import ModelContract
from deeplight.dataset import open_dataset
from deeplight.estimators.open import open_model
from deeplight.evaluate.light_metrics import brightest
from deeplight.preprocess import normalise

SPLITS = ("val_indoor", "val_outdoor")
NEAR_DEG, HIGH_DEG = 30, 60
CHUNK = 64

Directions = Float[np.ndarray, "examples 3"]


@dataclass(frozen=True)
class Args:
    """Options of the benchmark."""

    data: Annotated[str, tyro.conf.Positional]
    """Folder of a data set with validation splits."""
    model: Path | None = None
    """An exported network; left out, deeplight's own."""


def main(args: Args) -> None:
    """Print the table."""
    model, data = open_model(args.model), open_dataset(args.data)
    errors, true, indoor = [], [], []
    for split in SPLITS:
        examples = data.examples(split)
        while some := list(islice(examples, CHUNK)):
            photos = normalise(np.stack([example.background for example in some]))
            estimated = np.exp(model.estimate_inputs(photos).astype(np.float64))
            wanted = brightest(np.stack([example.known_lighting for example in some]))
            errors.append(brightest(estimated).degrees_from(wanted))
            true.append(wanted.directions)
            indoor += [split == "val_indoor"] * len(some)
    print_table(np.concatenate(errors), np.concatenate(true), np.array(indoor), model.contract)


def print_table(
    errors: Float[np.ndarray, " examples"],
    true: Directions,
    indoor: Bool[np.ndarray, " examples"],
    contract: ModelContract,
) -> None:
    """One row for each place that the main light can be in; NaN: there is no main light."""
    seen, ahead = in_the_photo(true, contract), true[:, 2] < 0
    parts = {
        "in the photo": seen,
        "in front of the camera, not in the photo": ahead & ~seen,
        "behind the camera": ~ahead,
        f"more than {HIGH_DEG}° up": true[:, 1] > math.sin(math.radians(HIGH_DEG)),
        "indoors": indoor,
        "outdoors": ~indoor,
        "all": np.ones_like(indoor),
    }
    known = np.isfinite(errors)
    print(f"| main light | share | error, median | less than {NEAR_DEG}° |\n|---|---|---|---|")
    for words, part in parts.items():
        chosen = errors[part & known]
        share, near = 100 * len(chosen) / known.sum(), 100 * (chosen < NEAR_DEG).mean()
        print(f"| {words} | {share:.0f} % | {np.median(chosen):.0f}° | {near:.0f} % |")


def in_the_photo(towards: Directions, contract: ModelContract) -> Bool[np.ndarray, " examples"]:
    """Whether the trained camera, which looks along -Z, sees what lies there."""
    depth = np.maximum(-towards[:, 2], 1e-9)
    x, y = towards[:, 0] / depth, towards[:, 1] / depth
    inside = (np.abs(x) <= contract.right) & (y <= contract.top) & (y >= contract.bottom)
    return np.asarray(inside & (towards[:, 2] < 0))


if __name__ == "__main__":
    main(tyro.cli(Args))
