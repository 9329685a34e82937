"""What a run leaves for people: CSV tables, TensorBoard scalars, curves as a picture."""

import csv
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from deeplight.io.atomic import replacing
from deeplight.sphere import SPHERES
from deeplight.training.agreement import FLIP, STEADY
from deeplight.training.config import TrainConfig
from deeplight.training.devices import mean_over
from deeplight.training.losses import LossTerms
from deeplight.training.share import Share
from deeplight.training.validation import SphereErrors

ABOUT_D = ("adversarial", "d_loss", "d_real", "d_fake")
"""G's adversarial term, D's loss, and D's accuracy on filmed and on predicted balls."""
VALIDATION_COLUMNS = ("step", "split", *SPHERES, *(f"constant_{name}" for name in SPHERES))


class CsvTable:
    """A CSV file that rows are added to; a resumed run drops the rows after its checkpoint."""

    def __init__(self, path: Path, columns: Sequence[str], resume_step: int) -> None:
        self.path, self.columns = path, tuple(columns)
        rows = [row for row in read_csv(path) if int(row["step"]) <= resume_step]
        with (
            replacing(path) as temporary,
            temporary.open("w", newline="", encoding="utf-8") as file,
        ):
            writer = csv.DictWriter(file, self.columns)
            writer.writeheader()
            writer.writerows(rows)

    def add(self, row: Mapping[str, Any]) -> None:
        with self.path.open("a", newline="", encoding="utf-8") as file:
            csv.DictWriter(file, self.columns).writerow(row)


def read_csv(path: Path) -> list[dict[str, str]]:
    """The rows of a table, none if it does not exist; a last line cut by a kill is left out."""
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return [row for row in csv.DictReader(file) if None not in row.values()]


def loss_columns(reported: Sequence[str]) -> tuple[str, ...]:
    """The columns of losses.csv."""
    return ("step", "images", "loss", *reported, "learning_rate", "images_per_second")


def reported_by(config: TrainConfig) -> tuple[str, ...]:
    """What a run's losses are reported by."""
    agreeing = (FLIP,) * bool(config.loss.flip) + (STEADY,) * bool(config.loss.steady)
    about_d = ABOUT_D if config.adversarial.enabled else ()
    return (*SPHERES, *agreeing, *about_d)


class RecentLosses:
    """The losses of some steps, left on the device so that no step waits for them."""

    def __init__(self, start: int, names: Sequence[str]) -> None:
        self.start, self.started = start, time.monotonic()
        self.names = names
        self.losses: list[Tensor] = []
        self.reported: list[Tensor] = []

    def add(self, terms: LossTerms) -> None:
        self.losses.append(terms.total().detach())
        self.reported.append(torch.stack([terms.reported[name] for name in self.names]))

    def values(self, share: Share) -> tuple[np.ndarray, np.ndarray]:
        """The losses (steps,) and each reported number (steps, names), means over all devices."""
        losses, reported = torch.stack(self.losses), torch.stack(self.reported)
        if share.ranks > 1:
            losses, reported = mean_over(losses, share), mean_over(reported, share)
        return losses.cpu().numpy(), reported.cpu().numpy()


class RunRecord:
    """The tables of a run and their TensorBoard twins; in all processes but one it does nothing."""

    def __init__(
        self,
        run_dir: Path,
        resume_step: int,
        reported: Sequence[str] = SPHERES,
        writes: bool = True,
    ) -> None:
        self.run_dir, self.writes, self.reported = run_dir, writes, tuple(reported)
        if not writes:
            return
        from torch.utils.tensorboard import SummaryWriter  # slow to import

        columns = loss_columns(self.reported)
        self.losses = CsvTable(run_dir / "losses.csv", columns, resume_step)
        self.validation = CsvTable(run_dir / "validation.csv", VALIDATION_COLUMNS, resume_step)
        self.board = SummaryWriter(str(run_dir / "tensorboard"), purge_step=resume_step + 1)

    def add_losses(self, row: Mapping[str, float]) -> None:
        """One row of losses.csv."""
        if not self.writes:
            return
        self.losses.add(row)
        for name in loss_columns(self.reported)[2:]:
            self.board.add_scalar(f"train/{name}", row[name], int(row["step"]))

    def add_validation(self, step: int, errors: Sequence[SphereErrors]) -> None:
        """One row per split."""
        for e in errors:
            constant = {f"constant_{name}": value for name, value in (e.constant or {}).items()}
            self.validation.add({"step": step, "split": e.split, **e.model, **constant})
            for name in SPHERES:
                self.board.add_scalar(f"{e.split}/{name}", e.model[name], step)
        self.board.flush()

    def add_pictures(self, step: int, real: Tensor, fake: Tensor) -> None:
        """What D saw of one batch: filmed mirror balls above the predicted ones."""
        rows = [torch.cat(tuple(balls), dim=-1) for balls in (real, fake)]
        self.board.add_image("mirror, filmed over predicted", torch.cat(rows, dim=-2), step)

    def draw(self) -> None:
        """Draw curves.png from the tables."""
        if self.writes:
            draw_curves(self.run_dir)

    def close(self) -> None:
        if self.writes:
            self.board.close()


def draw_curves(run_dir: Path) -> None:
    """The training loss, and the masked L1 of each split next to the constant lighting (dotted)."""
    from matplotlib.figure import Figure  # no pyplot: no global state, no display

    losses, validation = (read_csv(run_dir / f"{name}.csv") for name in ("losses", "validation"))
    splits = sorted({row["split"] for row in validation})
    figure = Figure(figsize=(5.0 * (1 + len(splits)), 4.0), layout="constrained")
    panels = figure.subplots(1, 1 + len(splits), squeeze=False)[0]
    steps = [int(row["step"]) for row in losses]
    for name in ("loss", *SPHERES):
        panels[0].plot(steps, [float(row[name]) for row in losses], label=name, linewidth=1)
    panels[0].set_title("training")
    for panel, split in zip(panels[1:], splits, strict=True):
        rows = [row for row in validation if row["split"] == split]
        for number, name in enumerate(SPHERES):
            colour = f"C{number + 1}"
            values = [float(row[name]) for row in rows]
            panel.plot([int(r["step"]) for r in rows], values, "o-", color=colour, markersize=3)
            if rows[-1][f"constant_{name}"]:
                panel.axhline(float(rows[-1][f"constant_{name}"]), color=colour, linestyle=":")
        panel.set_title(f"{split} (dotted: constant lighting)", fontsize=9)
    for panel in panels:
        panel.set(xlabel="step", ylabel="masked L1")
        panel.grid(alpha=0.3)
    panels[0].legend()
    with replacing(run_dir / "curves.png") as temporary:
        figure.savefig(temporary, dpi=110)
