"""The estimator for a model: a file by its suffix, or somebody's own class by its name."""

import importlib
import re
from importlib.metadata import entry_points
from pathlib import Path

import numpy as np
from jaxtyping import Float32

from deeplight.contract import ModelContract
from deeplight.errors import MissingExtraError, ModelError
from deeplight.estimators.network import NetworkEstimator
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.estimators.protocol import InputsEstimator

LITERT = ".tflite"
ENTRY_POINTS = "deeplight.estimators"
"""Group of entry points under which other packages offer estimators by name."""
_CLASS_NAME = re.compile(r"[A-Za-z_][\w.]*:[A-Za-z_]\w*")


def open_model(model: Path | str | None = None, threads: int | None = None) -> NetworkEstimator:
    """Open a model: .tflite runs in LiteRT, another file in onnxruntime, a class as it is.

    Args:
        model: a file, "package.module:Class" of an `InputsEstimator` made without arguments, or
            the name of an entry point in `ENTRY_POINTS`; left out, the model shipped with the
            package.
        threads: cores the network may use; a class decides for itself.

    Raises:
        ModelError: the file or the class cannot be used.
        MissingExtraError: LiteRT is not installed.
    """
    named = None if model is None else _named_class(str(model))
    if named is not None:
        return ClassEstimator(named)
    if model is None or Path(model).suffix.lower() != LITERT:
        return OnnxEstimator(model, threads)
    try:
        from deeplight.estimators.litert import LiteRTEstimator
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "ai_edge_litert":
            raise
        raise MissingExtraError("litert", f"{model}") from error
    return LiteRTEstimator(model, threads)


class ClassEstimator(NetworkEstimator):
    """Somebody's own estimator behind the interface of a network.

    Args:
        qualified: "package.module:Class".

    Raises:
        ModelError: there is no such class, or it is no `InputsEstimator`.
    """

    def __init__(self, qualified: str) -> None:
        module_name, _, class_name = qualified.partition(":")
        try:
            module = importlib.import_module(module_name)
            own = getattr(module, class_name)()
        except (ImportError, AttributeError, TypeError) as error:
            got = f"{qualified}, which fails: {error}"
            do = "check that it can be imported and made without arguments"
            raise ModelError("an estimator's class", got, do) from error
        if not isinstance(own, InputsEstimator):
            got = f"{qualified} without `name` or `estimate_inputs`"
            raise ModelError("an estimator's class", got, "give it both: see docs/extend.md")
        self._own = own
        self.path = Path(str(module.__file__))
        self.contract = getattr(own, "contract", None) or ModelContract()

    @property
    def name(self) -> str:
        """What tables call it."""
        return self._own.name

    def run(
        self, inputs: Float32[np.ndarray, "batch 3 height width"]
    ) -> Float32[np.ndarray, "batch 3 size size"]:
        """The estimator's answer, channels first."""
        answer = np.asarray(self._own.estimate_inputs(inputs), np.float32)
        size = self.contract.output_size
        if answer.shape != (len(inputs), size, size, 3):
            got = f"{self.name} giving {answer.shape}"
            raise ModelError(f"ln radiance (batch, {size}, {size}, 3)", got, "correct it")
        return np.ascontiguousarray(answer.transpose(0, 3, 1, 2))


def _named_class(text: str) -> str | None:
    """The class that a text names, itself or through an entry point; None for a file."""
    if _CLASS_NAME.fullmatch(text) and not Path(text).exists():
        return text
    offered = entry_points(group=ENTRY_POINTS, name=text)
    return next((entry.value for entry in offered), None)
