"""A data set at an address (s3://, gs://, http://, ...), copied file by file as it is read."""

import errno
import hashlib
import os
import shutil
from dataclasses import dataclass
from pathlib import Path

from deeplight.dataset.manifest import MANIFEST, ShardRecord
from deeplight.dataset.shards import index_path, sha256_of
from deeplight.errors import DataSetError
from deeplight.io.atomic import replacing

CACHE = "DEEPLIGHT_CACHE"
"""Environment variable: the folder that keeps the copies; else a folder of the user's cache."""


def is_address(place: object) -> bool:
    """Whether `place` is an address and not a folder of this machine."""
    return isinstance(place, str) and "://" in place


@dataclass(frozen=True)
class Remote:
    """An address and the folder of its copies.

    The folder is named by the manifest's checksum: a data set that changes at its address is
    another one here, and no copy is ever stale.
    """

    address: str
    folder: Path

    @classmethod
    def open(cls, address: str) -> "Remote":
        """Copy the manifest, always anew; nothing else yet.

        Raises:
            DataSetError: there is no data set at the address, or it cannot be reached.
        """
        address = address.rstrip("/")
        manifest = _read(f"{address}/{MANIFEST}")
        remote = cls(address, cache() / hashlib.sha256(manifest).hexdigest()[:16])
        with replacing(remote.folder / MANIFEST) as temporary:
            temporary.write_bytes(manifest)
        return remote

    def shard(self, record: ShardRecord) -> Path:
        """Where the copy of a shard lies; copied now if it has not been.

        Raises:
            DataSetError: it cannot be reached, or has other bytes than the manifest says.
        """
        path = self.folder / record.file
        if not path.is_file():
            with replacing(path) as temporary:
                _copy(f"{self.address}/{record.file}", temporary)
                if sha256_of(temporary) != record.sha256:
                    got = "other bytes than its checksum says"
                    do = "upload the data set again, all files of one run"
                    raise DataSetError(f"the shard {record.file} at {self.address}", got, do)
        return path

    def index(self, record: ShardRecord) -> Path:
        """Where the copy of a shard's index lies; copied now if it has not been."""
        path = index_path(self.folder / record.file)
        if not path.is_file():
            with replacing(path) as temporary:
                _copy(f"{self.address}/{path.name}", temporary)
        return path

    def optional(self, name: str) -> None:
        """Copy a file that a data set may have; nothing happens where it has none.

        Raises:
            DataSetError: it cannot be reached.
        """
        path = self.folder / name
        if not path.is_file() and _exists(f"{self.address}/{name}"):
            with replacing(path) as temporary:
                _copy(f"{self.address}/{name}", temporary)


def cache() -> Path:
    """The folder that keeps copies of data sets."""
    if chosen := os.environ.get(CACHE):
        return Path(chosen)
    home = os.environ.get("XDG_CACHE_HOME")
    return (Path(home) if home else Path.home() / ".cache") / "deeplight" / "datasets"


def _read(address: str) -> bytes:
    import fsspec  # comes with the extra `train`

    try:
        with fsspec.open(address, "rb") as file:
            content: bytes = file.read()
            return content
    except Exception as error:  # each protocol's library has its own kinds
        raise _unreachable(address, error) from error


def _exists(address: str) -> bool:
    import fsspec

    try:
        system, path = fsspec.core.url_to_fs(address)
        return bool(system.exists(path))
    except Exception as error:  # each protocol's library has its own kinds
        raise _unreachable(address, error) from error


def _copy(address: str, path: Path) -> None:
    import fsspec

    try:
        with fsspec.open(address, "rb") as source, path.open("wb") as target:
            shutil.copyfileobj(source, target, 1 << 20)
    except Exception as error:
        if isinstance(error, OSError) and error.errno == errno.ENOSPC:
            raise  # the fault is on this side
        raise _unreachable(address, error) from error


def _unreachable(address: str, error: Exception) -> DataSetError:
    do = "check the address, the network and its access rights"
    if isinstance(error, ImportError | ValueError):
        do = "install the package fsspec names for this kind of address, or copy the folder here"
    got = f"{type(error).__name__}: {error}"
    return DataSetError(f"a data set file at {address}", got, do)
