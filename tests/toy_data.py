"""A made-up data set that is small enough to train on in a test."""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from deeplight.dataset import (
    DataSet,
    Example,
    ExampleMeta,
    ShardJob,
    ShardPlan,
    open_dataset,
    plan_split,
)
from deeplight.sphere import PAPER_RIG, Rig


def write_toy_data(
    folder: Path,
    counts: Mapping[str, int],
    examples: Callable[[ShardJob], Iterable[Example]] | None = None,
    rigs: Rig | Mapping[str, Rig] = PAPER_RIG,
) -> Path:
    """Fill `folder` with `counts` examples of each split; what is in them is up to `examples`."""
    jobs = [job for split, count in counts.items() for job in plan_split(split, count)]
    named = {"paper": rigs} if isinstance(rigs, Rig) else rigs
    plan = ShardPlan.begin(folder, jobs, {name: rig.to_dict() for name, rig in named.items()}, {})
    for job in plan.missing():
        plan.write(job, (examples or toy_examples)(job))
    plan.finish()
    return folder


def toy_examples(job: ShardJob, seed: int = 0) -> Iterator[Example]:
    """In three places each; each has its colour, on the photo and on the spheres, with noise."""
    for number in range(job.first, job.first + job.count):
        random = np.random.default_rng([len(job.split), number, seed])
        colour = random.uniform(40, 220, 3)
        photo = random.normal(colour, 25, (192, 135, 3)).clip(0, 255).astype(np.uint8)
        spheres = {
            name: random.normal(colour * share, 9, (32, 32, 3)).clip(0, 255).astype(np.uint8)
            for name, share in (("mirror", 0.9), ("matte_silver", 0.8), ("diffuse", 0.6))
        }
        scene = "outdoor" if job.split.endswith("outdoor") else "indoor"
        where = (f"{job.split}-{number % 3}", "take", number, scene, job.split)
        meta = ExampleMeta(*where, "paper", "toy", "CC0", "made up")
        yield Example(f"{job.split}-{number}", photo, spheres, meta)


@dataclass(frozen=True)
class ToyEpochs:
    """New examples in epochs, as `training.epochs.Epochs`; they can be made in another process.

    Attributes:
        folder: where the epochs lie.
        length: examples of an epoch, as it says.
        missing: how many of these are not there.
        slow: whether every epoch but the first takes longer than anybody waits.
    """

    folder: Path
    length: int = 4
    missing: int = 0
    slow: bool = False
    places: tuple[str, ...] = ("train-0", "train-1", "train-2")

    @property
    def fingerprint(self) -> str:
        return f"toy epochs of {self.length}"

    def epoch(self, number: int) -> DataSet:
        if number and self.slow:
            (self.folder / "begun").touch()
            time.sleep(600)
        made, counts = partial(toy_examples, seed=number + 1), {"train": self.length - self.missing}
        return open_dataset(write_toy_data(self.folder / f"epoch-{number}", counts, made))
