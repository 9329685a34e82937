"""Native libraries kept off the terminal."""

import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from io import StringIO
from tempfile import TemporaryFile


@contextmanager
def quiet() -> Iterator[None]:
    """Drop what is printed meanwhile, by Python and past its streams; errors stay exceptions."""
    kept = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


@contextmanager
def overheard() -> Iterator[list[str]]:
    """Keep what a native library prints on stderr; the list holds its lines afterwards."""
    lines: list[str] = []
    kept = os.dup(2)
    with TemporaryFile() as paper:
        try:
            os.dup2(paper.fileno(), 2)
            yield lines
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            paper.seek(0)
            lines += paper.read(65_536).decode("utf-8", "replace").splitlines()
