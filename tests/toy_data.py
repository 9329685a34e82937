"""A made-up data set that is small enough to train on in a test."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np

from deeplight.dataset import Example, ExampleMeta, ShardJob, ShardPlan, plan_split
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


def toy_examples(job: ShardJob) -> Iterator[Example]:
    """In three places each; each has its colour, on the photo and on the spheres, with noise."""
    for number in range(job.first, job.first + job.count):
        random = np.random.default_rng([len(job.split), number])
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
