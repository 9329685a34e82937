"""What a data set holds: counts, checksums, places, rigs, licences, and how it was made."""

import json
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from deeplight.dataset.splits import SPLITS, check_places
from deeplight.errors import DataSetError
from deeplight.io.atomic import replacing
from deeplight.io.json_text import read_json as read_json_file

VERSION = 1
MANIFEST = "manifest.json"


@dataclass(frozen=True)
class Skipped:
    """A source file that was left out, and why."""

    file: str
    reason: str


@dataclass(frozen=True)
class ShardRecord:
    """One finished shard: what the manifest says of it.

    Attributes:
        file: name of the tar in the data set's folder; its index is the same name with .json.
        sha256: of the tar.
        bytes: size of the tar.
        examples: how many it holds.
        places, licences: examples of each.
    """

    file: str
    sha256: str
    bytes: int
    examples: int
    places: Mapping[str, int]
    licences: Mapping[str, int]


@dataclass(frozen=True)
class Manifest:
    """The table of contents of a data set, stored as `manifest.json`."""

    splits: Mapping[str, tuple[ShardRecord, ...]]
    rigs: Mapping[str, Mapping[str, Any]]
    skipped: tuple[Skipped, ...]
    recipe: Mapping[str, Any]

    def __post_init__(self) -> None:
        unknown = set(self.splits) - set(SPLITS)
        if unknown:
            raise DataSetError("splits of " + ", ".join(SPLITS), ", ".join(sorted(unknown)), _AGAIN)
        check_places({split: self.places(split) for split in self.splits})

    def examples(self, split: str) -> int:
        return sum(shard.examples for shard in self.splits.get(split, ()))

    def places(self, split: str) -> dict[str, int]:
        """Give the examples of each place of `split`, sorted by place."""
        return _sum_counts(shard.places for shard in self.splits.get(split, ()))

    def licences(self) -> dict[str, int]:
        """Give the examples under each licence, in all splits."""
        return _sum_counts(s.licences for shards in self.splits.values() for s in shards)

    def to_dict(self) -> dict[str, Any]:
        """Give plain JSON values; totals are written out for readers without this package."""
        splits = {
            split: {
                "examples": self.examples(split),
                "places": self.places(split),
                "shards": [asdict(shard) for shard in self.splits[split]],
            }
            for split in SPLITS
            if split in self.splits
        }
        return {
            "version": VERSION,
            "splits": splits,
            "rigs": dict(self.rigs),
            "licences": self.licences(),
            "skipped": [asdict(item) for item in self.skipped],
            "recipe": dict(self.recipe),
        }

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> "Manifest":
        splits = {
            split: tuple(ShardRecord(**shard) for shard in record["shards"])
            for split, record in values["splits"].items()
        }
        skipped = tuple(Skipped(**item) for item in values["skipped"])
        return cls(splits, values["rigs"], skipped, values["recipe"])

    def save(self, folder: Path) -> Path:
        path = folder / MANIFEST
        write_json(path, self.to_dict())
        return path

    @classmethod
    def load(cls, folder: Path) -> "Manifest":
        """Read the manifest of the data set in `folder`.

        Raises:
            DataSetError: it is of another version or damaged.
        """
        path = folder / MANIFEST
        values = read_json(path)
        check_version(path, values)
        try:
            return cls.from_dict(values)
        except Exception as error:  # whatever a damaged one makes of it
            raise DataSetError(f"a whole {path}", f"{error!r}", _AGAIN) from error


_AGAIN = "make the data set again in a new folder with `deeplight simulate`"


def check_version(path: Path, values: Any) -> None:
    """Refuse a file of the data set that another version of this package wrote."""
    found = values.get("version") if isinstance(values, dict) else None
    if found != VERSION:
        raise DataSetError(f"a data set of version {VERSION}", f"version {found} in {path}", _AGAIN)


def write_json(path: Path, values: Mapping[str, Any], indent: int | None = 1) -> None:
    """Write `values` whole or not at all; the same values give the same bytes."""
    with replacing(path) as temporary:
        text = json.dumps(values, indent=indent, sort_keys=True, allow_nan=False)
        temporary.write_text(text + "\n", encoding="utf-8")


def read_json(path: Path) -> Any:
    """Read a JSON file of a data set; one that is not JSON is a DataSetError."""
    try:
        return read_json_file(path)
    except ValueError as error:
        raise DataSetError(f"JSON in {path}", str(error), _AGAIN) from error


def _sum_counts(counts: Iterable[Mapping[str, int]]) -> dict[str, int]:
    total: Counter[str] = Counter()
    for count in counts:
        total.update(count)
    return dict(sorted(total.items()))
