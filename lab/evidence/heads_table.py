"""What a network says of the camera and of itself, and how well it keeps it, on test photos.

    python -m lab.evidence.heads_table data/v1 data/v2 --model deeplight.onnx

Prints the table of docs/results.md. A third of the photos lie on a side or on their head: these
count only for which way is up.
"""

from dataclasses import dataclass
from math import degrees, log
from pathlib import Path
from typing import Annotated

import tyro

from deeplight.estimators.onnx import shipped_model
from deeplight.training.heads import joined, measured, share_upright, views_of
from deeplight.training.model_file import load_network

IN_DEGREES, IN_STOPS, AS_IT_IS = degrees(1), 1 / log(2), 1.0
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


def main(args: Args) -> None:
    """Print the table."""
    network, _ = load_network(args.model or shipped_model())
    if network.heads is None:
        raise SystemExit(f"{args.model} says nothing of itself: deeplight export --heads")
    views = joined(
        [views_of(network, name, args.split, args.at_most, args.seed) for name in args.data]
    )
    print("| | mean error | best fixed number | within | surest half | rank correlation |")
    print("|---|---|---|---|---|---|")
    for name, kept in measured(network.heads, views).items():
        row, unit = ROWS[name]
        plain = "" if kept.plain == kept.error else f"{kept.plain * unit:.2f}"
        error = f"{kept.error * unit:.2f}"
        kept_so = f"{kept.within:.2f} | {kept.surest:.2f} | {kept.ranked:.2f}"
        print(f"| {row} | {error} | {plain} | {kept_so} |")
    print(f"\nWhich way is up: right for {share_upright(network.heads, views):.0%}")


if __name__ == "__main__":
    main(tyro.cli(Args, description=__doc__))
