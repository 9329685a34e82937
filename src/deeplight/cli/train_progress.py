"""What `deeplight train` shows while it runs."""

from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from deeplight.sphere import SPHERES
from deeplight.training.loop import Progress as Standing
from deeplight.training.validation import SphereErrors


class TrainProgress:
    """A progress bar with loss and images per second; a table after each validation."""

    def __init__(self, quiet: bool = False) -> None:
        self.console = Console(quiet=quiet)
        self.bar = Progress(
            TextColumn("training"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("loss {task.fields[loss]:.4f}  {task.fields[speed]:.1f} images/s"),
            TimeRemainingColumn(),
            console=self.console,
        )
        self.start = self.console.status("reading the data, fitting the best constant lighting")
        self.task = self.bar.add_task("training", total=None, loss=float("nan"), speed=0.0)

    def __enter__(self) -> Self:
        self.start.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.start.stop()
        if self.bar.live.is_started:
            self.bar.stop()

    def show(self, standing: Standing) -> None:
        """Move the bar; print the validation if there was one."""
        if standing.fitted is not None:
            self.start.update("fitting light to example {} of {}".format(*standing.fitted))
            return
        if not self.bar.live.is_started:
            self.start.stop()
            self.bar.start()
        self.bar.update(
            self.task,
            completed=standing.step,
            total=standing.total,
            loss=standing.loss,
            speed=standing.images_per_second,
        )
        if standing.errors:
            self.console.print(validation_table(standing))


def validation_table(standing: Standing) -> Table:
    """Masked L1 of each split and sphere, and as a share of the constant lighting's."""
    title = (
        f"step {standing.step} of {standing.total}: masked L1 (share of the best constant lighting)"
    )
    table = Table("split", *SPHERES, title=title, title_justify="left")
    for errors in standing.errors:
        table.add_row(errors.split, *(cell(errors, name) for name in SPHERES))
    return table


def cell(errors: SphereErrors, sphere: str) -> str:
    """0.123 (0.61)."""
    ratio = errors.ratio(sphere)
    share = "" if ratio is None else f" ({ratio:.2f})"
    return f"{errors.model[sphere]:.4f}{share}"
