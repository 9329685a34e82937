"""A process forked from one that estimates, as torch's DataLoader forks its workers, ends."""

import gc
import multiprocessing

import pytest

from deeplight.estimators.onnx import OnnxEstimator

if "fork" not in multiprocessing.get_all_start_methods():
    pytest.skip("processes cannot be forked here", allow_module_level=True)


class _Holder:
    """Garbage only for the collector: it refers to itself."""

    def __init__(self) -> None:
        self.estimator = OnnxEstimator(threads=2)
        self.itself = self


@pytest.mark.filterwarnings("ignore:.*multi-threaded.*fork:DeprecationWarning")
def test_an_estimator_that_is_garbage_does_not_hang_a_forked_process() -> None:
    gc.disable()
    try:
        _Holder()
        child = multiprocessing.get_context("fork").Process(target=gc.collect)
        child.start()
    finally:
        gc.enable()
    child.join(10)
    ended = child.exitcode
    child.kill()
    child.join()
    assert ended == 0
