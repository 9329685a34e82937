"""Work for the engine's tests, in a module that worker processes can import."""

import os
from dataclasses import dataclass
from pathlib import Path

from deeplight.errors import InputError


@dataclass(frozen=True)
class Sum:
    """A made-up job."""

    number: int
    folder: Path


def add_up(job: Sum) -> int:
    if job.number == 3:
        raise InputError("another number", "3", "choose one")
    if job.number == 99:
        raise ZeroDivisionError("a bug")
    result = sum(range(job.number))
    (job.folder / f"{job.number}.txt").write_text(str(result))
    return result


def threads_allowed(job: int) -> str | None:
    return os.environ.get("OMP_NUM_THREADS")
