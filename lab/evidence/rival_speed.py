"""What a step of the rivals' published networks costs: by precision and order in memory, in turns.

    python -m lab.evidence.rival_speed

Prints seconds of one core for each view of a step, forward, backward and update, over made-up
photos and targets: the least of a few rounds, in which the ways take turns.
"""

import itertools
import sys
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch

from deeplight.cli.main import run_command
from deeplight.evaluate.rivals.crops import all_pairs
from deeplight.evaluate.rivals.rival import PRESETS, Rival, new_network
from deeplight.evaluate.rivals.sky import Sky
from deeplight.evaluate.rivals.training import Lessons

WAYS = list(itertools.product(("32-true", "bf16-mixed"), ("channels first", "channels last")))


@dataclass(frozen=True)
class Args:
    """How long is measured."""

    views: int = 32
    """Of a step."""
    rounds: int = 3
    """Of all ways."""


def a_step(lessons: Lessons, optimiser: torch.optim.Optimizer) -> float:
    """Seconds of the processor."""
    started = time.process_time()
    loss = lessons.loss(np.arange(len(lessons.pairs)), 1.0)
    optimiser.zero_grad()
    loss.backward()  # type: ignore[no-untyped-call]
    optimiser.step()
    return time.process_time() - started


def lessons_of(preset: str, precision: Any, order: str, views: int) -> Lessons:
    """A new network under one sky."""
    config = replace(PRESETS[preset], precision=precision)
    network = new_network(config)
    if order == "channels first":
        network.to(memory_format=torch.contiguous_format)  # type: ignore[call-overload]
    sky = Sky(np.array([0.0, 0.6, -0.8]), 3.0).panorama(128)
    pairs = all_pairs([sky], replace(config.views, per_panorama=views))
    return Lessons(Rival(config, network, {}), pairs)


def run(args: Args) -> None:
    torch.set_num_threads(1)
    for preset in ("gardner_2017", "hold_geoffroy_2017"):
        made = [lessons_of(preset, *way, args.views) for way in WAYS]
        adams = [torch.optim.AdamW(lessons.rival.network.parameters()) for lessons in made]
        least = [np.inf] * len(WAYS)
        for _ in range(args.rounds):
            for number, (lessons, adam) in enumerate(zip(made, adams, strict=True)):
                least[number] = min(least[number], a_step(lessons, adam) / args.views)
        for way, seconds in zip(WAYS, least, strict=True):
            print(f"{preset}, {', '.join(way)}: {seconds:.3f} s a view", flush=True)


if __name__ == "__main__":
    sys.exit(run_command("python -m lab.evidence.rival_speed", sys.modules[__name__], sys.argv[1:]))
