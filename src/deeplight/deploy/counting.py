"""How large a model file's network is: its parameters and the multiply-adds of one photo."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class NetworkSize:
    """Weights and biases, and products of a weight and a signal for one photo."""

    parameters: int
    multiply_adds: int


def network_size(path: Path) -> NetworkSize:
    """Count the convolutions and fully connected layers of an .onnx or .tflite file.

    Raises:
        ModuleNotFoundError: the package that reads the format is not installed.
    """
    layers = _of_tflite(path) if path.suffix == ".tflite" else _of_onnx(path)
    parameters = sum(math.prod(weight) + bias for weight, bias, _ in layers)
    return NetworkSize(parameters, sum(products for *_, products in layers))


def _of_onnx(path: Path) -> list[tuple[list[int], int, int]]:
    """(weight's shape, biases, multiply-adds) of each layer."""
    import onnx

    model = onnx.shape_inference.infer_shapes(onnx.load(str(path)))
    shapes = {tensor.name: list(tensor.dims) for tensor in model.graph.initializer}
    for value in (*model.graph.value_info, *model.graph.output):
        dims = value.type.tensor_type.shape.dim
        shapes[value.name] = [max(1, dim.dim_value) for dim in dims]  # the batch: 1
    layers = []
    for node in model.graph.node:
        if node.op_type in ("Conv", "Gemm"):
            weight, out = shapes[node.input[1]], shapes[node.output[0]]
            per_output = math.prod(weight[1:])
            bias = weight[0] if len(node.input) > 2 else 0
            layers.append((weight, bias, math.prod(out) * per_output))
    return layers


def _of_tflite(path: Path) -> list[tuple[list[int], int, int]]:
    from ai_edge_litert import schema_py_generated as schema

    model = schema.ModelT.InitFromPackedBuf(bytearray(path.read_bytes()), 0)
    graph, kinds = model.subgraphs[0], schema.BuiltinOperator
    codes = [max(c.builtinCode, c.deprecatedBuiltinCode) for c in model.operatorCodes]
    layers = []
    for operator in graph.operators:
        code = codes[operator.opcodeIndex]
        if code not in (kinds.CONV_2D, kinds.DEPTHWISE_CONV_2D, kinds.FULLY_CONNECTED):
            continue
        weight = _shape(graph, operator.inputs[1])
        out = _shape(graph, operator.outputs[0])
        depthwise = code == kinds.DEPTHWISE_CONV_2D
        per_output = math.prod(weight[1:3] if depthwise else weight[1:])
        layers.append((weight, weight[-1 if depthwise else 0], math.prod(out) * per_output))
    return layers


def _shape(graph: Any, number: Any) -> list[int]:
    return [int(size) for size in graph.tensors[number].shape]
