"""The network as an estimator: a TFLite file run by LiteRT, what phones run."""

from pathlib import Path

import numpy as np
from ai_edge_litert import schema_py_generated as schema
from ai_edge_litert.interpreter import Interpreter, OpResolverType
from jaxtyping import Float32

from deeplight.contract import CONTRACT_KEY, ModelContract
from deeplight.errors import ModelError
from deeplight.estimators.network import (
    MAX_THREADS,
    NetworkEstimator,
    content_of,
    cores,
    refuse_other_sizes,
)
from deeplight.estimators.trial import try_once
from deeplight.io.quiet import quiet

_KERNELS = {
    True: OpResolverType.AUTO,
    False: OpResolverType.BUILTIN_WITHOUT_DEFAULT_DELEGATES,
}
_DO = "give a .tflite file of `deeplight export`"


class LiteRTEstimator(NetworkEstimator):
    """A model exported by `deeplight.deploy.litert`.

    Args:
        model_path: the .tflite file.
        threads: cores the network may use; left out, all that this process has, at most 4.
        xnnpack: run float32 and 8-bit layers with XNNPACK, LiteRT's fast kernels.
        trusted: do not try the file in a process with limits first; see `trial`.

    Raises:
        ModelError: no such file, no TFLite model, not one of ours, or one of another version.
    """

    def __init__(
        self,
        model_path: Path | str,
        threads: int | None = None,
        xnnpack: bool = True,
        trusted: bool = False,
    ) -> None:
        self.path = Path(model_path)
        if not trusted:
            try_once(self.path)
        content = content_of(self.path)
        self.contract = ModelContract.from_json(contract_text(content, self.path))
        try:
            with quiet():  # it prints how it runs; stderr is for our one line
                self._interpreter = Interpreter(
                    model_content=content,
                    num_threads=threads or min(MAX_THREADS, cores()),
                    experimental_op_resolver_type=_KERNELS[xnnpack],
                )
                self._interpreter.allocate_tensors()
                self._runner = self._interpreter.get_signature_runner()
                inputs = self._runner.get_input_details()
                outputs = self._runner.get_output_details()
        except Exception as error:  # whatever its parser runs into
            got = f"{self.path}, which LiteRT cannot load"
            raise ModelError("a TFLite model", got, _DO) from error
        refuse_other_sizes(
            self.contract,
            {name: entry["shape"].tolist()[1:] for name, entry in inputs.items()},
            {name: entry["shape"].tolist()[1:] for name, entry in outputs.items()},
            self.path,
        )

    def run(
        self, inputs: Float32[np.ndarray, "batch 3 height width"]
    ) -> Float32[np.ndarray, "batch 3 size size"]:
        """The bare network; the interpreter makes room for a batch of another size by itself."""
        output: np.ndarray
        output = self._runner(**{self.contract.input_name: inputs})[self.contract.output_name]
        return output


def contract_text(content: bytes, path: Path) -> str:
    """The contract that a TFLite file holds, in JSON.

    Raises:
        ModelError: it is no TFLite file, or has none.
    """
    if content[4:8] != b"TFL3":
        raise ModelError("a TFLite model", f"{path}, which is none", _DO)
    try:
        model = schema.Model.GetRootAs(content, 0)
        for number in range(model.MetadataLength()):
            entry = model.Metadata(number)
            if entry.Name() == CONTRACT_KEY.encode():
                data = model.Buffers(entry.Buffer()).DataAsNumpy()
                return bytes(data).decode()
    except Exception as error:  # offsets that lead anywhere
        raise ModelError("a whole TFLite model", f"{path}, which is damaged", _DO) from error
    got = f"{path} without a '{CONTRACT_KEY}' entry"
    raise ModelError("a model exported by deeplight", got, _DO)
