"""What a network says of the camera and of itself, and how well it keeps it, on test photos.

    python -m lab.evidence.heads_table data/v1 data/v2 --model deeplight.onnx

Prints the table of docs/results.md. A third of the photos lie on a side or on their head: these
count only for which way is up. With --orders, the tables of docs/journal.md: which stated scale
orders which error, and how alike errors are within a place and within a take.
"""

from dataclasses import dataclass
from math import degrees, log
from pathlib import Path
from typing import Annotated

import numpy as np
import torch
import tyro

from deeplight.contract import HEADS
from deeplight.estimators.fill import SURE
from deeplight.estimators.onnx import shipped_model
from deeplight.training.heads import (
    OF_LIGHT,
    SCALES,
    Views,
    errors_and_scales,
    joined,
    measured,
    share_upright,
    views_of,
)
from deeplight.training.model_file import load_network
from deeplight.training.network.heads import Heads

IN_DEGREES, IN_STOPS, AS_IT_IS = degrees(1), 1 / log(2), 1.0
LEAST_RATIO = 1e-3
ROWS = {
    "pitch_scale": ("pitch, °", IN_DEGREES),
    "roll_scale": ("roll, °", IN_DEGREES),
    "fov_scale": ("field of view where the photo states none, °", IN_DEGREES),
    "brightness_scale": ("brightness of the light, stops", IN_STOPS),
    "colour_scale": ("colour of the light, °", IN_DEGREES),
    "direction_scale": ("direction of the main light, °", IN_DEGREES),
    "log_radiance_scale": ("ln radiance in one direction", AS_IT_IS),
}


@dataclass(frozen=True)
class Args:
    """Options of the measurement."""

    data: Annotated[tuple[str, ...], tyro.conf.Positional]
    """Data sets whose examples hold the true light."""
    split: str = "test"
    """Which of their splits, or a group of them."""
    model: Path | None = None
    """An exported network with heads; left out, deeplight's own."""
    at_most: int = 268
    """Photos of each data set, drawn at random."""
    seed: int = 0
    orders: bool = False
    """Which scale orders which error, and how alike errors are, instead."""


def main(args: Args) -> None:
    """Print the table."""
    network, _ = load_network(args.model or shipped_model())
    if network.heads is None:
        raise SystemExit(f"{args.model} says nothing of itself: deeplight export --heads")
    views = joined(
        [views_of(network, name, args.split, args.at_most, args.seed) for name in args.data]
    )
    (print_orders if args.orders else print_kept)(network.heads, views)


def print_kept(heads: Heads, views: Views) -> None:
    """How well every number and every scale is kept."""
    print("| | mean error | best fixed number | within | surest half | rank correlation |")
    print("|---|---|---|---|---|---|")
    for name, kept in measured(heads, views).items():
        row, unit = ROWS[name]
        plain = "" if kept.plain == kept.error else f"{kept.plain * unit:.2f}"
        error = f"{kept.error * unit:.2f}"
        kept_so = f"{kept.within:.2f} | {kept.surest:.2f} | {kept.ranked:.2f}"
        print(f"| {row} | {error} | {plain} | {kept_so} |")
    print(f"\nWhich way is up: right for {share_upright(heads, views):.0%}")
    print_indoors(heads, views)


@torch.no_grad()
def print_indoors(heads: Heads, views: Views) -> None:
    """How often the kind of place is right, of all upright photos and of those it is sure of."""
    is_known = views.indoors.isfinite()
    chance = heads.read(views.averaged)[is_known, HEADS.index("indoors")]
    right = ((chance > 0.5) == (views.indoors[is_known] > 0.5)).float()
    sure = torch.maximum(chance, 1 - chance) >= SURE
    print(
        f"In a room or not: right for {right.mean():.0%}; sure of {sure.float().mean():.0%},"
        f" of which {right[sure].mean():.0%} are right"
    )


@torch.no_grad()
def print_orders(heads: Heads, views: Views) -> None:
    """Surest half and rank correlation of every error of the light by every scale of it and by
    their product; the intraclass correlation of ln (error / scale)."""
    off, scales = errors_and_scales(heads.read(views.averaged), views, np.arange(len(views.turns)))
    stated = {name: scales[SCALES.index(name)] for name in OF_LIGHT}
    stated["product of all"] = torch.stack([*stated.values()]).prod(0)
    words = [ROWS[name][0] if name in ROWS else name for name in stated]
    print(f"| error of, ordered by | {' | '.join(words)} | alike in a place | in a take |")
    print("|---" * (len(stated) + 3) + "|")
    for name in OF_LIGHT:
        error = off[SCALES.index(name)].numpy()
        known = np.isfinite(error)
        error, own = error[known], stated[name].numpy()[known]
        cells = [ordered(error, scale.numpy()[known]) for scale in stated.values()]
        ratio = np.log(np.maximum(error / own, LEAST_RATIO))
        cells += [f"{alike(ratio, names[known]):.2f}" for names in (views.places, views.takes)]
        print(f"| {ROWS[name][0]} | {' | '.join(cells)} |")


def ordered(error: np.ndarray, scale: np.ndarray) -> str:
    """Mean error of the half with the smallest scales over that of all; rank correlation."""
    surest = error[scale <= np.median(scale)].mean() / error.mean()
    ranks = [values.argsort().argsort() for values in (error, scale)]
    return f"{surest:.2f} ({np.asarray(np.corrcoef(ranks))[0, 1]:+.2f})"


def alike(values: np.ndarray, names: np.ndarray) -> float:
    """Intraclass correlation: how much of the variance lies between groups (Fisher 1925)."""
    groups = [values[names == name] for name in np.unique(names)]
    groups = [group for group in groups if len(group) > 1]
    size = float(np.mean([len(group) for group in groups]))
    between = size * float(np.var([group.mean() for group in groups], ddof=1))
    within = float(np.mean([group.var(ddof=1) for group in groups]))
    return (between - within) / (between + (size - 1) * within)


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
