"""Write a file whole or not at all, and no folder for nothing."""

import contextlib
import errno
import hashlib
import os
import re
import secrets
import shutil
import socket
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

from deeplight.errors import ConfigError

MAX_NAME_BYTES = 255
LONGEST_SUFFIX = 20
LONGEST_ADDITION = 30  # a frame's number and ".preview.png", say
_ENDS = {".png": b"IEND\xaeB`\x82", ".jpg": b"\xff\xd9", ".jpeg": b"\xff\xd9"}
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_LEFTOVER = re.compile(r"\..*\.dl-(?P<where>[0-9a-f]{8})-(?P<process>[0-9a-f]+)-[0-9a-f]{8}(\..*)?")


@contextmanager
def replacing(path: Path | str) -> Iterator[Path]:
    """Give a temporary path next to `path`; it becomes `path` on success and is removed on failure.

    The temporary name keeps the suffix, since image writers choose their format by it, and starts
    with a dot, so that a folder listing does not take it for a result. Missing parent folders are
    made. An existing file keeps its old content until the last moment.

    What was written is on the disk before it gets its name. A kill -9 leaves the temporary file
    behind, which the next run that writes into the folder removes; it never leaves a half-written
    `path`.

    Raises:
        OSError: the folder cannot be made or written, or the disk is full; by the name of `path`.
    """
    path = Path(path)
    if len(os.fsencode(path.name)) > MAX_NAME_BYTES:
        raise OSError(errno.ENAMETOOLONG, os.strerror(errno.ENAMETOOLONG), str(path))
    path.parent.mkdir(parents=True, exist_ok=True)
    _remove_leftovers(path.parent.resolve())
    temporary = path.with_name(_temporary_name(path))
    try:
        with _named(path, temporary):
            mode = _usual_mode(temporary)
            yield temporary
            _settle(temporary, path)
            temporary.chmod(mode)
            temporary.replace(path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def check_writable(path: Path) -> None:
    """Refuse before long work a file that cannot be written when it is done.

    Raises:
        OSError: it is a folder, or its folder is missing or cannot be written.
    """
    if path.is_dir():
        raise OSError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    temporary = path.with_name(_temporary_name(path))
    with _named(path, temporary):
        _usual_mode(temporary)


@contextmanager
def _named(path: Path, temporary: Path) -> Iterator[None]:
    """Let errors of the temporary file name the one that it stands for; those of a write to a full
    disk name none."""
    try:
        yield
    except OSError as error:
        unnamed = error.filename is None and error.errno in _FULL
        if unnamed or str(error.filename) == str(temporary):
            error.filename, error.filename2 = str(path), None
        raise


@contextmanager
def staging(folder: Path, stem: str) -> Iterator[Path]:
    """Give a folder inside `folder` to make several files in, which are then moved out of it.

    It is removed at the end; what a kill -9 leaves, the next run removes.

    Raises:
        OSError: it cannot be made.
    """
    _remove_leftovers(folder.resolve())
    made = folder / _temporary_name(folder / f"{stem}.")
    made.mkdir()
    try:
        yield made
    finally:
        shutil.rmtree(made, ignore_errors=True)


def fitted(name: str) -> str:
    """Give a name short enough to have `LONGEST_ADDITION` more bytes added, cut where it is not.

    What was cut off is left as its hash, so that different names stay different.
    """
    most = MAX_NAME_BYTES - LONGEST_ADDITION
    if len(os.fsencode(name)) <= most:
        return name
    end = f"-{hashlib.sha256(os.fsencode(name)).hexdigest()[:8]}"
    while len(os.fsencode(name)) > most - len(end):
        name = name[:-1]
    return name + end


def _temporary_name(path: Path) -> str:
    """Make a name that says which process writes it, of at most `MAX_NAME_BYTES`."""
    suffix = path.suffix if len(os.fsencode(path.suffix)) <= LONGEST_SUFFIX else ""
    end = f".dl-{_where()}-{os.getpid():x}-{secrets.token_hex(4)}{suffix}"
    # Image libraries want UTF-8; and an early part of a name says enough.
    stem = path.stem.encode("utf-8", "replace")[: MAX_NAME_BYTES - 1 - len(os.fsencode(end))]
    return f".{stem.decode('utf-8', 'ignore')}{end}"


def _usual_mode(temporary: Path) -> int:
    """Find who may read a file that is made here; some libraries make theirs for the owner alone.

    Asking the process for it would change it for a moment, for other threads as well.
    """
    temporary.touch()
    mode = temporary.stat().st_mode
    temporary.unlink()
    return stat.S_IMODE(mode)


def _settle(temporary: Path, path: Path) -> None:
    """Bring a file to the disk, and see that it is whole as far as its last bytes say.

    libpng's writer swallows the error of a full disk, and other libraries may.
    """
    with temporary.open("rb+") as file:
        end = _ENDS.get(path.suffix.lower(), b"")
        size = file.seek(0, os.SEEK_END)
        file.seek(max(size - len(end), 0))
        if size == 0 or (file.read() != end and end):
            text = os.strerror(errno.ENOSPC) + ", or the file was not written whole"
            raise OSError(errno.ENOSPC, text, str(path))
        os.fsync(file.fileno())


@cache
def _where() -> str:
    """Name this machine and this process's view of it, in which its number means something."""
    parts = [socket.gethostname()]
    with contextlib.suppress(OSError):
        parts.append(str(Path("/proc/self/ns/pid").readlink()))
    return hashlib.sha256(" ".join(parts).encode()).hexdigest()[:8]


@cache
def _remove_leftovers(folder: Path) -> None:
    """Remove what killed processes of this machine left in a folder; once for each folder."""
    _sweep(folder)


def _sweep(folder: Path) -> None:
    with contextlib.suppress(OSError):
        for entry in list(os.scandir(folder)):
            found = _LEFTOVER.fullmatch(entry.name) if entry.name.startswith(".") else None
            if found is None or found["where"] != _where() or _lives(int(found["process"], 16)):
                continue
            with contextlib.suppress(OSError):
                if entry.is_dir(follow_symlinks=False):
                    shutil.rmtree(entry.path, ignore_errors=True)
                else:
                    Path(entry.path).unlink()


def _lives(process: int) -> bool:
    if os.name == "nt":
        return True  # there, asking would end it
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:
        return True
    with contextlib.suppress(OSError):  # ended, and nobody has asked how: so it stays for a while
        state = Path(f"/proc/{process}/stat").read_text("utf-8", "replace").rpartition(")")[2]
        return state.split()[0] not in "ZX"
    return True


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
        if made and path.is_dir() and not any(path.iterdir()):
            path.rmdir()


@contextmanager
def only_run(folder: Path) -> Iterator[None]:
    """Refuse a second run into a folder while one writes there; a killed one holds nothing.

    The lock lies on the folder itself and leaves no file. Where there are no such locks (Windows,
    some network disks) nothing is refused; files are whole there too, and the same runs write the
    same bytes. The further processes of a run on several devices (LOCAL_RANK) are let through. When
    the block ends by an exception, what its ended workers left half-written is removed.

    Raises:
        ConfigError: another process is in the block.
        OSError: the folder cannot be made.
    """
    if int(os.environ.get("LOCAL_RANK", 0)) > 0:
        yield
        return
    with results_folder(folder), _locked(folder):
        try:
            yield
        except BaseException:  # say a full disk, by which workers were ended while they wrote
            for parent, _, _ in os.walk(folder):
                _sweep(Path(parent))
            raise


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    try:
        import fcntl
    except ImportError:
        yield
        return
    held = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(held, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(held)
        do = "wait for it, or give another folder"
        raise ConfigError(f"one run into {folder}", "another that is still going", do) from None
    except OSError:
        pass  # a disk without locks
    try:
        yield
    finally:
        os.close(held)
