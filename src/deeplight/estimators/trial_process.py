"""The child process of `trial`: a stranger's network runs here, within limits.

It is started as a module of its own, which imports the estimators that import `trial`.
"""

import sys
from pathlib import Path

import numpy as np

from deeplight.errors import InputError
from deeplight.estimators.network import NetworkEstimator
from deeplight.estimators.trial import DATA_BYTES, REFUSED


def main(path: Path, cpu_s: int) -> int:
    """Run in the child: give 0 if the network works, else say why not and give 2."""
    _limit(cpu_s)
    try:
        estimator = open_trusted(path)
        contract = estimator.contract
        estimator.estimate_inputs(np.zeros((1, 3, contract.height, contract.width), np.float32))
    except InputError as error:
        sys.stdout.write("\0".join((error.expected, error.got, error.do)))
        return REFUSED
    return 0


def open_trusted(path: Path) -> NetworkEstimator:
    """Open a model file, which must be .onnx or .tflite, without trying it first."""
    if path.suffix.lower() == ".tflite":
        from deeplight.estimators.litert import LiteRTEstimator

        return LiteRTEstimator(path, 1, trusted=True)
    from deeplight.estimators.onnx import OnnxEstimator

    return OnnxEstimator(path, 1, trusted=True)


def _limit(cpu_s: int) -> None:
    if sys.platform == "win32":
        return
    import resource

    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_CPU, (cpu_s, cpu_s + 1))
    resource.setrlimit(resource.RLIMIT_DATA, (DATA_BYTES, DATA_BYTES))


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), int(sys.argv[2])))
