"""A hidden folder next to a result in which finished parts wait until all is done: a killed run
goes on with them."""

import shutil
from collections.abc import Sequence
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

import numpy as np

from deeplight.io.arrays_file import read_arrays
from deeplight.io.atomic import replacing

_KEY = "made-of"


def made_of(files: Sequence[Path], *settings: object) -> bytes:
    """What decides how parts look: the program's version, files (size, time), values (`repr`).

    Raises:
        OSError: a file is missing.
    """
    parts: list[object] = [version("deeplight")]
    for file in files:
        status = file.stat()
        parts += [str(file.resolve()), status.st_size, status.st_mtime_ns]
    return repr([*parts, *settings]).encode()


class KeptFolder:
    """Made if it is missing; `remove` it when all is done.

    Args:
        folder: where.
        key: what the parts are made of (`made_of`); those of another key are thrown away.

    Raises:
        OSError: the folder cannot be made or read.
    """

    def __init__(self, folder: Path, key: bytes) -> None:
        self.folder = folder
        digest, record = sha256(key).hexdigest(), folder / _KEY
        folder.mkdir(parents=True, exist_ok=True)
        if not record.is_file() or record.read_text() != digest:
            for part in folder.iterdir():  # the folder stays: a run's lock may lie on it
                part.unlink()
            with replacing(record) as temporary:
                temporary.write_text(digest)

    def has(self, name: str) -> bool:
        """Whether arrays of this name were kept."""
        return (self.folder / f"{name}.npz").is_file()

    def arrays(self, name: str) -> dict[str, np.ndarray] | None:
        """What `keep` was given; None if nothing whole is there."""
        try:
            return read_arrays(self.folder / f"{name}.npz")
        except (OSError, ValueError):
            return None

    def keep(self, name: str, **arrays: np.ndarray) -> None:
        """Write arrays, all or none.

        Raises:
            OSError: they cannot be written.
        """
        path = self.folder / f"{name}.npz"
        with replacing(path) as temporary, temporary.open("wb") as file:
            np.savez(file, allow_pickle=False, **arrays)

    def remove(self) -> None:
        """Take the folder away."""
        shutil.rmtree(self.folder, ignore_errors=True)
