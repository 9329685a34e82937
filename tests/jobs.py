"""Work for the engine's tests, in a module that worker processes can import."""

import errno
import os
import time
from dataclasses import dataclass
from pathlib import Path

from deeplight.errors import InputError
from deeplight.io.atomic import replacing


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


def fail_next_to_a_writer(job: Sum) -> None:
    """Number 0 writes for as long as it may; number 1 meets a full disk meanwhile."""
    if job.number == 0:
        with replacing(job.folder / "deep" / "0.txt") as temporary:
            temporary.write_text("half")
            time.sleep(60)
    while not any((job.folder / "deep").glob(".0*")):
        time.sleep(0.01)
    raise OSError(errno.ENOSPC, "full")


def threads_allowed(job: int) -> str | None:
    return os.environ.get("OMP_NUM_THREADS")
