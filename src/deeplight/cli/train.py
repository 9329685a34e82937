"""Train the network on a data set that `deeplight simulate` or a capture made.

deeplight train --data data --out runs/first --preset small --imagenet mobilenet_v2.npz

Run again with the same arguments, it goes on where it was stopped, on any number of devices. The
folder holds run.toml, losses.csv, validation.csv, curves.png, the checkpoints and best.safetensors.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro


@dataclass(frozen=True)
class Args:
    """Options of `deeplight train`."""

    data: str
    """Folder or address (s3://, http://, ...) of the data set."""
    out: Path
    """Folder of the run; one that holds a run of the same settings is resumed."""
    preset: str = "paper"
    """paper, small (two CPU cores) or gpu; after it a variant: -adv, -msd (all spheres with or
    without the adversarial term), -m, -s, -d (one sphere), -landscape, -width050, -width035,
    -out16, -out64 (another network)."""
    imagenet: Path | None = None
    """Folded MobileNetV2 weights (.npz) that the encoder starts from."""
    weights: Path | None = None
    """best.safetensors of an earlier run of the same network that this one starts from."""
    more: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """Another data set to learn from; may be given several times. Validation uses --data alone."""
    set: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """Change one setting of the preset: --set schedule.steps=500; repeat for more."""
    devices: int = 1
    """Devices of each machine; a batch is divided among all."""
    nodes: int = 1
    """Machines; start the same command on each (see docs/training.md)."""
    minutes: float = 0.0
    """Stop with a checkpoint after so many minutes; 0: never."""
    export: Path | None = None
    """Write the best weights of the finished run to this ONNX file."""


def run(args: Args) -> None:
    """Train with a progress bar; export if asked to."""
    from deeplight.cli.train_export import finish
    from deeplight.cli.train_progress import TrainProgress
    from deeplight.training.devices import first_process
    from deeplight.training.loop import train
    from deeplight.training.presets import preset

    machine = (f"run.time_limit_minutes={args.minutes}", f"run.devices={args.devices}")
    config = preset(args.preset, (*args.set, *machine, f"run.nodes={args.nodes}"))
    with TrainProgress(quiet=not first_process()) as progress:
        train(args.data, args.out, config, args.imagenet, progress.show, args.weights, args.more)
    if first_process():
        finish(args.out, args.data, args.export)
