"""What a user sees while a verb works: one console for results, one for notes, one progress bar.

Results go to stdout, everything else to stderr. The bar is drawn on a terminal; where stderr goes
to a file or a log, it is a line now and then.
"""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import timedelta
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.markup import escape
from rich.measure import Measurement
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

SECONDS_BETWEEN_LINES = 30.0
"""How often a bar that nobody sees writes a line."""


def results_console() -> Console:
    """The console of results: stdout, lines never wrapped, paths never coloured."""
    return Console(highlight=False, soft_wrap=True)


def print_tables(tables: Sequence[Table]) -> None:
    """Print results to stdout with all their columns: a narrower terminal wraps the lines."""
    console = Console(highlight=False)
    unbounded = console.options.update(max_width=10_000)
    widths = [Measurement.get(console, unbounded, table).maximum for table in tables]
    console.width = max(console.width, *widths)
    console.print(*tables)


def notes_console() -> Console:
    """The console of notes and complaints: stderr."""
    return Console(stderr=True, highlight=False, soft_wrap=True)


class ProgressBar:
    """Work that is done step by step, shown on stderr while it goes on.

    Attributes:
        console: what prints above the bar without tearing it.
    """

    def __init__(self, description: str, total: int | None, quiet: bool = False) -> None:
        self.console = notes_console()
        self._lines = not self.console.is_terminal and not quiet
        self._next_line = time.monotonic() + SECONDS_BETWEEN_LINES
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
        self._progress = Progress(
            *columns,
            TimeRemainingColumn(),
            console=self.console,
            transient=True,
            disable=quiet or not self.console.is_terminal,
            redirect_stdout=False,
            redirect_stderr=False,
        )
        self._task = self._progress.add_task(escape(description), total=total)

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        self._progress.stop()

    def __call__(self, steps: int = 1) -> None:
        """Move on by a number of steps."""
        self._progress.advance(self._task, steps)
        self._line()

    def reach(self, done: int, total: int | None = None) -> None:
        """Stand at a number of steps, of a number if that is known."""
        self._progress.update(self._task, completed=done, total=total)
        self._line()

    def begin(self, description: str, total: int | None) -> None:
        """Begin another piece of work, of a number of steps if that is known."""
        self._progress.reset(self._task, description=escape(description), total=total)

    def expect(self, total: int) -> None:
        """Set the number of steps, where it is known only later."""
        self._progress.update(self._task, total=total)

    def name(self, description: str) -> None:
        """Say what is being worked on."""
        self._progress.update(self._task, description=escape(description))

    def say(self, line: str) -> None:
        """Print what begins now, where no bar shows it."""
        if self._lines:
            self._next_line = time.monotonic() + SECONDS_BETWEEN_LINES
            self.console.print(line, markup=False)

    def _line(self) -> None:
        if not self._lines or time.monotonic() < self._next_line:
            return
        self._next_line = time.monotonic() + SECONDS_BETWEEN_LINES
        task = self._progress.tasks[self._task]
        of_total = f" of {task.total:.0f}" if task.total else ""
        left = (
            f", {timedelta(seconds=round(task.time_remaining))} left" if task.time_remaining else ""
        )
        self.console.print(f"{task.description} {task.completed:.0f}{of_total}{left}")


@contextmanager
def progress_bar(
    description: str, total: int | None = None, quiet: bool = False
) -> Iterator[ProgressBar]:
    """Show a bar while the block runs; call what it gives with the number of steps done."""
    with ProgressBar(description, total, quiet) as bar:
        yield bar
