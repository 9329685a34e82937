"""A stand-in for the package `ray`: a cluster of this process, its tasks copies as Ray's are."""

import pickle
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any


class RayTaskError(Exception):
    """What `get` raises for a task that failed; `cause` is the task's own exception."""

    def __init__(self, cause: BaseException) -> None:
        self.cause = cause


class FakeRay:
    """What `deeplight.jobs` asks of Ray. Tasks run when they are fetched, the last one first.

    Attributes:
        most: tasks that waited at once.
        cancelled: tasks that were stopped.
    """

    exceptions = SimpleNamespace(RayTaskError=RayTaskError)

    def __init__(self) -> None:
        self.running, self.most = False, 0
        self.waiting: list[bytes] = []
        self.cancelled: list[bytes] = []

    def is_initialized(self) -> bool:
        return self.running

    def init(self, **_: Any) -> None:
        self.running = True

    def shutdown(self) -> None:
        self.running = False

    def cluster_resources(self) -> dict[str, float]:
        return {"CPU": 2.0}

    def remote(self, **_: Any) -> Callable[[Callable[..., Any]], Any]:
        def task(*given: Any) -> bytes:
            self.waiting.append(pickle.dumps(given))
            self.most = max(self.most, len(self.waiting))
            return self.waiting[-1]

        def decorated(function: Callable[..., Any]) -> Any:
            self.function = function
            return SimpleNamespace(remote=task)

        return decorated

    def wait(self, tasks: list[bytes], num_returns: int) -> tuple[list[bytes], list[bytes]]:
        return tasks[-num_returns:], tasks[:-num_returns]

    def get(self, task: bytes) -> Any:
        self.waiting.remove(task)
        try:
            return pickle.loads(pickle.dumps(self.function(*pickle.loads(task))))
        except Exception as error:
            raise RayTaskError(error) from None

    def cancel(self, task: bytes, force: bool) -> None:
        self.cancelled.append(task)
