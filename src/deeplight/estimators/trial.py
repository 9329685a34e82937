"""Run a stranger's network once in a process of its own before it runs in ours.

A model file is a program: it can ask for any memory, take any time, or crash the library that runs
it. The child process has limits, and whatever happens to it becomes one line.
"""

import os
import subprocess
import sys
from functools import lru_cache
from pathlib import Path

from deeplight.errors import ModelError

CPU_S = 10
"""A network of ours takes a tenth of a second."""
WALL_S = 60
DATA_BYTES = 1_200_000_000
REFUSED = 2
"""Exit code of a child that printed why the network cannot be used."""


def try_once(path: Path) -> None:
    """Run the network of `path` on a grey photo in a child process.

    The answer is kept for as long as the file stays as it is.

    Raises:
        ModelError: it cannot be used, or hangs, crashes or takes too much memory.
    """
    if not path.is_file():
        return  # whoever opens it says so
    status = path.stat()
    refusal = _refusal(path.resolve(), (status.st_mtime_ns, status.st_size))
    if refusal is not None:
        raise ModelError(*refusal)


@lru_cache(maxsize=64)
def _refusal(path: Path, _version: tuple[int, int]) -> tuple[str, str, str] | None:
    command = [sys.executable, "-m", "deeplight.estimators.trial_process", str(path), str(CPU_S)]
    given = {"PYTHONPATH": os.pathsep.join(sys.path), "OMP_NUM_THREADS": "1"}
    try:
        child = subprocess.run(
            command, env=os.environ | given, capture_output=True, timeout=WALL_S, check=False
        )
    except subprocess.TimeoutExpired:
        return _bad(path, f"takes more than {WALL_S} s")
    return verdict(path, child.returncode, child.stdout)


def verdict(path: Path, code: int, said: bytes) -> tuple[str, str, str] | None:
    """Judge a file by how the child ended and what it printed; None if usable."""
    if code == 0:
        return None
    words = said.decode("utf-8", "replace").split("\0")
    if code == REFUSED and len(words) == 3:
        return words[0], words[1], words[2]
    if code in (-24, -9):  # SIGXCPU and what follows it
        return _bad(path, f"takes more than {CPU_S} s for one photo")
    return _bad(path, "crashes what runs it, or needs too much memory")


def _bad(path: Path, what: str) -> tuple[str, str, str]:
    return "a network of deeplight", f"{path}, which {what}", "use another model file"
