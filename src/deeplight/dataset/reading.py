"""Reading a data set: example by example in order, or any example at once."""

import mmap
import shutil
import tarfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Int64, UInt8

from deeplight.dataset.example import Example
from deeplight.dataset.manifest import MANIFEST, Manifest, ShardRecord
from deeplight.dataset.members import (
    LIGHTING,
    SUFFIXES,
    decode_details,
    decode_pixels,
    from_members,
    unreadable,
)
from deeplight.dataset.plan import PLAN
from deeplight.dataset.remote import Remote, is_address
from deeplight.dataset.shards import COLUMNS, ShardIndex, extents_in, index_path, sha256_of
from deeplight.dataset.splits import TRAINING_SPLITS, splits_named
from deeplight.errors import DataSetError
from deeplight.io.atomic import replacing
from deeplight.io.basis_file import load_bases
from deeplight.lighting import LIGHTING_SIZE
from deeplight.reflectance import ReflectanceBasis, rig_bases
from deeplight.sphere import Rig

BASES = "bases.npz"
"""The file of measured reflectance bases that travels with a data set of filmed spheres."""
_MAKE = "make one with `deeplight simulate --hdri FOLDER --out {folder}`"


class SplitIndex:
    """The examples of some splits by number: `len(index)`, `index[i]`, no scan, little memory.

    Shards are mapped into memory at the first read of each process, so an index can be pickled
    or forked into loader workers.

    Attributes:
        keys: of all examples.
        places, takes, scenes, rigs: of all examples, as arrays of text (to draw by place).
    """

    def __init__(self, shards: list[Path], remote: Remote | None = None) -> None:
        indices = [ShardIndex.load(index_path(path)) for path in shards]
        counts = [len(index.keys) for index in indices]
        self._shards, self._remote = shards, remote
        self._records = [index.record for index in indices]
        self._starts = np.cumsum([0, *counts])
        self._extents: Int64[np.ndarray, "examples suffixes 2"] = np.concatenate(
            [np.zeros((0, len(SUFFIXES), 2), np.int64), *(index.extents for index in indices)]
        )
        self.keys = tuple(key for index in indices for key in index.keys)
        columns = {
            name: np.array([text for index in indices for text in index.columns[name]], np.str_)
            for name in COLUMNS
        }
        self.places, self.takes = columns["place"], columns["take"]
        self.scenes, self.rigs = columns["scene"], columns["rig"]
        self._maps: dict[int, mmap.mmap] = {}

    def __len__(self) -> int:
        return len(self.keys)

    def __getitem__(self, number: int) -> Example:
        """Give example `number`.

        Raises:
            IndexError: there is no such example.
            DataSetError: its bytes are damaged.
        """
        return from_members(self.keys[number], self.members(number))

    @property
    def has_lighting(self) -> Bool[np.ndarray, " examples"]:
        """Which examples carry their true lighting."""
        sizes: Int64[np.ndarray, " examples"] = self._extents[:, SUFFIXES.index(LIGHTING), 1]
        return sizes > 0

    def pixels(
        self, number: int
    ) -> tuple[UInt8[np.ndarray, "height width 3"], UInt8[np.ndarray, "3 size size 3"]]:
        """Give only background and spheres (in the order of `SPHERES`): what training reads."""
        return decode_pixels(self.keys[number], self.members(number))

    def details(self, number: int) -> Mapping[str, Any]:
        """Give `ExampleMeta.details` of an example, without its pictures."""
        return decode_details(self.keys[number], self.members(number))

    def members(self, number: int) -> dict[str, bytes]:
        """Give the undecoded members of example `number`, by suffix."""
        number = range(len(self))[number]  # negative numbers, IndexError
        shard = int(np.searchsorted(self._starts, number, side="right")) - 1
        content = self._map(shard)
        return {
            suffix: content[offset : offset + size]
            for suffix, (offset, size) in zip(SUFFIXES, self._extents[number].tolist(), strict=True)
            if size
        }

    def _map(self, shard: int) -> mmap.mmap:
        if shard not in self._maps:
            path = self._shards[shard]
            if self._remote is not None:
                self._remote.shard(self._records[shard])
            try:
                with path.open("rb") as file:
                    self._maps[shard] = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
            except (OSError, ValueError) as error:
                raise unreadable(path.name, error) from error
        return self._maps[shard]

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_maps": {}}


