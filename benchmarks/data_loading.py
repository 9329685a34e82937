"""Does reading the data hold training back? Loader throughput as a share of the bare step's.

    python benchmarks/data_loading.py data --preset small

The bare step trains on one batch that is already there; the others read every batch: from shards
on disk through worker processes, and from the split decoded into memory. The three take turns, so
that other work on the machine hurts all of them alike. The goal is at least 0.95.
"""

import itertools
import statistics
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import torch
import tyro

from deeplight.training.config import TrainConfig
from deeplight.training.data import Batch, BatchSource
from deeplight.training.loop import Run
from deeplight.training.presets import preset
from deeplight.training.setup import set_up
from deeplight.training.sources import Sources

GOAL = 0.95


@dataclass(frozen=True)
class Args:
    """Options of the benchmark."""

    data: Annotated[Path, tyro.conf.Positional]
    """Folder of a data set."""
    preset: str = "small"
    """The preset whose step is measured."""
    steps: int = 25
    """Steps of one turn."""
    turns: int = 3
    """Turns of each way; the median counts."""
    workers: int = 1
    """Processes that decode."""


def main(args: Args) -> None:
    """Print images/s of the three ways and the two ratios."""
    settings = ("run.constant_steps=0", "data.validation_splits=[]", f"data.workers={args.workers}")
    config = preset(args.preset, (*settings, "data.preload_gib=0.0"))
    with tempfile.TemporaryDirectory() as folder:
        run = Run(set_up(Sources(args.data), Path(folder), config))
        run.networks.forward.train()
        speeds = measure(run, config, args)
    bare = statistics.median(speeds["bare step"])
    for name, values in speeds.items():
        ratio = statistics.median(b / a for a, b in zip(speeds["bare step"], values, strict=True))
        print(f"{name:<18} {statistics.median(values):8.1f} images/s   {ratio:.3f}")
    print(
        f"{run.fabric.device}, batch {config.schedule.batch_size}, bare step {bare:.1f} images/s, "
        f"goal {GOAL}"
    )


def measure(run: Run, config: TrainConfig, args: Args) -> dict[str, list[float]]:
    """Images/s of each way in each turn."""
    size, total = config.schedule.batch_size, args.steps * (args.turns + 1)
    one = next(run.setup.source.batches(size, 0, 1))
    setup, in_memory = run.setup, replace(config.data, preload_gib=1e9)
    order = setup.source.order
    memory = BatchSource(setup.data.examples, in_memory, order, run.fabric.device)
    ways: dict[str, Iterator[Batch]] = {
        "bare step": itertools.repeat(one),
        "shards on disk": run.setup.source.batches(size, 0, total),
        "decoded in memory": memory.batches(size, 0, total),
    }
    speeds: dict[str, list[float]] = {name: [] for name in ways}
    for turn in range(args.turns + 1):  # the first warms up
        for name, batches in ways.items():
            speed = size * args.steps / seconds_of(run, batches, args.steps)
            if turn > 0:
                speeds[name].append(speed)
    return speeds


def seconds_of(run: Run, batches: Iterator[Batch], steps: int) -> float:
    """Time of one turn."""
    start = time.perf_counter()
    for batch in itertools.islice(batches, steps):
        run.train_step(batch)
    if run.fabric.device.type == "cuda":
        torch.cuda.synchronize()
    return time.perf_counter() - start


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
