"""One shard: a WebDataset tar with an index next to it, the same bytes for the same examples.

A shard is the unit of work. Its tar is renamed into place when it is whole, its index after that,
so an index means a finished shard; a killed run loses the shard it was writing and nothing else.
"""

import hashlib
import io
import tarfile
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Int64

from deeplight.dataset.example import Example
from deeplight.dataset.manifest import (
    VERSION,
    ShardRecord,
    Skipped,
    check_version,
    read_json,
    write_json,
)
from deeplight.dataset.members import JPEG_QUALITY, SUFFIXES, to_members, unreadable
from deeplight.errors import DataSetError
from deeplight.io.atomic import replacing
from deeplight.sphere import Rig

COLUMNS = ("place", "take", "scene", "rig")

Item = Example | Skipped | Rig


@dataclass(frozen=True, eq=False)
class ShardIndex:
    """Where everything in a shard is, so that one example is read without a scan.

    Attributes:
        record: what the manifest says of the shard.
        split: of all its examples.
        keys: of the examples, in the order of the tar.
        columns: place, take, scene and rig of each example.
        extents: (example, suffix of `SUFFIXES`, (offset, size)) in bytes; size 0 = absent.
        skipped: sources that were left out of this shard.
        rigs: `Rig.to_dict()` of rigs found while it was made, by name.
    """

    record: ShardRecord
    split: str
    keys: tuple[str, ...]
    columns: Mapping[str, tuple[str, ...]]
    extents: Int64[np.ndarray, "examples suffixes 2"]
    skipped: tuple[Skipped, ...]
    rigs: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def save(self, path: Path) -> None:
        values = {
            "version": VERSION,
            "record": asdict(self.record),
            "split": self.split,
            "suffixes": list(SUFFIXES),
            "keys": list(self.keys),
            "columns": {name: list(values) for name, values in self.columns.items()},
            "extents": self.extents.tolist(),
            "skipped": [asdict(item) for item in self.skipped],
        }
        if self.rigs:
            values["rigs"] = dict(self.rigs)
        write_json(path, values, indent=None)

    @classmethod
    def load(cls, path: Path) -> "ShardIndex":
        """Read the index of a shard.

        Raises:
            DataSetError: it is of another version or damaged.
        """
        values = read_json(path)
        check_version(path, values)
        try:
            return cls._from_dict(values)
        except Exception as error:  # whatever a damaged one makes of it
            raise unreadable(path.name, error) from error

    @classmethod
    def _from_dict(cls, values: Mapping[str, Any]) -> "ShardIndex":
        keys = tuple(values["keys"])
        columns = {name: tuple(values["columns"][name]) for name in COLUMNS}
        for texts in (keys, *columns.values()):
            if len(texts) != len(keys) or not all(isinstance(text, str) for text in texts):
                raise ValueError("a column that does not name every example")
        return cls(
            ShardRecord(**values["record"]),
            values["split"],
            keys,
            columns,
            np.asarray(values["extents"], np.int64).reshape(len(keys), len(SUFFIXES), 2),
            tuple(Skipped(**item) for item in values["skipped"]),
            dict(values.get("rigs", {})),
        )


def index_path(shard: Path) -> Path:
    """Give where the index of the tar `shard` lies."""
    return shard.with_suffix(".json")


def write_shard(
    path: Path, split: str, items: Iterable[Item], jpeg_quality: int = JPEG_QUALITY
) -> ShardIndex:
    """Write a tar of `items` to `path` and its index next to it, both whole or not at all.

    Args:
        items: examples, sources that had to be left out, and rigs that only the work itself
            finds; read once, one held at a time.
        jpeg_quality: of backgrounds that come without their camera's JPEG.

    Raises:
        DataSetError: an example of another split, or a second one of the same key.
        OSError: the disk is full, no permission.
    """
    index_path(path).unlink(missing_ok=True)  # the old index does not vouch for the new tar
    tally = _Tally(split)
    with replacing(path) as temporary:
        with tarfile.open(temporary, "w", format=tarfile.USTAR_FORMAT) as tar:
            for item in items:
                if isinstance(item, Skipped):
                    tally.skipped.append(item)
                    continue
                if isinstance(item, Rig):
                    tally.rigs[item.name] = item.to_dict()
                    continue
                tally.add(item)
                extents = np.zeros((len(SUFFIXES), 2), np.int64)
                for suffix, content in to_members(item, jpeg_quality).items():
                    begin = _append(tar, f"{item.key}.{suffix}", content)
                    extents[SUFFIXES.index(suffix)] = begin, len(content)
                tally.extents.append(extents)
        index = tally.index(path.name, temporary)
    index.save(index_path(path))
    return index


def sha256_of(path: Path) -> str:
    """Give the checksum of a file, as hexadecimal text."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def extents_in(path: Path, keys: tuple[str, ...]) -> Int64[np.ndarray, "examples suffixes 2"]:
    """Read back where each member of a finished tar lies."""
    row = {key: number for number, key in enumerate(keys)}
    extents = np.zeros((len(keys), len(SUFFIXES), 2), np.int64)
    with tarfile.open(path, "r:") as tar:
        for member in tar:
            key, suffix = member.name.split(".", 1)
            extents[row[key], SUFFIXES.index(suffix)] = member.offset_data, member.size
    return extents


class _Tally:
    """What an index says, gathered while the examples go by."""

    def __init__(self, split: str) -> None:
        self.split = split
        self.columns: dict[str, dict[str, str]] = {name: {} for name in COLUMNS}  # by key
        self.licences: Counter[str] = Counter()
        self.skipped: list[Skipped] = []
        self.rigs: dict[str, Mapping[str, Any]] = {}
        self.extents: list[np.ndarray] = []

    def add(self, example: Example) -> None:
        if example.meta.split != self.split:
            raise DataSetError(
                f"examples of split {self.split}",
                f"{example.key} of split {example.meta.split}",
                "write each split to its own shards",
            )
        if example.key in self.columns["place"]:
            raise DataSetError("unique keys", f"{example.key} twice", "give every example its own")
        for name, values in self.columns.items():
            values[example.key] = getattr(example.meta, name)
        self.licences[example.meta.licence] += 1

    def index(self, name: str, tar: Path) -> ShardIndex:
        keys = tuple(self.columns["place"])
        places = Counter(self.columns["place"].values())
        record = ShardRecord(
            name,
            sha256_of(tar),
            tar.stat().st_size,
            len(keys),
            dict(sorted(places.items())),
            dict(sorted(self.licences.items())),
        )
        columns = {column: tuple(values.values()) for column, values in self.columns.items()}
        extents = np.array(self.extents, np.int64).reshape(len(keys), len(SUFFIXES), 2)
        return ShardIndex(
            record, self.split, keys, columns, extents, tuple(self.skipped), self.rigs
        )


def _append(tar: tarfile.TarFile, name: str, content: bytes) -> int:
    """Add a member; gives where its content begins, after a header of one block."""
    member = tarfile.TarInfo(name)  # its defaults: time 0, owner 0, no owner's name, mode 644
    member.size = len(content)
    begin = tar.offset + tarfile.BLOCKSIZE
    tar.addfile(member, io.BytesIO(content))
    return begin
