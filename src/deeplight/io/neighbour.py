"""Files that another file names: textures, buffers, material libraries."""

import stat
from pathlib import Path, PureWindowsPath

from deeplight.errors import ImageFileError


def neighbour(path: Path, name: str, max_bytes: int) -> bytes:
    """Read the file that `path` calls `name`: next to it or in a folder below.

    A name that leads elsewhere (another machine's absolute path, a parent folder) is looked for
    next to `path` by its last part alone. Pipes and devices are refused before they are opened.

    Raises:
        OSError: there is no such file, or reading it is not permitted.
        ImageFileError: no regular file, or more than `max_bytes`.
    """
    folder = path.parent.resolve()
    plain = name.strip().replace("\\", "/")
    for tried in (plain, PureWindowsPath(plain).name):
        found = folder / tried
        if "\0" not in tried and found.exists() and found.resolve().is_relative_to(folder):
            return _content(found, max_bytes)
    raise FileNotFoundError(2, "No such file next to the one that names it", str(folder / plain))


def _content(path: Path, max_bytes: int) -> bytes:
    status = path.stat()
    if not stat.S_ISREG(status.st_mode):  # opening a pipe would wait for ever
        raise ImageFileError("a regular file", f"{path}, which is none", "copy it into one")
    if status.st_size > max_bytes:
        got = f"{path} of {status.st_size / 1e6:.0f} MB"
        raise ImageFileError(f"at most {max_bytes / 1e6:.0f} MB", got, "make it smaller")
    return path.read_bytes()
