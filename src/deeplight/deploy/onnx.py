"""A trained network as an ONNX file with its contract inside.

The caller applies exp to the output, in float32: ln radiance is what a file can hold in half
precision without losing the sun.
"""

import logging
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import onnx
import torch
from onnx import ModelProto, TensorProto, helper, numpy_helper
from torch import Tensor, nn

from deeplight.contract import CONTRACT_KEY, ModelContract
from deeplight.errors import ModelError
from deeplight.io.atomic import replacing

OPSET = 18  # onnxruntime >= 1.14, its web build included
HALF_MAX = 65504.0
SMALLEST_HALVED = 64  # elements; shapes and scales stay as they are
EXACT = "ball"  # where lamps are drawn: an error there is multiplied by their concentration


def export_onnx(
    generator: nn.Module, contract: ModelContract, path: Path, float16: bool = True
) -> None:
    """Write `generator` as it is (evaluation mode, batch norm already folded) to `path`.

    Args:
        generator: maps photos (n, 3, height, width) in the contract's range to ln radiance
            (n, 3, size, size); where the contract has lamps, its `light` gives these too. Put back
            into the mode it was in.
        contract: stored as metadata `deeplight.contract`.
        float16: store the weights in half precision, half the file; computing stays in float32,
            ln radiance moves by up to 0.05 (0.01 is common).

    Raises:
        ModelError: a weight is too large for half precision.
    """
    write_model(traced(generator, contract), contract, path, float16)


def write_model(model: ModelProto, contract: ModelContract, path: Path, float16: bool) -> None:
    """Write a traced network and its contract; see `export_onnx`. Changes `model`."""
    remove_traces(model)
    if float16:
        store_as_float16(model)
    entry = model.metadata_props.add()
    entry.key, entry.value = CONTRACT_KEY, contract.to_json()
    onnx.checker.check_model(model)
    with replacing(path) as temporary:
        onnx.save(model, str(temporary))


class WithMore(nn.Module):
    """A network with its lamps and heads as further outputs, every weight under its own name."""

    def __init__(self, network: nn.Module, heads: bool) -> None:
        super().__init__()
        self._modules = network._modules
        outputs = network.everything if heads else network.light
        self.outputs: Callable[[Tensor], tuple[Tensor | None, ...]] = outputs  # type: ignore[assignment]

    def forward(self, photo: Tensor) -> tuple[Tensor, ...]:
        return tuple(output for output in self.outputs(photo) if output is not None)


def traced(generator: nn.Module, contract: ModelContract) -> ModelProto:
    """The network's graph for any batch size."""
    photo = torch.zeros(2, 3, contract.height, contract.width)
    photo = photo.to(next(generator.parameters()).device)
    names = [contract.output_name]
    names += [contract.lamps_name] * bool(contract.lamps)
    names += [contract.heads_name] * bool(contract.heads)
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)
    with ready_to_trace(generator), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # notes of the exporter about its own future
        program = torch.onnx.export(
            WithMore(generator, bool(contract.heads)) if len(names) > 1 else generator,
            (photo,),
            input_names=[contract.input_name],
            output_names=names,
            dynamic_shapes=({0: torch.export.Dim("batch")},),
            opset_version=OPSET,
            dynamo=True,
            verbose=False,
            external_data=False,
        )
    if program is None:
        raise ModelError("a network that can be exported", type(generator).__name__, "report this")
    return program.model_proto


@contextmanager
def ready_to_trace(generator: nn.Module) -> Iterator[None]:
    """Evaluation mode, nothing in place (the graph is the same, found sooner); then as before."""
    was_training = generator.training
    in_place = [m for m in generator.modules() if isinstance(m, nn.ReLU6) and m.inplace]
    try:
        for module in in_place:
            module.inplace = False
        generator.eval()
        yield
    finally:
        generator.train(was_training)
        for module in in_place:
            module.inplace = True


def remove_traces(model: ModelProto) -> None:
    """Take out what the exporter noted of this machine: source paths and stack traces, per node."""
    graph = model.graph
    for part in (model, graph, *graph.node, *graph.value_info, *graph.initializer):
        part.ClearField("doc_string")
        part.ClearField("metadata_props")


def store_as_float16(model: ModelProto) -> None:
    """Halve the stored weights, in place: each gets a Cast to float32, which onnxruntime does once.

    Raises:
        ModelError: a weight lies outside half precision.
    """
    casts = []
    for tensor in weights_of(model):
        values = numpy_helper.to_array(tensor)
        if abs(values).max() > HALF_MAX:
            got = f"{tensor.name} with {abs(values).max():g}"
            raise ModelError(f"weights up to {HALF_MAX:g}", got, "export with float16=False")
        name, stored = tensor.name, f"{tensor.name}.float16"
        tensor.CopyFrom(numpy_helper.from_array(values.astype("float16"), stored))
        casts.append(helper.make_node("Cast", [stored], [name], to=TensorProto.FLOAT))
    nodes = [*casts, *model.graph.node]
    del model.graph.node[:]
    model.graph.node.extend(nodes)


def weights_of(model: ModelProto) -> "Iterator[TensorProto]":
    """The float32 initialisers large enough to matter."""
    for tensor in model.graph.initializer:
        if tensor.data_type == TensorProto.FLOAT and EXACT not in tensor.name.split("."):
            count = 1
            for size in tensor.dims:
                count *= size
            if count >= SMALLEST_HALVED:
                yield tensor
