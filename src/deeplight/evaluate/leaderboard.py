"""A leaderboard file: what was measured on one data set, by whom it can be measured again.

JSON, an entry for every model (by the hash of its file) on every split. Evaluating a model that has
an entry verifies it: the same data and the same model must give the same numbers.
"""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from deeplight.dataset import DataSet
from deeplight.errors import DataSetError
from deeplight.evaluate.bootstrap import Interval
from deeplight.evaluate.models import NamedModel
from deeplight.evaluate.result import SplitResult
from deeplight.io.atomic import replacing
from deeplight.io.boundary import reads_as
from deeplight.io.json_text import read_json

FORMAT, VERSION = "deeplight-leaderboard", 1
METRICS = (
    "l1_diffuse",
    "l1_matte_silver",
    "l1_mirror",
    "theta_rgb_deg",
    "energy_stops_absolute",
    "direction_deg",
)
TOLERANCE = 0.005
"""Relative: what another processor's last bits may change."""


@dataclass(frozen=True)
class Entry:
    """One model on one split.

    Attributes:
        data_sha256: of the data set's manifest, which holds every shard's checksum.
        bases: hash of the reflectance bases, or "analytic".
        model_sha256: of the model's file.
        examples, places: what it was measured on.
        numbers: mean, low and high end of the 95 % interval over places (None for one place), by
            metric, indoor and outdoor together.
        deeplight: version of this package that measured it.
    """

    data_sha256: str
    bases: str
    split: str
    name: str
    model_sha256: str
    examples: int
    places: int
    numbers: dict[str, list[float | None]]
    deeplight: str

    @property
    def measured(self) -> tuple[str, str, str, str, int]:
        """What was measured: two entries that agree in it must agree in their numbers."""
        return self.data_sha256, self.bases, self.split, self.model_sha256, self.examples


def update_leaderboard(
    path: Path, results: Sequence[SplitResult], data: DataSet, models: Sequence[NamedModel]
) -> tuple[list[Entry], list[Entry]]:
    """Verify the entries that were measured again and append the others; give both.

    Raises:
        DataSetError, OSError: as `update_entries` does.
    """
    return update_entries(path, _entries(results, data, models))


def update_entries(path: Path, entries: Sequence[Entry]) -> tuple[list[Entry], list[Entry]]:
    """Verify those of `entries` that the file has and append the others; give both.

    Raises:
        DataSetError: the file is no leaderboard, or an entry does not come out again; then the
            file is left as it was.
        OSError: it cannot be read or written.
    """
    known = read_leaderboard(path) if path.exists() else []
    by_key = {entry.measured: entry for entry in known}
    verified, added = [], []
    for entry in entries:
        old = by_key.get(entry.measured)
        if old is None:
            added.append(entry)
            continue
        _check(path, old, entry)
        verified.append(old)
    if added:
        values = {
            "format": FORMAT,
            "version": VERSION,
            "entries": [asdict(entry) for entry in [*known, *added]],
        }
        with replacing(path) as temporary:
            text = json.dumps(values, indent=1, allow_nan=False)
            temporary.write_text(text + "\n", encoding="utf-8")
    return verified, added


@reads_as(DataSetError)
def read_leaderboard(path: Path) -> list[Entry]:
    """Read the entries of a leaderboard.

    Raises:
        DataSetError: it is another file, or damaged.
        OSError: it cannot be read.
    """
    try:
        values: Any = read_json(path)
        if values["format"] != FORMAT or values["version"] != VERSION:
            raise ValueError("another format or version")
        return [Entry(**entry) for entry in values["entries"]]
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise DataSetError(f"a leaderboard in {path}", f"{error!r}"[:120], "name another") from None


def _entries(
    results: Sequence[SplitResult], data: DataSet, models: Sequence[NamedModel]
) -> list[Entry]:
    return [
        Entry(
            data.manifest_sha256,
            data.bases_sha256,
            result.report.split,
            model.name,
            model.facts["sha256"],
            len(result.report.keys),
            len(set(result.report.places)),
            _numbers(result, model.name),
            version("deeplight"),
        )
        for result in results
        for model in models
    ]


def _numbers(result: SplitResult, name: str) -> dict[str, list[float | None]]:
    found = {metric: result.find(name, "both", metric) for metric in METRICS}
    return {
        metric: numbers_of(summary.mean) for metric, summary in found.items() if summary is not None
    }


def numbers_of(mean: Interval) -> list[float | None]:
    """A mean as `Entry.numbers` has it."""
    values = (mean.value, mean.low, mean.high)
    return [float(value) if np.isfinite(value) else None for value in values]


def _check(path: Path, old: Entry, new: Entry) -> None:
    for metric in sorted(old.numbers.keys() | new.numbers.keys()):
        then, now = (entry.numbers.get(metric, [None])[0] for entry in (old, new))
        same = then is None and now is None
        if then is not None and now is not None:
            same = abs(then - now) <= TOLERANCE * max(abs(then), abs(now)) + 1e-6
        if not same:
            got = f"{metric} {now} where {path.name} says {then} of {old.name} on {old.split}"
            do = "the entry was changed, or another version of deeplight measured it"
            raise DataSetError("the same numbers from the same model and data", got, do)
