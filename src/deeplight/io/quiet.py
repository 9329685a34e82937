"""Native libraries kept off the terminal."""

import os
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from tempfile import TemporaryFile

_file_2 = threading.Lock()
"""Held by whoever has turned stderr elsewhere: two who do not know of each other would lose it."""


class _Hush:
    """Stderr turned away for as long as anybody, in any thread, wants it."""

    def __init__(self) -> None:
        self._lock, self._users = threading.Lock(), 0
        self._kept: int | None = None

    def begin(self) -> None:
        with self._lock:
            self._users += 1
            if self._users == 1:
                _file_2.acquire()
                self._kept = _turned_away()

    def end(self) -> None:
        with self._lock:
            self._users -= 1
            if self._users:
                return
            if self._kept is not None:
                os.dup2(self._kept, 2)
                os.close(self._kept)
            _file_2.release()


def _turned_away() -> int | None:
    """Have stderr lead nowhere; give where it led before, None if it was closed."""
    try:
        kept = os.dup(2)
    except OSError:
        return None
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 2)
    os.close(nowhere)
    return kept


_hush = _Hush()


@contextmanager
def hushed() -> Iterator[None]:
    """Drop what native libraries print on stderr meanwhile; for any number of threads at once."""
    _hush.begin()
    try:
        yield
    finally:
        _hush.end()


@contextmanager
def quiet() -> Iterator[None]:
    """Drop what is printed meanwhile, by Python and past its streams; errors stay exceptions."""
    with (
        hushed(),
        redirect_stdout(StringIO()),
        redirect_stderr(StringIO()),
        warnings.catch_warnings(action="ignore"),
    ):
        yield


@contextmanager
def overheard() -> Iterator[list[str]]:
    """Keep what a native library prints on stderr; the list holds its lines afterwards."""
    lines: list[str] = []
    with _file_2, TemporaryFile() as paper:
        kept = os.dup(2)
        try:
            os.dup2(paper.fileno(), 2)
            yield lines
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            paper.seek(0)
            lines += paper.read(65_536).decode("utf-8", "replace").splitlines()
