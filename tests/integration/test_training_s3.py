"""`deeplight train` and `deeplight evaluate` read a data set in a bucket, given by the environment.

Real commands against moto's stand-in for S3. It is large, so CI does without; to run it:
`pip install s3fs "moto[server,s3]"`.
"""

import csv
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import fsspec
import pytest
from moto import server as moto

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600), pytest.mark.needs("torch", "s3fs")]

SECRET = "not-to-be-written-anywhere"
SETTINGS = (
    "schedule.batch_size=2",
    "schedule.steps=3",
    "network.width=0.35",
    "data.workers=2",
    "data.preload_gib=0",  # each worker opens, and so copies, the shards by itself
    "run.log_every=1",
    "run.constant_steps=2",
    "run.accelerator=cpu",
)


@pytest.fixture(scope="module")
def folder(toy: Path) -> Path:
    return toy


@pytest.fixture(scope="module")
def service(folder: Path) -> Iterator[dict[str, str]]:
    """The environment that names a service with the data set in s3://bucket/sim."""
    server = moto.ThreadedMotoServer("127.0.0.1", 0, verbose=False)
    server.start()
    endpoint = "http://{}:{}".format(*server.get_host_and_port())
    options = {"endpoint_url": endpoint, "key": "tester", "secret": SECRET}
    bucket = fsspec.filesystem("s3", **options)
    bucket.mkdir("bucket")
    for path in folder.iterdir():
        bucket.pipe_file(f"bucket/sim/{path.name}", path.read_bytes())
    yield {
        "AWS_ENDPOINT_URL": endpoint,
        "AWS_ACCESS_KEY_ID": "tester",
        "AWS_SECRET_ACCESS_KEY": SECRET,
    }
    server.stop()


def deeplight(
    environment: dict[str, str], copies: Path, *words: str
) -> subprocess.CompletedProcess[str]:
    """Run a command that knows of this machine's credentials only from `environment`."""
    own = {name: value for name, value in os.environ.items() if not name.startswith("AWS_")}
    none = {
        "AWS_SHARED_CREDENTIALS_FILE": os.devnull,
        "AWS_CONFIG_FILE": os.devnull,
        "AWS_EC2_METADATA_DISABLED": "true",
    }
    return subprocess.run(
        [sys.executable, "-m", "deeplight", *words],
        env={**own, **none, "DEEPLIGHT_CACHE": str(copies), **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def losses(run: Path) -> list[str]:
    with (run / "losses.csv").open() as file:
        return [row["loss"] for row in csv.DictReader(file)]


def test_a_run_from_a_bucket_is_the_run_from_the_folder(
    folder: Path, service: dict[str, str], tmp_path: Path
) -> None:
    changes = [word for setting in SETTINGS for word in ("--set", setting)]
    for data, name in ((str(folder), "near"), ("s3://bucket/sim", "far")):
        words = ("train", "--data", data, "--out", str(tmp_path / name), "--preset", "small")
        done = deeplight(service, tmp_path / "copies", *words, *changes)
        assert done.returncode == 0, done.stderr
    assert losses(tmp_path / "far") == losses(tmp_path / "near")
    assert len(losses(tmp_path / "far")) == 3
    assert 'data = "s3://bucket/sim"' in (tmp_path / "far" / "run.toml").read_text()
    written = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert any(path.suffix == ".tar" for path in written)  # the copies
    assert not [path for path in written if SECRET.encode() in path.read_bytes()]


def test_evaluation_reads_a_bucket(folder: Path, service: dict[str, str], tmp_path: Path) -> None:
    tables = []
    for data in (str(folder), "s3://bucket/sim"):
        words = ("evaluate", "--data", data, "--split", "val", "--examples", "2")
        done = deeplight(service, tmp_path / "copies", *words)
        assert done.returncode == 0, done.stderr
        tables.append(done.stdout)
    assert tables[0] == tables[1]


@pytest.mark.parametrize(
    ("without", "address", "message"),
    [
        (False, "s3://bucket/nothing", "nothing/manifest.json"),
        (False, "s3://no-bucket/sim", "no-bucket"),
        (True, "s3://bucket/sim", "credentials"),
    ],
)
def test_what_cannot_be_read_is_one_line(
    service: dict[str, str], tmp_path: Path, without: bool, address: str, message: str
) -> None:
    known = {"AWS_ENDPOINT_URL": service["AWS_ENDPOINT_URL"]} if without else service
    words = ("train", "--data", address, "--out", str(tmp_path / "run"))
    done = deeplight(known, tmp_path / "copies", *words)
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert message in line
    assert SECRET not in line
    assert not (tmp_path / "run").exists()
