"""The engine: every job once, faults where they belong, the same results wherever it runs."""

import os
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from deeplight.errors import ConfigError
from deeplight.io.atomic import only_run
from deeplight.jobs import Engine, run
from fake_ray import FakeRay
from jobs import Sum, add_up, fail_next_to_a_writer, threads_allowed


def outcome(jobs: list[Sum], engine: Engine) -> dict[int, int | str | None]:
    return {
        done.job.number: str(done.error) if done.error else done.result
        for done in run(jobs, add_up, engine)
    }


def assert_same_everywhere(folder: Path, *engines: Engine) -> None:
    """What the jobs return and what they write, the bad input of one of them included."""
    results = []
    for number, engine in enumerate(engines):
        here = folder / str(number)
        here.mkdir()
        found = outcome([Sum(n, here) for n in range(6)], engine)
        results.append((found, {p.name: p.read_bytes() for p in here.iterdir()}))
    assert all(result == results[0] for result in results)
    assert results[0][0][5] == 10
    assert "choose one" in str(results[0][0][3])
    assert len(results[0][1]) == 5


def test_processes_give_what_one_process_gives(tmp_path: Path) -> None:
    assert_same_everywhere(tmp_path, Engine(workers=1), Engine(workers=2))


@pytest.fixture
def fake_ray(monkeypatch: pytest.MonkeyPatch) -> FakeRay:
    fake = FakeRay()
    monkeypatch.setitem(sys.modules, "ray", fake)
    return fake


def test_what_ray_is_asked_for_gives_what_one_process_gives(
    tmp_path: Path, fake_ray: FakeRay
) -> None:
    assert_same_everywhere(tmp_path, Engine(workers=1), Engine("ray", 3))
    assert fake_ray.most == 3
    with pytest.raises(ZeroDivisionError):
        list(run([Sum(99, tmp_path)], add_up, Engine("ray", 2)))
    assert not fake_ray.running


def test_an_interrupt_stops_what_ray_runs(tmp_path: Path, fake_ray: FakeRay) -> None:
    results = run([Sum(n, tmp_path) for n in range(6)], add_up, Engine("ray"))
    next(results)
    with pytest.raises(KeyboardInterrupt):
        results.throw(KeyboardInterrupt)  # type: ignore[attr-defined]
    assert len(fake_ray.cancelled) == 1
    assert len(list(tmp_path.iterdir())) == 1
    assert not fake_ray.running


@pytest.mark.slow
def test_a_real_cluster_gives_what_one_process_gives(tmp_path: Path, two_nodes: str) -> None:
    assert_same_everywhere(tmp_path, Engine(workers=1), Engine("ray", 2, two_nodes))
    with pytest.raises(ZeroDivisionError):
        list(run([Sum(99, tmp_path)], add_up, Engine("ray", 2, two_nodes)))


def test_a_bug_in_a_job_is_raised(tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError):
        list(run([Sum(99, tmp_path), Sum(1, tmp_path)], add_up, Engine(workers=1)))


def test_an_interrupt_begins_no_further_job(tmp_path: Path) -> None:
    results = run([Sum(n, tmp_path) for n in range(3)], add_up, Engine(workers=1))
    next(results)
    assert isinstance(results, Iterator)
    with pytest.raises(KeyboardInterrupt):
        results.throw(KeyboardInterrupt)  # type: ignore[attr-defined]
    assert [path.name for path in tmp_path.iterdir()] == ["0.txt"]


@pytest.mark.skipif(sys.platform == "win32", reason="needs process ids that can be asked")
def test_what_ended_workers_were_writing_is_removed_at_once(tmp_path: Path) -> None:
    jobs = [Sum(0, tmp_path), Sum(1, tmp_path)]
    with pytest.raises(OSError, match="full"), only_run(tmp_path):
        list(run(jobs, fail_next_to_a_writer, Engine(workers=2)))
    assert [path.name for path in tmp_path.rglob("*")] == ["deep"]


def test_a_process_has_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    found = [done.result for done in run([1, 2], threads_allowed, Engine(workers=2))]
    assert found == ["1", "1"]


def test_impossible_engines_are_refused() -> None:
    with pytest.raises(ConfigError, match="workers"):
        Engine(workers=-1)
    with pytest.raises(ConfigError, match="--engine ray"):
        Engine("local", 1, "auto")


def test_a_cluster_that_is_not_there_is_one_line() -> None:
    pytest.importorskip("ray")
    with pytest.raises(ConfigError, match="Ray cluster") as caught:
        list(run([1], threads_allowed, Engine("ray", 1, "127.0.0.1:9")))
    assert "\n" not in str(caught.value)


@pytest.fixture(scope="module")
def two_nodes() -> Iterator[str]:
    """The address of a cluster of two nodes of one worker each, on this machine."""
    pytest.importorskip("ray")
    from ray.cluster_utils import Cluster

    here = str(Path(__file__).parents[1])  # workers must find `jobs`
    before = os.environ.get("PYTHONPATH", "")
    os.environ["PYTHONPATH"] = os.pathsep.join([here, before])
    cluster = Cluster()
    for _ in range(2):
        cluster.add_node(num_cpus=1, object_store_memory=80 * 2**20, include_dashboard=False)
    yield cluster.address
    cluster.shutdown()
    os.environ["PYTHONPATH"] = before
