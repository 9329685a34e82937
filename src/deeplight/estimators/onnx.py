"""The network as an estimator: an ONNX file that carries its own contract."""

from importlib import resources
from pathlib import Path

import numpy as np
import onnxruntime as ort
from jaxtyping import Float32

from deeplight.contract import CONTRACT_KEY, LAMP_NUMBERS, ModelContract
from deeplight.errors import ModelError
from deeplight.estimators.calibration import CALIBRATION_KEY, Calibration
from deeplight.estimators.network import (
    MAX_THREADS,
    NetworkEstimator,
    content_of,
    cores,
    refuse_other_sizes,
)
from deeplight.estimators.trial import try_once
from deeplight.io.quiet import quiet

# Protobuf writes an operator's name as its field, its length and its letters. Loops may have no
# end, and onnxruntime runs those over constants while it loads; outside files may be any file.
REFUSED = {
    "a loop": b'"\x04Loop',
    "a scan": b'"\x04Scan',
    "weights in another file": b"\n\x08location\x12",
}


class OnnxEstimator(NetworkEstimator):
    """A model exported by `deeplight.deploy.onnx`.

    Args:
        model_path: left out, the model shipped with the package.
        threads: cores the network may use; left out, all that this process has, at most 4.
        trusted: do not try the file in a process with limits first; see `trial`.

    Raises:
        ModelError: no such file, no ONNX model, not one of ours, or one of another version.
    """

    def __init__(
        self,
        model_path: Path | str | None = None,
        threads: int | None = None,
        trusted: bool = False,
    ) -> None:
        self.path = shipped_model() if model_path is None else Path(model_path)
        if model_path is not None and not trusted:
            try_once(self.path)
        self._session = _open(self.path, threads or min(MAX_THREADS, cores()))
        self.contract = _contract(self._session, self.path)
        stored = self._session.get_modelmeta().custom_metadata_map.get(CALIBRATION_KEY)
        self.calibration = None if stored is None else Calibration.from_json(stored)

    def run(
        self, inputs: Float32[np.ndarray, "batch 3 height width"]
    ) -> Float32[np.ndarray, "batch 3 size size"]:
        """The bare network."""
        feed = {self.contract.input_name: inputs}
        output: np.ndarray
        (output,) = self._session.run([self.contract.output_name], feed)
        return output

    def run_fully(
        self, inputs: Float32[np.ndarray, "batch 3 height width"]
    ) -> tuple[
        Float32[np.ndarray, "batch 3 size size"],
        Float32[np.ndarray, "batch lamp numbers"],
        Float32[np.ndarray, "batch heads"],
    ]:
        """The bare network with its lamps and heads, none where the contract has none."""
        contract = self.contract
        names = [contract.output_name]
        names += [contract.lamps_name] * bool(contract.lamps)
        names += [contract.heads_name] * bool(contract.heads)
        found = self._session.run(names, {contract.input_name: inputs})
        lamps = found[1] if contract.lamps else np.zeros((len(inputs), 0, LAMP_NUMBERS), np.float32)
        heads = found[-1] if contract.heads else np.zeros((len(inputs), 0), np.float32)
        return found[0], lamps, heads


def shipped_model() -> Path:
    """Give the path of the model inside the package.

    Raises:
        ModelError: this installation has none.
    """
    path = Path(str(resources.files("deeplight") / "weights" / "deeplight.onnx"))
    if not path.is_file():
        do = "install deeplight again or give --model FILE"
        raise ModelError("the model that comes with deeplight", f"no file {path}", do)
    return path


def _open(path: Path, threads: int) -> ort.InferenceSession:
    content = content_of(path)
    for name, mark in REFUSED.items():
        if mark in content:
            got = f"{path} with {name}"
            raise ModelError("a feed-forward network in one file", got, "export it again")
    options = ort.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 4  # faults come as exceptions; stderr is for our one line
    # Threads that spin while they wait would keep whole cores busy between two photos.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    try:
        with quiet():  # it prints what it tries again
            return ort.InferenceSession(content, options, ["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime has no common base class for its errors
        got = f"{path}, which onnxruntime cannot load"
        raise ModelError("an ONNX model", got, "give a .onnx file of deeplight") from error


def _contract(session: ort.InferenceSession, path: Path) -> ModelContract:
    """Read the model's contract and check that the network keeps it."""
    text = session.get_modelmeta().custom_metadata_map.get(CONTRACT_KEY)
    if text is None:
        got = f"{path} without a '{CONTRACT_KEY}' entry"
        raise ModelError("a model exported by deeplight", got, "give a .onnx file of deeplight")
    contract = ModelContract.from_json(text)
    inputs = {entry.name: entry.shape[1:] for entry in session.get_inputs()}
    outputs = {entry.name: entry.shape[1:] for entry in session.get_outputs()}
    refuse_other_sizes(contract, inputs, outputs, path)
    return contract
