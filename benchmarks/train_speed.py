"""What does the adversarial term cost? Images/s of a training step with and without it.

    python benchmarks/train_speed.py data --preset paper

The two take turns on one batch that is already there, so that other work on the machine hurts both
alike; the ratio is the median over the turns. From the speed it gives how long the paper's run
(4.06 million examples, 16 epochs, batches of 32: 2.03 million steps) would take on this machine.
"""

import itertools
import statistics
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import torch
import tyro

from deeplight.training.loop import Run
from deeplight.training.optimiser import ScheduleConfig
from deeplight.training.presets import preset
from deeplight.training.setup import set_up
from deeplight.training.sources import Sources

PAPER_EXAMPLES = 4_060_000


@dataclass(frozen=True)
class Args:
    """Options of the benchmark."""

    data: Annotated[str, tyro.conf.Positional]
    """Folder of a data set."""
    preset: str = "paper"
    """A base, measured as its variants -msd and -adv."""
    steps: int = 10
    """Steps of one turn."""
    turns: int = 5
    """Turns of each; the median counts."""
    set: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """Settings as of `deeplight train`."""


def main(args: Args) -> None:
    """Print images/s of both, their ratio, and the time of the paper's run."""
    with tempfile.TemporaryDirectory() as folder:
        runs = {name: started(args, name, Path(folder) / name) for name in ("msd", "adv")}
        size = runs["msd"].config.schedule.batch_size
        speeds: dict[str, list[float]] = {name: [] for name in runs}
        for turn in range(args.turns + 1):  # the first warms up
            for name, run in runs.items():
                speed = size * args.steps / seconds_of(run, args.steps)
                if turn > 0:
                    speeds[name].append(speed)
        device = runs["msd"].fabric.device
    ratio = statistics.median(b / a for a, b in zip(*speeds.values(), strict=True))
    total = ScheduleConfig().total_steps(PAPER_EXAMPLES) * ScheduleConfig().batch_size
    for name, values in speeds.items():
        speed = statistics.median(values)
        days = total / speed / 86400
        print(f"{args.preset}-{name}: {speed:8.1f} images/s; the paper's run: {days:.1f} days")
    print(f"{device}, batch {size}, {torch.get_num_threads()} threads: adv / msd = {ratio:.3f}")


def started(args: Args, variant: str, folder: Path) -> Run:
    """A run of a variant, ready for its first step."""
    settings = ("run.constant_steps=0", "data.validation_splits=[]", "data.preload_gib=0.0")
    config = preset(f"{args.preset}-{variant}", (*settings, "data.workers=0", *args.set))
    run = Run(set_up(Sources(args.data), folder, config))
    run.networks.forward.train()
    return run


def seconds_of(run: Run, steps: int) -> float:
    """Time of a number of steps on the run's first batch."""
    batch = next(run.setup.source.batches(run.config.schedule.batch_size, 0, 1))
    start = time.perf_counter()
    for one in itertools.repeat(batch, steps):
        run.train_step(one)
    if run.fabric.device.type == "cuda":
        torch.cuda.synchronize()
    return time.perf_counter() - start


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
