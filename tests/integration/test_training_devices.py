"""Two processes learn what one learns; data sets are read from an address."""

import csv
import functools
import http.server
import multiprocessing
import os
import socket
import subprocess
import sys
import threading
from pathlib import Path

import fsspec
import numpy as np
import pytest
import torch

from deeplight.dataset import open_dataset
from deeplight.dataset.remote import CACHE
from deeplight.errors import DataSetError
from deeplight.training import checkpoint
from deeplight.training.augment import AugmentConfig, Inputs, augment
from deeplight.training.data import Order, StepIndices
from deeplight.training.devices import over_all_devices
from deeplight.training.share import Share

SETTINGS = (
    "schedule.batch_size=4",
    "schedule.steps=4",
    "network.width=0.35",
    "network.latent_dropout=0.2",
    "network.encoder_norm=batch",
    "optimiser.ema_decay=0.9",
    "optimiser.max_gradient_norm=1.0",
    "augment.cutout=0.3",
    "augment.noise=0.01",
    "augment.channel_shuffle=0.5",
    "augment.exposure_stops=0.1",
    "adversarial.learning_rate_factor=1.0",
    "data.workers=0",
    "run.validate_every=4",
    "run.checkpoint_every=2",
    "run.log_every=1",
    "run.constant_steps=2",
    "run.accelerator=cpu",
)


@pytest.fixture(scope="module")
def data(toy) -> Path:
    return toy


