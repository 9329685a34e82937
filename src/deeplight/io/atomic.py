"""Write a file whole or not at all, and no folder for nothing."""

import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def replacing(path: Path | str) -> Iterator[Path]:
    """Give a temporary path beside `path`; it becomes `path` on success and is removed on failure.

    The temporary name keeps the suffix, since image writers choose their format by it, and starts
    with a dot, so that a folder listing does not take it for a result. Missing parent folders are
    made. An existing file keeps its old content until the last moment.

    A kill -9 leaves the temporary file behind; it never leaves a half-written `path`.

    Raises:
        OSError: the folder cannot be made or written, or the disk is full.
    """
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_name(f".{path.stem[:100]}.{secrets.token_hex(4)}{path.suffix}")
    try:
        yield temporary
        temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


@contextmanager
def results_folder(path: Path) -> Iterator[None]:
    """Make the folder of the results; take it away again if nothing came into it.

    Raises:
        OSError: it cannot be made, before any work starts.
    """
    made = not path.exists()
    path.mkdir(parents=True, exist_ok=True)
    try:
        yield
    finally:
        if made and not any(path.iterdir()):
            path.rmdir()
