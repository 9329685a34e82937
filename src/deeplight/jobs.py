"""Run independent jobs: in processes of this machine, or on a Ray cluster, with the same results.

A job is a value that can be pickled, and the work a function of one job defined in a module. What
the work writes goes to a folder that every machine sees; what it returns comes back here.
"""

import logging
import multiprocessing
import os
import signal
import socket
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import wait as wait_for_end
from typing import Any, Generic, Literal, TypeVar

from deeplight.errors import ConfigError, InputError, MissingExtraError

Job = TypeVar("Job")
Result = TypeVar("Result")

_GONE_S = 1.0
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
_QUIET = {"RAY_USAGE_STATS_ENABLED": "0", "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0"}


@dataclass(frozen=True)
class Engine:
    """Where jobs run.

    Attributes:
        kind: "local" is processes of this machine, "ray" a cluster.
        workers: jobs at once; 0 is one per core (of the cluster); 1 locally is this process.
        ray_address: of an existing cluster, "auto" for the one this machine belongs to; left out,
            Ray starts on this machine and stops afterwards.
    """

    kind: Literal["local", "ray"] = "local"
    workers: int = 0
    ray_address: str | None = None

    def __post_init__(self) -> None:
        if self.workers < 0:
            raise ConfigError("at least 0 workers", f"{self.workers}", "correct it")
        if self.ray_address and self.kind != "ray":
            got = f"the address {self.ray_address} and engine {self.kind}"
            raise ConfigError("an address only with --engine ray", got, "add --engine ray")


@dataclass(frozen=True)
class Done(Generic[Job, Result]):
    """A finished job: its result, or the bad input that stopped it."""

    job: Job
    result: Result | None = None
    error: InputError | None = None


LOCAL = Engine()


def _nothing() -> None:
    pass


def run(
    jobs: Sequence[Job], work: Callable[[Job], Result], engine: Engine = LOCAL
) -> Iterator[Done[Job, Result]]:
    """Give each job when it is done, in whatever order that is.

    An `InputError` of a job is part of the answer; every other exception is raised here and ends
    the rest, as does a KeyboardInterrupt: jobs that have not begun never do.

    Raises:
        ConfigError: the Ray cluster cannot be reached.
        MissingExtraError: Ray is not installed.
    """
    if not jobs:
        return
    if engine.kind == "ray":
        yield from _on_ray(jobs, work, engine)
        return
    workers = min(engine.workers or os.cpu_count() or 1, len(jobs))
    if workers == 1:
        yield from (_attempt(work, job) for job in jobs)
    else:
        yield from _in_processes(jobs, work, workers)


def _attempt(work: Callable[[Job], Result], job: Job) -> Done[Job, Result]:
    try:
        return Done(job, work(job))
    except InputError as error:
        return Done(job, error=error)


def _in_processes(
    jobs: Sequence[Job], work: Callable[[Job], Result], workers: int
) -> Iterator[Done[Job, Result]]:
    with processes(workers, _one_thread_each) as pool:
        running = {pool.submit(_attempt, work, job) for job in jobs}
        while running:
            done, running = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                yield future.result()


@contextmanager
def processes(
    workers: int, prepare: Callable[[], None] = _nothing
) -> Iterator[ProcessPoolExecutor]:
    """Give a pool of processes that never outlives the `with` block, nor this process.

    When the block ends by an exception (an interrupt, a generator that is closed), the processes
    are ended in the middle of their jobs: what they wrote whole stays. When this process dies,
    they follow it.
    """
    # Spawned, not forked: the parent may hold threads of numerical libraries.
    with ProcessPoolExecutor(workers, get_context("spawn"), begin_worker, (prepare,)) as pool:
        try:
            yield pool
        except BaseException:
            children = list((pool._processes or {}).values())
            pool.shutdown(wait=False, cancel_futures=True)
            for child in children:
                child.terminate()
            for child in children:  # whoever cleans up after them must find them gone
                child.join(_GONE_S)
            raise


def begin_worker(prepare: Callable[[], None] = _nothing) -> None:
    """Prepare a child process of `multiprocessing`: it ends with its parent, not by Ctrl-C.

    A terminal's Ctrl-C reaches the children too; their parent ends them.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is not None:
        watch = threading.Thread(target=_follow, args=(parent.sentinel,), daemon=True)
        watch.start()
    prepare()


def _follow(sentinel: int) -> None:
    wait_for_end([sentinel])
    os._exit(1)


def _one_thread_each() -> None:
    # Too late for a library that is loaded already; the pool's children load theirs after it.
    for name in _THREADS:
        os.environ[name] = "1"


def _on_ray(
    jobs: Sequence[Job], work: Callable[[Job], Result], engine: Engine
) -> Iterator[Done[Job, Result]]:
    with _ray(engine) as ray:
        attempt = ray.remote(num_cpus=1, max_retries=3)(_attempt)
        most = min(engine.workers or int(ray.cluster_resources().get("CPU", 1)), len(jobs))
        waiting = list(reversed(jobs))
        running: list[Any] = []
        try:
            while running or waiting:
                while waiting and len(running) < most:
                    running.append(attempt.remote(work, waiting.pop()))
                done, running = ray.wait(running, num_returns=1)
                for reference in done:
                    yield _fetched(ray, reference)
        except BaseException:
            for reference in running:
                ray.cancel(reference, force=True)
            raise


def _fetched(ray: Any, reference: Any) -> Any:
    try:
        return ray.get(reference)
    except ray.exceptions.RayTaskError as error:
        raise error.cause from None  # the job's own exception, as a local run raises it


@contextmanager
def _ray(engine: Engine) -> Iterator[Any]:
    """Ray, connected; what was started here is stopped again."""
    for name, value in _QUIET.items():
        os.environ.setdefault(name, value)
    try:
        import ray
    except ImportError as error:
        raise MissingExtraError("cluster", "--engine ray") from error
    started = not ray.is_initialized()
    if started:
        _reach(engine.ray_address)
        settings: dict[str, Any] = {"address": engine.ray_address}
        if engine.ray_address is None:
            settings = {"num_cpus": engine.workers or None, "include_dashboard": False}
            settings["address"] = "local"
        threads = {"env_vars": dict.fromkeys(_THREADS, "1")}
        try:
            ray.init(
                **settings, log_to_driver=False, logging_level=logging.ERROR, runtime_env=threads
            )
        except (ConnectionError, RuntimeError, ValueError) as error:
            raise _unreachable(engine.ray_address, error) from error
    try:
        yield ray
    finally:
        if started:
            ray.shutdown()


def _reach(address: str | None) -> None:
    """Knock at the door first: Ray itself would wait two minutes for an answer."""
    host, colon, port = (address or "").removeprefix("ray://").rpartition(":")
    if not colon:
        return
    try:
        socket.create_connection((host, int(port)), timeout=5).close()
    except (OSError, ValueError, OverflowError) as error:
        raise _unreachable(address, error) from error


def _unreachable(address: str | None, error: Exception) -> ConfigError:
    first = str(error).partition("\n")[0] or type(error).__name__
    do = "start one with `ray start --head`, or leave the address out"
    return ConfigError(f"a Ray cluster at {address}", first, do)
