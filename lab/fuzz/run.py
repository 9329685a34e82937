"""Give damaged files to readers in a child process with limits, and keep those that do harm.

A reader may give something, or refuse in one line (an `InputError`, or the operating system's
error). Anything else is a finding: another exception, a message of several lines, a crash, more
than `HANG_S` seconds, more than `MOST_BYTES` of memory.
"""

import multiprocessing
import os
import time
import traceback
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from deeplight.errors import InputError
from deeplight.jobs import begin_worker
from lab.fuzz.mutate import mutated
from lab.fuzz.readers import readers_of
from lab.fuzz.seeds import OBJ, SEEDS

HANG_S = 10.0
BUSY = 6  # times as long, where the processor has not been given
START_S = 120.0
MOST_BYTES = 1_500_000_000
LIMIT_BYTES = 4_000_000_000


@dataclass(frozen=True)
class Case:
    """One damaged file: these three numbers make it again."""

    kind: str
    number: int
    seed: int


@dataclass(frozen=True)
class Finding:
    """What a file did."""

    case: Case
    reader: str
    what: str


@dataclass
class Result:
    """What came out.

    Attributes:
        cases, refused: files given to readers, and how often one was refused.
        findings: the harm done.
        slowest_s, largest_bytes: of any one file.
    """

    cases: int = 0
    refused: int = 0
    slowest_s: float = 0.0
    largest_bytes: int = 0
    findings: tuple[Finding, ...] = ()


def damaged(case: Case, good: bytes) -> bytes:
    """Make the file of a case."""
    rng = np.random.default_rng([case.seed, zlib.crc32(case.kind.encode()), case.number])
    return mutated(good, case.kind, rng)


def fuzz(
    kinds: Sequence[str],
    cases: int,
    seed: int = 0,
    seconds: float = float("inf"),
    keep: Path | None = None,
    advance: Callable[[int], None] = lambda count: None,
) -> Result:
    """Try `cases` damaged files of each format, in turn, for at most this number of seconds.

    Args:
        kinds: of `seeds.SEEDS`.
        cases: of each.
        seed: of all random numbers.
        seconds: where to stop at the latest; the first file of each format is tried in any case.
        keep: folder for the files that did harm.
        advance: called with the number of files just done.
    """
    result, findings = Result(), []
    with TemporaryDirectory() as scratch:
        good = {kind: _good(kind, Path(scratch)) for kind in kinds}
        child = _Child(Path(scratch), kinds)
        until = time.monotonic() + seconds
        for number in range(cases):
            for kind in kinds:
                if number and time.monotonic() > until:
                    break
                case = Case(kind, number, seed)
                content = good[kind] if number == 0 else damaged(case, good[kind])
                found = child.tries(case, content, result)
                findings += found
                if found and keep is not None:
                    keep.mkdir(parents=True, exist_ok=True)
                    (keep / f"{seed}-{number}.{kind}").write_bytes(content)
                advance(1)
        child.end()
    result.findings = tuple(findings)
    return result


def _good(kind: str, folder: Path) -> bytes:
    path = folder / f"good.{kind}"
    SEEDS[kind](path)
    return path.read_bytes()


