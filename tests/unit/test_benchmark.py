"""The public benchmark is made again bit for bit."""

import json
import shutil
import subprocess
import sys
import tarfile
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

from deeplight.dataset import Manifest
from deeplight.errors import ConfigError, DataSetError
from deeplight.evaluate import benchmark
from deeplight.evaluate.benchmark import PINNED, RECIPES, Published, benchmark_data, make
from deeplight.io.radiance import write_exr
from deeplight.simulate.run import Recipe

TINY = replace(RECIPES["v1"], eval_takes=1, frames=1, shard_takes=1)


@pytest.fixture(scope="module")
def hdri(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One made-up place."""
    folder = tmp_path_factory.mktemp("hdri")
    random = np.random.default_rng(0)
    write_exr(folder / "place.exr", random.gamma(0.5, 1, (64, 128, 3)).astype(np.float32))
    (folder / "manifest.csv").write_text("file,split,place,scene\nplace.exr,val,place,indoor\n")
    return folder


def checksums(manifest: Manifest) -> dict[str, str]:
    return {r.file: r.sha256 for records in manifest.splits.values() for r in records}


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the publisher's own copy lies."""
    return tmp_path_factory.mktemp("first")


@pytest.fixture(scope="module")
def published(hdri: Path, first: Path) -> Published:
    shards = checksums(make(hdri, first, TINY, workers=1))
    return Published(
        asdict(TINY), {"place.exr": benchmark.pixels_sha256(hdri / "place.exr")}, shards
    )


@pytest.fixture(autouse=True)
def tiny(published: Published, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "published.json").write_text(published.to_json())
    monkeypatch.setitem(RECIPES, "tiny", TINY)
    monkeypatch.setattr(benchmark, "published_path", lambda name: tmp_path / "published.json")


def test_made_again_it_has_the_same_bytes(hdri: Path, published: Published, tmp_path: Path) -> None:
    data = benchmark_data("tiny", hdri, tmp_path / "again", workers=1)
    assert checksums(data.manifest) == dict(published.shards)
    assert (
        benchmark_data("tiny", None, tmp_path / "again").folder == data.folder
    )  # is there already
    other = checksums(make(hdri, tmp_path / "other", replace(TINY, seed=2), workers=1))
    assert other.keys() == published.shards.keys()
    assert other != published.shards  # the twin: another seed


def test_another_panorama_or_shard_is_reported(
    hdri: Path, first: Path, published: Published, tmp_path: Path
) -> None:
    with pytest.raises(ConfigError, match="--hdri"):
        benchmark_data("tiny", None, tmp_path / "none")
    changed = replace(published, panoramas={"place.exr": "0" * 64})
    (tmp_path / "published.json").write_text(changed.to_json())
    with pytest.raises(DataSetError, match="other pixels"):
        benchmark_data("tiny", hdri, tmp_path / "none")
    assert not (tmp_path / "none").exists()
    shutil.copytree(first, tmp_path / "made")
    shards = dict.fromkeys(published.shards, "0" * 64)
    (tmp_path / "published.json").write_text(replace(published, shards=shards).to_json())
    with pytest.raises(DataSetError, match="1 of 1 with other bytes"):
        benchmark_data("tiny", None, tmp_path / "made")
    with pytest.raises(ConfigError, match="a benchmark of"):
        benchmark_data("v0", None, tmp_path / "made")


def test_a_shard_that_was_changed_afterwards_is_reported(first: Path, tmp_path: Path) -> None:
    """A bit of the true light, which every picture and file still fits."""
    folder = tmp_path / "made"
    shutil.copytree(first, folder)
    (shard,) = folder.glob("*.tar")
    with tarfile.open(shard) as tar:
        light = next(part for part in tar if part.name.endswith("lighting.npy"))
    content = bytearray(shard.read_bytes())
    content[light.offset_data + light.size - 9] ^= 1
    shard.write_bytes(content)
    with pytest.raises(DataSetError, match=r"benchmark tiny .*other bytes.*; delete the folder"):
        benchmark_data("tiny", None, folder)
    shard.unlink()
    with pytest.raises(DataSetError, match=r"no such file.*; delete the folder"):
        benchmark_data("tiny", None, folder)


ONE_SHARD = """
import sys
from pathlib import Path
from deeplight.evaluate.benchmark import RECIPES
from deeplight.simulate.run import plan
shards, simulation = plan(Path(sys.argv[1]), Path(sys.argv[2]), RECIPES["v1"])
job = next(job for job in shards.jobs if job.file == sys.argv[3])
print(shards.write(job, simulation.examples(job)).sha256)
"""


def test_a_shard_of_v1_is_the_published_one(shared: Path, root: Path, tmp_path: Path) -> None:
    """Changed on purpose it needs a new recipe: see lab/evidence/publish_benchmark.py."""
    stored = root / "src" / "deeplight" / "evaluate" / "benchmark_v1.json"
    v1 = Published(**json.loads(stored.read_text()))
    assert Recipe(**v1.recipe) == RECIPES["v1"]
    file = min(v1.shards)
    words = [sys.executable, "-c", ONE_SHARD, str(shared / "hdri"), str(tmp_path / "v1"), file]
    done = subprocess.run(
        words, env={**PINNED, "PATH": ""}, capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == v1.shards[file]