@dataclass(frozen=True)
class DataSet:
    """A finished data set in a folder, or at an address with copies in a folder.

    Attributes:
        other_bases: a file of measured reflectance bases to use instead of the data set's own.
    """

    folder: Path
    manifest: Manifest
    remote: Remote | None = None
    other_bases: Path | None = None
    _bases: dict[tuple[str, int], dict[str, ReflectanceBasis]] = field(
        default_factory=dict, repr=False, compare=False
    )

    @property
    def address(self) -> str:
        """Where it lies: its folder, or its address."""
        return str(self.folder) if self.remote is None else self.remote.address

    @property
    def splits(self) -> tuple[str, ...]:
        """The splits it has."""
        return tuple(self.manifest.splits)

    @cached_property
    def rigs(self) -> Mapping[str, Rig]:
        """Where the spheres sit, by the rig name in each example's metadata."""
        return {name: Rig.from_dict(dict(rig)) for name, rig in self.manifest.rigs.items()}

    @cached_property
    def bases_file(self) -> Path | None:
        """The measured reflectance bases of its spheres; None where they are analytic."""
        if self.other_bases is not None:
            return self.other_bases
        own = self.folder / BASES
        if self.remote is not None:
            self.remote.optional(BASES)
        return own if own.is_file() else None

    @property
    def bases_sha256(self) -> str:
        """A name of the bases that `bases` gives; "analytic" without measured ones."""
        return "analytic" if self.bases_file is None else sha256_of(self.bases_file)

    def bases(self, rig: str, light_size: int = LIGHTING_SIZE) -> dict[str, ReflectanceBasis]:
        """The reflectance basis of each of a rig's spheres: measured if there are any.

        Raises:
            DataSetError: the file of bases is damaged.
        """
        wanted = (rig, light_size)
        if wanted not in self._bases:
            file = self.bases_file
            self._bases[wanted] = (
                load_bases(file, self.rigs[rig], light_size)
                if file
                else rig_bases(self.rigs[rig], light_size)
            )
        return self._bases[wanted]

    def with_bases(self, file: Path) -> "DataSet":
        """The same data set, its spheres those of another file of bases.

        Raises:
            OSError, DataSetError: it cannot be read, or is no file of bases.
        """
        load_bases(file)
        return DataSet(self.folder, self.manifest, self.remote, file)

    @property
    def manifest_sha256(self) -> str:
        """A name of the content of the whole data set: the manifest has every shard's checksum."""
        return sha256_of(self.folder / MANIFEST)

    def index(self, split: str) -> SplitIndex:
        """Give random access to a split, or to a group of splits: "val", "test", "seen".

        Raises:
            DataSetError: the data set has no such split, or it is empty.
        """
        names = [name for name in splits_named(split) if self.manifest.examples(name)]
        if not names:
            have = ", ".join(self.splits) or "none"
            do = f"choose one it has ({have}), or make one with `deeplight simulate`"
            raise DataSetError(f"examples of split {split!r} in {self.folder}", "none", do)
        records = [record for name in names for record in self.manifest.splits[name]]
        records = [record for record in records if record.examples]
        if self.remote is not None:
            for record in records:
                self.remote.index(record)
        return SplitIndex([self.folder / record.file for record in records], self.remote)

    def examples(self, split: str) -> Iterator[Example]:
        """Give the examples of a split or group one after another, in the order of the shards."""
        index = self.index(split)
        return (index[number] for number in range(len(index)))

    def verify(self) -> None:
        """Compare every shard with its checksum and look into the training splits.

        Raises:
            DataSetError: a shard is missing or damaged, or holds HDR light it must not hold.
        """
        for split, records in self.manifest.splits.items():
            for record in records:
                if self.remote is not None:
                    self.remote.index(record)
                    self.remote.shard(record)
                _check_shard(self.folder / record.file, record, split)
            if split in TRAINING_SPLITS and self.manifest.examples(split):
                index = self.index(split)
                if index.has_lighting.any():
                    raise DataSetError(
                        "8-bit spheres only in a training split",
                        f"true HDR lighting in {index.keys[int(np.argmax(index.has_lighting))]}",
                        "make the data set again: training must never see HDR",
                    )


def add_bases(folder: Path, bases: Path) -> None:
    """Let measured reflectance bases travel with the data set in `folder`.

    Raises:
        OSError: a file cannot be read or written.
        DataSetError: it is no file of bases.
    """
    load_bases(bases)
    with replacing(folder / BASES) as temporary:
        shutil.copyfile(bases, temporary)


def open_dataset(folder: Path | str) -> DataSet:
    """Open the data set in `folder`; shards are looked at only when they are read.

    `folder` may be an address that fsspec knows (s3://, gs://, http://, memory://, ...); then each
    shard is copied to this machine when it is first read, see `remote`.

    Raises:
        DataSetError: no data set there, an unfinished one, one of another version, or a shard
            is missing or cut short, or the address cannot be reached.
    """
    if is_address(folder):
        remote = Remote.open(str(folder))
        return DataSet(remote.folder, Manifest.load(remote.folder), remote)
    folder = Path(folder)
    if not folder.is_dir():
        raise DataSetError(f"a data set in {folder}", "no such folder", _MAKE.format(folder=folder))
    if not (folder / MANIFEST).is_file():
        unfinished = (folder / PLAN).is_file()
        got = "an unfinished one" if unfinished else f"a folder without {MANIFEST}"
        do = "run the command that began it again: it goes on" if unfinished else _MAKE
        raise DataSetError(f"a data set in {folder}", got, do.format(folder=folder))
    manifest = Manifest.load(folder)
    for records in manifest.splits.values():
        for record in records:
            path = folder / record.file
            size = path.stat().st_size if path.is_file() else None
            if size != record.bytes or not index_path(path).is_file():
                got = "no such file or no index" if size is None else f"{size} bytes"
                raise unreadable(f"{path} of {record.bytes} bytes and its index", OSError(got))
    return DataSet(folder, manifest)


def _check_shard(path: Path, record: ShardRecord, split: str) -> None:
    """Compare a shard with its record, and its index with what really lies in the tar."""
    if sha256_of(path) != record.sha256:
        raise unreadable(record.file, ValueError("other bytes than its checksum says"))
    index = ShardIndex.load(index_path(path))
    try:
        same = np.array_equal(index.extents, extents_in(path, index.keys))
    except (KeyError, ValueError, tarfile.TarError) as error:
        raise unreadable(record.file, error) from error
    if index.record != record or index.split != split or not same:
        raise unreadable(record.file, ValueError("the index of another shard"))
