"""Train the network on a data set that `deeplight simulate` or a capture made.

deeplight train --data data --out runs/first --preset lamps --weights shipped

deeplight train --data data --out runs/new --preset lamps --fresh my_panoramas

Run again with the same arguments, it goes on where it was stopped, on any number of devices. The
folder holds run.toml, losses.csv, validation.csv, curves.png, the checkpoints and best.safetensors.
"""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro
from rich.table import Table

from deeplight.cli.screen import ProgressBar
from deeplight.simulate.run import Recipe
from deeplight.sphere import SPHERES

if TYPE_CHECKING:
    from deeplight.training.loop import Progress as Standing
    from deeplight.training.validation import SphereErrors


@dataclass(frozen=True)
class Args:
    """Options of `deeplight train`."""

    data: str
    """Folder or address (s3://, http://, ...) of the data set."""
    out: Path
    """Folder of the run; one that holds a run of the same settings is resumed."""
    preset: str = "paper"
    """paper, small (two CPU cores), gpu or lamps (the shipped network); after it a variant: -adv,
    -msd (all spheres with or without the adversarial term), -m, -s, -d (one sphere), -landscape,
    -width050, -width035, -out16, -out64 (another network)."""
    imagenet: Path | None = None
    """Folded MobileNetV2 weights (.npz) that the encoder starts from."""
    weights: Path | None = None
    """Network that this run starts from: best.safetensors of an earlier run, an exported .onnx, or
    shipped for the model that comes with deeplight."""
    more: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """Another data set to learn from; may be given several times. Validation uses --data alone."""
    bases: Path | None = None
    """Measured reflectance bases of the spheres; left out, the data set's bases.npz or analytic."""
    fresh: Path | None = None
    """Folder of HDR panoramas: learn from takes filmed in them while the run goes on, new ones in
    every epoch, instead of --data's, which validates."""
    recipe: Recipe = field(default_factory=lambda: Recipe(train_takes=4, frames=3, phones="v2"))
    """Of each epoch of --fresh."""
    set: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """Change one setting of the preset: --set schedule.steps=500; repeat for more."""
    devices: int = 1
    """Devices of each machine; a batch is divided among all."""
    nodes: int = 1
    """Machines; start the same command on each (see docs/training.md)."""
    minutes: float = 0.0
    """Stop with a checkpoint after this number of minutes; 0: never."""
    export: Path | None = None
    """Write the best weights of the finished run to this ONNX file."""


def run(args: Args) -> None:
    """Train with a progress bar; export if asked to."""
    from deeplight.cli.flags import refuse_unused
    from deeplight.training.devices import first_process
    from deeplight.training.loop import train
    from deeplight.training.presets import preset

    machine = (f"run.time_limit_minutes={args.minutes}", f"run.devices={args.devices}")
    spheres = (f"loss.bases={args.bases}",) if args.bases else ()
    config = preset(args.preset, (*args.set, *spheres, *machine, f"run.nodes={args.nodes}"))
    if args.weights is not None:
        refuse_unused(args, "with --weights", "imagenet")
    weights = args.weights
    if weights == Path("shipped"):
        from deeplight.estimators.onnx import shipped_model  # loads onnxruntime, so only here

        weights = shipped_model()
    fresh = None
    if args.fresh is not None:
        from deeplight.simulate.epochs import FilmedEpochs

        fresh = FilmedEpochs(args.fresh, args.out / "fresh", args.recipe)
    with TrainProgress(quiet=not first_process()) as progress:
        train(args.data, args.out, config, args.imagenet, progress.show, weights, args.more, fresh)
    if first_process():
        finish(args.out, args.data, args.export)


def finish(run_dir: Path, data: str, path: Path | None) -> None:
    """Print how far a run has come; write its best weights to `path` if there is one."""
    from deeplight.cli.screen import results_console
    from deeplight.deploy.network import write_best_network
    from deeplight.training import checkpoint

    console, best = results_console(), run_dir / checkpoint.BEST
    if best.is_file():
        step = checkpoint.read_header(best).step
        line = f"{run_dir}: best at step {step}; look at {run_dir / 'curves.png'}"
        console.print(line, markup=False)
    if path is not None:
        write_best_network(run_dir, path, data.rstrip("/").rsplit("/", 1)[-1])
        console.print(f"wrote {path}", markup=False)


_READING = "reading the data, fitting the best constant lighting"


class TrainProgress(ProgressBar):
    """The bar of a training: loss, images per second, and a table after each validation."""

    def __init__(self, quiet: bool = False) -> None:
        super().__init__(_READING, None, quiet)

    def show(self, standing: "Standing") -> None:
        """Move the bar; print the validation if there was one."""
        if standing.fitted is not None:
            self.name("fitting light to examples")
            self.reach(*standing.fitted)
            return
        if not standing.total:
            self.say(_READING)
            return
        if math.isnan(standing.loss):
            self.name("training")
            self.say(f"training from step {standing.step} of {standing.total}")
        else:
            self.name(f"loss {standing.loss:.4f}, {standing.images_per_second:.1f} images/s")
        self.reach(standing.step, standing.total)
        if standing.errors:
            self.console.print(_validation_table(standing))


def _validation_table(standing: "Standing") -> Table:
    """Masked L1 of each split and sphere, and as a share of the constant lighting's."""
    title = (
        f"step {standing.step} of {standing.total}: masked L1 (share of the best constant lighting)"
    )
    table = Table("split", *SPHERES, title=title, title_justify="left")
    for errors in standing.errors:
        table.add_row(errors.split, *(_cell(errors, name) for name in SPHERES))
    return table


def _cell(errors: "SphereErrors", sphere: str) -> str:
    """0.123 (0.61)."""
    ratio = errors.ratio(sphere)
    share = "" if ratio is None else f" ({ratio:.2f})"
    return f"{errors.model[sphere]:.4f}{share}"