def deeplight_train(data: Path | str, out: Path, *words: str, seconds: float = 110):
    settings = [word for setting in SETTINGS for word in ("--set", setting)]
    command = [sys.executable, "-m", "deeplight", "train", "--data", str(data), "--out", str(out)]
    free = socket.socket()
    free.bind(("127.0.0.1", 0))
    port = str(free.getsockname()[1])
    free.close()
    return subprocess.run(
        [*command, "--preset", "paper", *settings, *words],
        env={**os.environ, "MASTER_PORT": port, "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        timeout=seconds,
        check=False,
    )


def losses(folder: Path) -> np.ndarray:
    with (folder / "losses.csv").open() as file:
        rows = list(csv.DictReader(file))
    names = [name for name in rows[0] if name != "images_per_second"]
    return np.array([[float(row[name]) for name in names] for row in rows])


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_two_processes_learn_what_one_learns_and_either_resumes_the_other(data, tmp_path):
    one, two, mixed = (tmp_path / name for name in ("one", "two", "mixed"))
    for folder, words in ((one, ()), (two, ("--devices", "2"))):
        done = deeplight_train(data, folder, *words)
        assert done.returncode == 0, done.stderr
    expected = losses(one)
    np.testing.assert_allclose(losses(two), expected, rtol=2e-3, atol=1e-5)
    assert len(losses(two)) == 4
    assert "devices = 2" in (two / "run.toml").read_text()

    # Two processes up to step 2, one from there on.
    (mixed / "checkpoints").mkdir(parents=True)
    half = checkpoint.checkpoint_path(two, 2)
    (mixed / "checkpoints" / half.name).write_bytes(half.read_bytes())
    (mixed / "losses.csv").write_bytes((two / "losses.csv").read_bytes())
    done = deeplight_train(data, mixed)
    assert done.returncode == 0, done.stderr
    np.testing.assert_allclose(losses(mixed), expected, rtol=2e-3, atol=1e-5)

    other = tmp_path / "other"  # the twin that must differ
    deeplight_train(data, other, "--set", "run.seed=1")
    assert not np.allclose(losses(other), expected, rtol=2e-3, atol=1e-5)


def test_devices_divide_every_batch_without_overlap():
    order = Order(50, seed=1)
    whole = list(StepIndices(order, 8, 0, 20))
    parts = [list(StepIndices(order, 8, 0, 20, Share(rank, 2))) for rank in range(2)]
    assert [a + b for a, b in zip(*parts, strict=True)] == whole


def test_devices_draw_for_the_whole_batch():
    """What two processes augment is what one augments, row by row."""
    random = torch.Generator().manual_seed(0)
    photo = torch.rand(6, 12, 10, 3, generator=random).permute(0, 3, 1, 2) - 0.5
    whole = Inputs(photo, torch.rand(6, 3, 3, 16), torch.zeros(6).long(), torch.zeros(6).bool())
    config = AugmentConfig(True, 0.5, 0.02, 0.5, 0.1, 0.5)
    torch.manual_seed(3)
    expected = augment(whole, config)
    for rank in range(2):
        share = Share(rank, 2)
        own = Inputs(*(share.own(part) for part in vars(whole).values()))
        torch.manual_seed(3)
        found = augment(own, config, share)
        for left, right in zip(vars(found).values(), vars(expected).values(), strict=True):
            torch.testing.assert_close(left, share.own(right))


def network():
    torch.manual_seed(0)
    layers = (torch.nn.Linear(5, 4), torch.nn.BatchNorm1d(4), torch.nn.Dropout(0.3))
    return torch.nn.Sequential(*layers, torch.nn.Linear(4, 2))


def one_step(rank: int, ranks: int, port: int, out: Path) -> None:
    """Gradient and running statistics of a network on this process's rows, saved by the first."""
    address = f"tcp://127.0.0.1:{port}"
    torch.distributed.init_process_group("gloo", address, rank=rank, world_size=ranks)
    share = Share(rank, ranks)
    module = over_all_devices(network(), share)
    rows = share.own(torch.randn(8, 5, generator=torch.Generator().manual_seed(1)) * 3 + 1)
    torch.manual_seed(2)
    module(rows).square().mean().backward()
    for parameter in module.parameters():
        torch.distributed.all_reduce(parameter.grad)
        parameter.grad /= ranks
    if rank == 0:
        gradients = {f"grad {k}": p.grad for k, p in module.named_parameters()}
        torch.save({**module.state_dict(), **gradients}, out)
    torch.distributed.destroy_process_group()


def test_batch_norm_and_dropout_see_the_whole_batch(tmp_path):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    out = tmp_path / "state.pt"
    context = multiprocessing.get_context("fork")
    others = [context.Process(target=one_step, args=(rank, 2, port, out)) for rank in range(2)]
    for process in others:
        process.start()
    for process in others:
        process.join()
        assert process.exitcode == 0
    module = network()
    rows = torch.randn(8, 5, generator=torch.Generator().manual_seed(1)) * 3 + 1
    torch.manual_seed(2)
    module(rows).square().mean().backward()
    found = torch.load(out, weights_only=True)
    for name, value in module.state_dict().items():
        torch.testing.assert_close(found[name], value)
    for name, parameter in module.named_parameters():
        torch.testing.assert_close(found[f"grad {name}"], parameter.grad)
    module.zero_grad()
    module(rows[:4]).square().mean().backward()  # the twin: half of the batch alone
    assert not torch.allclose(found["grad 0.weight"], module[0].weight.grad)


@pytest.fixture
def copies(tmp_path, monkeypatch) -> Path:
    monkeypatch.setenv(CACHE, str(tmp_path / "copies"))
    return tmp_path / "copies"


def pixels_of_all(data_set, split="train"):
    index = data_set.index(split)
    return [index.pixels(number) for number in range(len(index))]


def assert_same(found, expected):
    for (photo, spheres), (other, others) in zip(found, expected, strict=True):
        assert np.array_equal(photo, other)
        assert np.array_equal(spheres, others)


def test_a_data_set_is_read_from_an_address(data, copies):
    memory = fsspec.filesystem("memory")
    for path in data.iterdir():
        memory.pipe_file(f"/toy/{path.name}", path.read_bytes())
    far, near = open_dataset("memory://toy/"), open_dataset(data)
    assert far.manifest_sha256 == near.manifest_sha256
    assert list(copies.rglob("*.tar")) == []  # nothing yet but the manifest
    assert_same(pixels_of_all(far), pixels_of_all(near))
    kept = {path.name for path in copies.rglob("*.tar")}
    assert kept == {path.name for path in data.glob("train*.tar")}  # only what was read
    memory.rm("/toy/train-000000.tar")
    assert_same(pixels_of_all(open_dataset("memory://toy")), pixels_of_all(near))  # from the copy
    memory.pipe_file("/toy/val_indoor-000000.tar", b"damaged")
    with pytest.raises(DataSetError, match="checksum"):
        far.verify()
    memory.rm("/toy", recursive=True)


def test_a_data_set_is_read_over_http(data, copies):
    pytest.importorskip("aiohttp")
    handler = functools.partial(Quiet, directory=str(data))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}"
        assert_same(pixels_of_all(open_dataset(address)), pixels_of_all(open_dataset(data)))
        with pytest.raises(DataSetError, match="nowhere"):
            open_dataset(f"{address}/nowhere")
        server.shutdown()


@pytest.mark.parametrize("address", ["memory://nothing", "carrier-pigeon://here"])
def test_an_address_without_a_data_set_is_reported(copies, address):
    with pytest.raises(DataSetError, match=r"manifest\.json"):
        open_dataset(address)
    assert not copies.exists()


class Quiet(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *args):
        pass