class _Child:
    """The process that reads; a new one after each that hung or died."""

    def __init__(self, folder: Path, kinds: Sequence[str]) -> None:
        self.folder, self._kinds = folder, tuple(kinds)
        (folder / "a.mtl").write_bytes(b"newmtl a\nKd 1 0 0\nmap_Kd good.png\n")
        self._process: Any = None
        self._pipe: Any = None

    def tries(self, case: Case, content: bytes, result: Result) -> list[Finding]:
        path = self.folder / f"case.{case.kind}"
        path.write_bytes(content)
        found = []
        result.cases += 1
        for reader in readers_of(case.kind):
            name = reader.__name__.strip("_")
            if self._process is None:
                self._begin()
            self._before = _seconds_of(self._process.pid)
            self._pipe.send((reader, path))
            began = time.monotonic()
            what = self._answer(result)
            took = time.monotonic() - began
            result.slowest_s = max(result.slowest_s, took)
            first = case.number == 0 and reader is readers_of(case.kind)[0]
            if what is None and first and self.refused:
                what = f"a good file is refused: {self.refused}"
            if what is not None:
                found.append(Finding(case, name, what))
        return found

    def _answer(self, result: Result) -> str | None:
        """What is wrong with the child's answer, or with there being none."""
        self.refused = ""
        if not self._answers():
            self.end()
            return f"no answer in {HANG_S:.0f} s"
        try:
            self.refused, harm, most = self._pipe.recv()
        except EOFError:
            self._process.join()
            code = self._process.exitcode
            self._process = None
            return f"the process died: exit code {code}"
        result.refused += bool(self.refused)
        result.largest_bytes = max(result.largest_bytes, most)
        if most > MOST_BYTES:
            return f"{most / 1e6:,.0f} MB of memory"
        return harm or None

    def _answers(self) -> bool:
        """Whether an answer comes in time; more is given while a busy machine lets it wait."""
        for _ in range(BUSY):
            if self._pipe.poll(HANG_S):
                return True
            if _seconds_of(self._process.pid) - self._before > HANG_S:
                return False
            if not _runnable(self._process.pid):
                return False
        return False

    def _begin(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_read_all, args=(theirs, self._kinds), daemon=True)
        self._process.start()
        theirs.close()
        if not any(self._pipe.poll(START_S) for _ in range(BUSY)):
            raise TimeoutError("the reading process did not start")
        self._pipe.recv()

    def end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._process = None


def _read_all(pipe: Connection, kinds: Sequence[str]) -> None:
    begin_worker()
    _limit()
    for kind in kinds:  # what readers import is no time of theirs
        for reader in readers_of(kind):
            _try(reader, Path(f"missing.{kind}"))
    pipe.send(None)
    while True:
        reader, path = pipe.recv()
        _forget_peak()
        refused, harm = _try(reader, path)
        pipe.send((refused, harm, _peak()))


def _try(reader: Callable[[Path], Any], path: Path) -> tuple[str, str]:
    try:
        reader(path)
    except InputError as error:
        return str(error), "" if str(error).isprintable() else f"not one line: {str(error)!r}"
    except OSError as error:
        if error.errno is not None:
            return str(error), ""
        return "", traceback.format_exc()
    except BaseException:
        return "", traceback.format_exc()
    return "", ""


def _limit() -> None:
    try:
        import resource
    except ImportError:
        return
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_DATA, (LIMIT_BYTES, LIMIT_BYTES))


def _stat(process: int) -> list[str]:
    """Give what Linux says of a process, from its state on; nothing where that is not to be had."""
    stat = Path(f"/proc/{process}/stat")
    return stat.read_text("utf-8", "replace").rpartition(")")[2].split() if stat.exists() else []


def _seconds_of(process: int) -> float:
    """Give the processor time of a process so far; 0 where that is not to be had."""
    words = _stat(process)
    return sum(map(int, words[11:15])) / os.sysconf("SC_CLK_TCK") if words else 0.0


def _runnable(process: int) -> bool:
    """Whether a process, or one that it started, wants the processor or waits for the disk."""
    words = _stat(process)
    if not words:
        return False
    children = [
        int(word)
        for file in Path(f"/proc/{process}/task").glob("*/children")
        for word in file.read_text().split()
    ]
    return words[0] in "RD" or any(_runnable(child) for child in children)


def _forget_peak() -> None:
    refs = Path("/proc/self/clear_refs")
    if refs.exists():
        refs.write_text("5")


def _peak() -> int:
    status = Path("/proc/self/status")
    if not status.exists():
        return 0
    lines = status.read_text().splitlines()
    return 1024 * int(next(line for line in lines if line.startswith("VmHWM")).split()[1])


assert OBJ.startswith(b"mtllib a.mtl")  # which `_Child` writes
