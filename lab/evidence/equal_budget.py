"""Table 1 and the learning curve: runs that differ in one thing and see equally many photos.

    python -m lab.evidence.equal_budget data/sim --imagenet mobilenet_v2_imagenet_folded.npz
    deeplight evaluate --data data/sim --split val --model runs/equal --out out/equal
    python -m lab.evidence.equal_budget_tables out/equal

The second command measures them on the validation places, the third writes docs/results.md. A run
that is finished is not repeated, one that was killed goes on; give some --rows to each of several
processes to make them side by side.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from deeplight.cli.train import TrainProgress
from deeplight.deploy.network import write_best_network
from deeplight.errors import ConfigError
from deeplight.training.loop import train
from deeplight.training.presets import preset

# D moves as fast as G and weighs twenty times as much: the paper's D needs millions of steps.
STRONG = (
    "adversarial.learning_rate_factor=1.0",
    "adversarial.lambda_rec=0.98",
    "adversarial.form=non_saturating",
)
ROWS: Mapping[str, tuple[str, tuple[str, ...]]] = {
    "adv": ("small-adv", ()),
    "msd": ("small-msd", ()),
    "m": ("small-m", ()),
    "s": ("small-s", ()),
    "d": ("small-d", ()),
    "adv_strong": ("small-adv", STRONG),
    "places21": ("small-msd", ("data.places=21",)),
    "places42": ("small-msd", ("data.places=42",)),
    "colours": ("small-msd", ("augment.channel_shuffle=0.0",)),
    "more": ("small-msd", ()),
    "made": ("small-msd", ()),
}
"""Preset and settings by the name of the run; all other settings are the same, but that `more` and
`made` also learn from the data sets of --more and --made."""


@dataclass(frozen=True)
class Args:
    """Options of the benchmark."""

    data: Annotated[str, tyro.conf.Positional]
    """Folder of a data set with validation splits."""
    imagenet: Path
    """Folded MobileNetV2 weights that every encoder starts from."""
    more: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """Data sets that the row `more` adds to the first; without one it is left out."""
    made: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """The same for the row `made`: views in made-up places, say."""
    out: Path = Path("runs/equal")
    """Folder of the runs."""
    rows: tuple[str, ...] = tuple(ROWS)
    """Which runs."""
    steps: int = 160
    """Steps of 64 photos."""


def main(args: Args) -> None:
    """Train what is missing."""
    unknown = sorted(set(args.rows) - set(ROWS))
    if unknown:
        raise ConfigError(f"rows of {', '.join(ROWS)}", ", ".join(unknown), "choose of these")
    extra = {"more": args.more, "made": args.made}
    for name in args.rows:
        more = extra.get(name, ())
        if name in extra and not more:
            continue
        variant, changes = ROWS[name]
        print(name, variant, *changes)
        config = preset(variant, (*changes, *common(args.steps)))
        with TrainProgress() as progress:
            train(args.data, args.out / name, config, args.imagenet, progress.show, more=more)
        write_best_network(
            args.out / name, args.out / name / "model.onnx", data=Path(args.data).name
        )


def common(steps: int) -> tuple[str, ...]:
    """Settings of every row: one validation, at the end, so that nothing is chosen by it."""
    return (
        f"schedule.steps={steps}",
        f"schedule.warmup_steps={max(1, steps // 8)}",
        f"run.validate_every={steps}",
        "run.checkpoint_every=40",
        "run.constant_steps=0",
        "data.workers=0",
    )


if __name__ == "__main__":
    main(tyro.cli(Args))
