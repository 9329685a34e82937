"""The estimator for a model file, by its suffix."""

from pathlib import Path

from deeplight.errors import MissingExtraError
from deeplight.estimators.network import NetworkEstimator
from deeplight.estimators.onnx import OnnxEstimator

LITERT = ".tflite"


def open_model(path: Path | str | None = None, threads: int | None = None) -> NetworkEstimator:
    """Open a model file: .tflite runs in LiteRT, all else in onnxruntime.

    Args:
        path: left out, the model shipped with the package.
        threads: cores the network may use.

    Raises:
        ModelError: the file cannot be used.
        MissingExtraError: LiteRT is not installed.
    """
    if path is None or Path(path).suffix.lower() != LITERT:
        return OnnxEstimator(path, threads)
    try:
        from deeplight.estimators.litert import LiteRTEstimator
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "ai_edge_litert":
            raise
        raise MissingExtraError("litert", f"{path}") from error
    return LiteRTEstimator(path, threads)
