"""Many photos in one go: progress, a line for each result, a line for each failure."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import Progress

from deeplight.cli.main import told
from deeplight.errors import ImageFileError, InputError
from deeplight.estimators.network import Estimate, NetworkEstimator
from deeplight.estimators.results import write_results
from deeplight.estimators.sources import Source, find_sources
from deeplight.formats.webxr import light_estimate_file
from deeplight.io.atomic import results_folder
from deeplight.io.orientation import TOOLS


class _CannotWriteError(Exception):
    """Carries the OSError of an output; it ends the batch, since the next one would fail too."""

    def __init__(self, reason: OSError) -> None:
        self.reason = reason


@dataclass(frozen=True)
class Batch:
    """One run of `deeplight estimate`.

    Attributes:
        estimator: the loaded model.
        out: folder of the results.
        fov_deg: vertical field of view of every photo, None to read it from EXIF.
        made_for: the tool the environments are for.
        hdr: also write Radiance RGBE.
    """

    estimator: NetworkEstimator
    out: Path
    fov_deg: float | None = None
    made_for: str | None = None
    hdr: bool = False

    def run(self, paths: Sequence[Path]) -> None:
        """Work on everything that `paths` name.

        Raises:
            InputError: some of it cannot be used; raised when the rest is done.
            OSError: the only photo cannot be read, or a result cannot be written.
        """
        sources, failures = find_sources(paths, self.out)
        total = len(sources) + len(failures)
        with results_folder(self.out), _Talk(show_bar=total > 1) as talk:
            for failure in failures:
                talk.complain(failure, silent=total == 1)
            for source in talk.track(sources):
                try:
                    talk.report(source, self._estimate(source, talk))
                except (InputError, OSError) as error:
                    failures.append(error)
                    talk.complain(error, silent=total == 1)
                except _CannotWriteError as wrapper:
                    raise wrapper.reason from None
        if failures and total == 1:
            raise failures[0]
        if failures:
            got = f"{len(failures)} of {total} that cannot be used, named above"
            raise ImageFileError("usable photos", got, "the others are done")

    def _estimate(self, source: Source, talk: "_Talk") -> "_Done":
        """Estimate a photo or every frame of a video, and write the results."""
        done = _Done()
        for stem, photo in source.photos():
            estimate = self.estimator.explain(photo, self.fov_deg)
            try:
                files = self._write(estimate, stem)
            except OSError as error:
                raise _CannotWriteError(error) from error
            done = _Done(done.count + 1, done.first or files, files, estimate.notes)
            talk.pulse(f"{source.path.name} {done.count}" if done.count > 1 else source.path.name)
        return done

    def _write(self, estimate: Estimate, stem: str) -> list[Path]:
        further = {}
        if self.made_for == "webxr":
            further[".webxr.json"] = light_estimate_file(estimate.lighting)
        tool = TOOLS.get(self.made_for or "")
        turn = tool.turn if tool else None
        return write_results(
            estimate, self.estimator, self.out, stem, turn=turn, hdr=self.hdr, further=further
        )


@dataclass(frozen=True)
class _Done:
    """What came of one source: how many results, the first one's and the last one's files."""

    count: int = 0
    first: Sequence[Path] = ()
    last: Sequence[Path] = ()
    notes: Sequence[str] = ()


class _Talk:
    """What the user sees: the bar and complaints on stderr, results on stdout at the end."""

    def __init__(self, show_bar: bool) -> None:
        console = Console(stderr=True, highlight=False, soft_wrap=True)
        self._progress = Progress(
            console=console,
            transient=True,
            disable=not (show_bar and console.is_terminal),
            redirect_stdout=False,
            redirect_stderr=False,
        )
        self._task = self._progress.add_task("estimating", total=None)
        self._lines: list[str] = []
        self._notes: Counter[str] = Counter()

    def __enter__(self) -> "_Talk":
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()
        results = Console(highlight=False, soft_wrap=True)
        for line in self._lines:  # after the bar, so that neither is drawn over the other
            results.print(line)
        for note, count in self._notes.items():
            of_how_many = f"{count} of {len(self._lines)}: " if len(self._lines) > 1 else ""
            results.print(f"  [dim]{of_how_many}{escape(note)}[/dim]")

    def track(self, sources: Sequence[Source]) -> Iterator[Source]:
        """Give the sources one by one and move the bar."""
        self._progress.update(self._task, total=len(sources))
        for source in sources:
            yield source
            self._progress.advance(self._task)

    def pulse(self, what: str) -> None:
        """Name what is being worked on."""
        self._progress.update(self._task, description=escape(what))

    def report(self, source: Source, done: _Done) -> None:
        """Note one line on the results; what the user should know is told once for all of them."""
        if done.count > 1:
            made = f"{done.count} frames: {done.first[0]} to {done.last[0].name}"
        else:
            made = ", ".join([str(done.first[0]), *(file.name for file in done.first[1:])])
        self._lines.append(f"{escape(str(source.path))} -> {escape(made)}")
        self._notes.update(done.notes)

    def complain(self, error: InputError | OSError, silent: bool) -> None:
        """Tell of a failure in one line, unless it is about to be raised anyway."""
        if not silent:
            message = told(error) if isinstance(error, OSError) else str(error)
            line = f"deeplight estimate: {' '.join(message.split())}"
            self._progress.console.print(escape(line))
