"""What a converted TFLite file still lacks: the contract, and room for any number of photos."""

from typing import Any

import numpy as np
from ai_edge_litert import schema_py_generated as schema

from deeplight.contract import CONTRACT_KEY, ModelContract

IDENTIFIER = b"TFL3"


def finished(content: bytes, contract: ModelContract) -> bytes:
    """The model with its contract as metadata `deeplight.contract`, for batches of any size."""
    import flatbuffers

    model = schema.ModelT.InitFromPackedBuf(bytearray(content), 0)
    take_in(model, content)
    free_batch(model)
    add_contract(model, contract)
    builder = flatbuffers.Builder(len(content) + 4096)
    builder.Finish(model.Pack(builder), file_identifier=IDENTIFIER)
    return bytes(builder.Output())


def take_in(model: Any, content: bytes) -> None:
    """Take buffers that lie behind the model back into it."""
    for buffer in model.buffers:
        if buffer.offset > 1:  # 0 and 1: the data are in the buffer itself
            part = content[buffer.offset : buffer.offset + buffer.size]
            buffer.data, buffer.offset, buffer.size = np.frombuffer(part, np.uint8), 0, 0


def add_contract(model: Any, contract: ModelContract) -> None:
    """Store the contract in a buffer of its own that a metadata entry names."""
    buffer = schema.BufferT()
    buffer.data = np.frombuffer(contract.to_json().encode(), np.uint8)
    model.buffers.append(buffer)
    entry = schema.MetadataT()
    entry.name, entry.buffer = CONTRACT_KEY, len(model.buffers) - 1
    model.metadata = [*(model.metadata or []), entry]


def free_batch(model: Any) -> None:
    """Let the first axis be of any size; the converter writes it as 1 into each reshape."""
    graph = model.subgraphs[0]
    codes = [max(c.builtinCode, c.deprecatedBuiltinCode) for c in model.operatorCodes]
    for operator in graph.operators:
        if codes[operator.opcodeIndex] != schema.BuiltinOperator.RESHAPE:
            continue
        wanted = model.buffers[graph.tensors[operator.inputs[1]].buffer]
        shape = np.frombuffer(bytes(wanted.data), np.int32).copy()
        shape[0] = -1
        wanted.data = np.frombuffer(shape.tobytes(), np.uint8)
        if operator.builtinOptions is not None:
            operator.builtinOptions.newShape = shape
    ends = {*graph.inputs.tolist(), *graph.outputs.tolist()}
    for number in ends:
        tensor = graph.tensors[number]
        free = np.array(tensor.shape, np.int32)
        free[0] = -1
        tensor.shapeSignature = free
