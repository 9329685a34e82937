"""Making a data set shard by shard: what is to be made, what is missing, and the last page.

    plan = ShardPlan.begin(folder, jobs, rigs, recipe)
    for job in plan.missing():              # in one process or spread over many
        plan.write(job, examples_of(job))   # examples_of: a generator of Example and Skipped
    manifest = plan.finish()

Run again after a kill, it goes on with the shards that are missing.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from deeplight.dataset.manifest import (
    MANIFEST,
    VERSION,
    Manifest,
    ShardRecord,
    Skipped,
    check_version,
    read_json,
    write_json,
)
from deeplight.dataset.members import JPEG_QUALITY
from deeplight.dataset.shards import Item, ShardIndex, index_path, write_shard
from deeplight.dataset.splits import SPLITS
from deeplight.errors import DataSetError

PLAN = "plan.json"
SHARD_SIZE = 500


@dataclass(frozen=True)
class ShardJob:
    """One shard to make: examples `first` to `first + count - 1` of `split`."""

    split: str
    number: int
    first: int
    count: int

    @property
    def file(self) -> str:
        return f"{self.split}-{self.number:06d}.tar"


def plan_split(split: str, examples: int, shard_size: int = SHARD_SIZE) -> tuple[ShardJob, ...]:
    """Cut `examples` examples of a split into jobs of `shard_size` (the last may be smaller)."""
    if split not in SPLITS:
        raise DataSetError("a split: " + ", ".join(SPLITS), repr(split), "rename it")
    if examples < 0 or shard_size < 1:
        got = f"{examples} examples in shards of {shard_size}"
        raise DataSetError("examples >= 0 in shards of at least 1", got, "change the numbers")
    starts = range(0, examples, shard_size)
    return tuple(
        ShardJob(split, number, first, min(shard_size, examples - first))
        for number, first in enumerate(starts)
    )


@dataclass(frozen=True)
class ShardPlan:
    """The shards of one data set folder, made or still to be made.

    Attributes:
        folder: where the shards and the manifest go.
        jobs: every shard of the data set.
        rigs: `Rig.to_dict()` of each rig known beforehand, by name.
        recipe: all that decides the content (settings, seed, sources); plain JSON values.
    """

    folder: Path
    jobs: tuple[ShardJob, ...]
    rigs: Mapping[str, Mapping[str, Any]]
    recipe: Mapping[str, Any]

    @classmethod
    def begin(
        cls,
        folder: Path | str,
        jobs: Iterable[ShardJob],
        rigs: Mapping[str, Mapping[str, Any]],
        recipe: Mapping[str, Any],
        revised: bool = False,
    ) -> "ShardPlan":
        """Start a data set in `folder`, or go on with one of the very same plan.

        Call it once, before any shard is written. A `revised` plan takes the place of another
        one, which its maker has compared.

        Raises:
            DataSetError: the folder holds a data set of another plan.
        """
        plan = cls(Path(folder), tuple(jobs), rigs, recipe)
        path = plan.folder / PLAN
        # Through JSON and back, since a stored plan knows no tuples.
        values = json.loads(json.dumps(plan._to_dict(), allow_nan=False))
        if path.exists() and not revised and (old := read_json(path)) != values:
            changed = [name for name in values if old.get(name) != values[name]]
            raise DataSetError(
                f"in {plan.folder} a data set of the same plan, or nothing",
                "one with other " + ", ".join(changed),
                "choose another folder, or delete that one",
            )
        write_json(path, values)
        return plan

    @classmethod
    def open(cls, folder: Path | str) -> "ShardPlan":
        """Read the plan of the data set in `folder`.

        Raises:
            DataSetError: there is none, or it is damaged.
        """
        path = Path(folder) / PLAN
        if not path.is_file():
            raise DataSetError(f"a plan in {folder}", "none", "begin one with `deeplight simulate`")
        values = read_json(path)
        check_version(path, values)
        try:
            jobs = tuple(ShardJob(**job) for job in values["shards"])
            for job in jobs:
                if any(type(n) is not int or n < 0 for n in (job.number, job.first, job.count)):
                    raise TypeError(f"numbers in {job}")
                if not isinstance(job.split, str):
                    raise TypeError(f"a split in {job}")
            return cls(Path(folder), jobs, values["rigs"], values["recipe"])
        except Exception as error:  # whatever a damaged one makes of it
            raise DataSetError(f"a whole {path}", repr(error), "delete the folder") from error

    def missing(self) -> tuple[ShardJob, ...]:
        """Give the jobs whose shard is not finished."""
        return tuple(job for job in self.jobs if not self._is_finished(job))

    def write(
        self, job: ShardJob, items: Iterable[Item], jpeg_quality: int = JPEG_QUALITY
    ) -> ShardRecord:
        """Write the shard of `job`, whole or not at all; raises what `write_shard` does."""
        path = self.folder / job.file
        return write_shard(path, job.split, items, jpeg_quality).record

    def finish(self) -> Manifest:
        """Gather the finished shards into `manifest.json`.

        Raises:
            DataSetError: shards are missing, or one place is trained on and held out.
        """
        missing = self.missing()
        if missing:
            got = f"{len(missing)} of them missing, the first {missing[0].file}"
            raise DataSetError(f"all {len(self.jobs)} shards", got, "run it again to go on")
        indices = [ShardIndex.load(index_path(self.folder / job.file)) for job in self.jobs]
        splits: dict[str, list[ShardRecord]] = {}
        for index in indices:
            splits.setdefault(index.split, []).append(index.record)
        skipped = {(item.file, item.reason) for index in indices for item in index.skipped}
        manifest = Manifest(
            {split: tuple(records) for split, records in splits.items()},
            {**self.rigs, **{name: rig for i in indices for name, rig in i.rigs.items()}},
            tuple(Skipped(*pair) for pair in sorted(skipped)),
            self.recipe,
        )
        manifest.save(self.folder)
        return manifest

    def discard(self) -> None:
        """Remove every file of the data set, and the folder if nothing else lies in it."""
        shards = [self.folder / job.file for job in self.jobs]
        own = [self.folder / MANIFEST, self.folder / PLAN, *shards, *map(index_path, shards)]
        for path in own:
            path.unlink(missing_ok=True)
        if not any(self.folder.iterdir()):
            self.folder.rmdir()

    def _is_finished(self, job: ShardJob) -> bool:
        shard = self.folder / job.file
        index = index_path(shard)
        if not (shard.is_file() and index.is_file()):
            return False
        try:
            return shard.stat().st_size == ShardIndex.load(index).record.bytes
        except DataSetError:
            return False  # a damaged index is made again with its shard

    def _to_dict(self) -> dict[str, Any]:
        return {
            "version": VERSION,
            "shards": [asdict(job) for job in self.jobs],
            "rigs": self.rigs,
            "recipe": self.recipe,
        }
