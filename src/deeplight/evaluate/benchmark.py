"""The public benchmark: fixed recipes of simulated cases that anyone makes again bit for bit.

A recipe, the panoramas it films and the checksum of every shard are published in
`benchmark_<name>.json` next to this file. Whoever has the same panoramas makes the same shards, in
a process where numpy and OpenBLAS are held to the instructions of `PINNED`: sums come out
otherwise in the last bit with others. docs/evaluate.md says what else matters.
"""

import hashlib
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from deeplight.dataset import DataSet, Manifest, open_dataset
from deeplight.dataset.manifest import MANIFEST
from deeplight.errors import ConfigError, DataSetError
from deeplight.io.radiance import read_hdr
from deeplight.jobs import Engine, processes
from deeplight.simulate.run import Recipe, plan, simulate

RECIPES = {
    # Validation and test places only: every one is filmed in 4 takes of 4 frames, a shard each.
    "v1": Recipe(train_takes=0, eval_takes=4, seen_takes=0, frames=4, shard_takes=4, seed=1),
    # The same places, each take filmed with another phone, half of the test takes with new ones.
    "v2": Recipe(
        train_takes=0, eval_takes=4, seen_takes=0, frames=4, shard_takes=4, seed=2, phones="v2"
    ),
}
PINNED = {
    "OPENBLAS_CORETYPE": "Haswell",
    "NPY_DISABLE_CPU_FEATURES": "X86_V4,AVX512_ICL,AVX512_SPR",
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
}
"""Environment of the process that films: AVX2, as every x86-64 since 2013 has it."""


@dataclass(frozen=True)
class Published:
    """The checksums of a benchmark.

    Attributes:
        recipe: as `Recipe`'s fields.
        panoramas: SHA-256 of the pixels of each panorama, by file name.
        shards: SHA-256 of each shard, by file name.
    """

    recipe: Mapping[str, Any]
    panoramas: Mapping[str, str]
    shards: Mapping[str, str]

    @classmethod
    def load(cls, name: str) -> "Published":
        """Read the published checksums of a benchmark.

        Raises:
            ConfigError: there is no benchmark of that name.
        """
        path = published_path(name)
        if name not in RECIPES or not path.is_file():
            raise ConfigError(f"a benchmark of {', '.join(RECIPES)}", name, "choose one of these")
        return cls(**json.loads(path.read_text(encoding="utf-8")))

    def to_json(self) -> str:
        return json.dumps(asdict(self), indent=1, sort_keys=True) + "\n"


def published_path(name: str) -> Path:
    return Path(__file__).with_name(f"benchmark_{name}.json")


def benchmark_data(name: str, hdri: Path | None, folder: Path, workers: int = 0) -> DataSet:
    """Give a benchmark's data set in `folder`, made there if it is not yet, and checked.

    Args:
        hdri: folder of the panoramas; not needed once the data set is made.
        workers: processes; 0 is one per core.

    Raises:
        ConfigError: no such benchmark, or no panoramas to make it from.
        DataSetError: panoramas are missing or others, or a shard has not the published bytes.
    """
    published = Published.load(name)
    if not (folder / MANIFEST).is_file():
        if hdri is None:
            raise ConfigError("--hdri, the folder of the benchmark's panoramas", "none", "give it")
        check_panoramas(hdri, published)
        make(hdri, folder, RECIPES[name], workers)
    differ = differing_shards(Manifest.load(folder), published)
    if differ:
        got = f"{len(differ)} of {len(published.shards)} with other bytes, the first {differ[0]}"
        do = "docs/evaluate.md says what can change them"
        raise DataSetError(f"the shards of benchmark {name} as published", got, do)
    return _verified(name, folder)


def _verified(name: str, folder: Path) -> DataSet:
    """The data set, once each shard has the bytes that its manifest says."""
    try:
        data = open_dataset(folder)
        data.verify()
    except DataSetError as error:
        expected = f"the shards of benchmark {name} in {folder}: {error.expected}"
        raise DataSetError(expected, error.got, "delete the folder: it is made again") from None
    return data


def make(hdri: Path, folder: Path, recipe: Recipe, workers: int = 0) -> Manifest:
    """Film a recipe in a process of its own, in the environment `PINNED`."""
    with pinned(), processes(1) as pool:
        return pool.submit(_film, hdri, folder, recipe, workers).result()


def _film(hdri: Path, folder: Path, recipe: Recipe, workers: int) -> Manifest:
    return simulate(*plan(hdri, folder, recipe), Engine(workers=workers))


@contextmanager
def pinned() -> Iterator[None]:
    """`PINNED` for the processes that start inside; it is read when numpy is loaded there."""
    before = {name: os.environ.get(name) for name in PINNED}
    os.environ.update(PINNED)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name)
            if value is not None:
                os.environ[name] = value


def differing_shards(manifest: Manifest, published: Published) -> list[str]:
    """The shards that are not byte for byte the published ones; missing and further ones too."""
    own = {r.file: r.sha256 for records in manifest.splits.values() for r in records}
    everything = sorted(own.keys() | published.shards.keys())
    return [file for file in everything if own.get(file) != published.shards.get(file)]


def check_panoramas(hdri: Path, published: Published) -> None:
    """Compare a folder's panoramas with those of the benchmark, by their pixels.

    Raises:
        DataSetError: one is missing or has other pixels.
    """
    for file, wanted in published.panoramas.items():
        path = hdri / file
        found = pixels_sha256(path) if path.is_file() else "no such file"
        if found != wanted:
            got = found if not path.is_file() else "one with other pixels"
            raise DataSetError(f"the benchmark's panorama {path}", got, "get the same file")


def pixels_sha256(path: Path) -> str:
    """SHA-256 of a panorama's size and float32 pixels: the same whatever its compression."""
    radiance = np.ascontiguousarray(read_hdr(path), dtype="<f4")
    digest = hashlib.sha256(repr(radiance.shape).encode())
    digest.update(radiance.tobytes())
    return digest.hexdigest()
