"""Gains on all light, put into the last layers of an exported network: it stays as it was else."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import onnx
from google.protobuf.message import DecodeError
from onnx import ModelProto, NodeProto, numpy_helper

from deeplight.contract import CONTRACT_KEY, LAMP_NUMBERS, ModelContract
from deeplight.errors import ModelError
from deeplight.estimators.calibration import CALIBRATION_KEY, Calibration
from deeplight.io.atomic import replacing

MAP, LAMPS = "decoder.up3.weight", "lamps.head.weight"
"""The last layers, by the end of their weights' names: ln radiance, and the lamps' numbers."""
FLUX = slice(3, 6)  # of a lamp's numbers: ln of its flux


def write_with_gains(
    model: Path, out: Path, log_gains: Sequence[float], note: str, camera: str = ""
) -> None:
    """Write `model` with all its light times a factor per channel: ln of it joins the biases.

    Args:
        model: an .onnx of deeplight, of one network or the mean of several.
        out: file to write.
        log_gains: ln of the factors of red, green and blue.
        note: is added to what the contract says of the training.
        camera: that the gains are for; `model`'s own gains, if it has some, become part of them.

    Raises:
        ModelError: it cannot be read, or is no network of deeplight.
        OSError: `out` cannot be written.
    """
    try:
        graph = onnx.load(str(model), load_external_data=False)
    except (OSError, DecodeError) as error:
        raise ModelError("an .onnx of deeplight", f"{model}: {error}", "give another") from error
    entry = next((e for e in graph.metadata_props if e.key == CONTRACT_KEY), None)
    layers = [node for node in graph.graph.node if _is_last(node)]
    if entry is None or not any(node.input[1].endswith(MAP) for node in layers):
        do = "give one that `deeplight export` wrote"
        raise ModelError("an .onnx of deeplight", f"another network in {model}", do)
    for weight in dict.fromkeys(node.input[1] for node in layers):
        shift = np.asarray(log_gains, np.float32)
        if weight.endswith(LAMPS):
            shift = np.pad(shift, (FLUX.start, LAMP_NUMBERS - FLUX.stop))
        _add_to_bias(graph, [node for node in layers if node.input[1] == weight], shift)
    contract = ModelContract.from_json(entry.value)
    trained_on = "; ".join(part for part in (contract.trained_on, note) if part)
    entry.value = replace(contract, trained_on=trained_on).to_json()
    _note_gains(graph, log_gains, camera)
    onnx.checker.check_model(graph)
    with replacing(out) as temporary:
        onnx.save(graph, str(temporary))


def _note_gains(graph: ModelProto, log_gains: Sequence[float], camera: str) -> None:
    """Say for which camera the light has which gains, all that were ever put in."""
    entry = next((e for e in graph.metadata_props if e.key == CALIBRATION_KEY), None)
    before = (0.0, 0.0, 0.0) if entry is None else Calibration.from_json(entry.value).log_gains
    red, green, blue = (float(a + b) for a, b in zip(before, log_gains, strict=True))
    entry = graph.metadata_props.add(key=CALIBRATION_KEY) if entry is None else entry
    entry.value = Calibration((red, green, blue), camera).to_json()


def _is_last(node: NodeProto) -> bool:
    return node.op_type in ("Conv", "Gemm") and node.input[1].endswith((MAP, LAMPS))


def _add_to_bias(model: ModelProto, nodes: Sequence[NodeProto], shift: np.ndarray) -> None:
    """Add `shift`, repeated, to a layer's bias, under the name that `load_network` looks for.

    Args:
        nodes: all uses of the layer: a network that looks at the mirrored photo too has two.
    """
    graph, node = model.graph, nodes[0]
    name = f"{node.input[1].removesuffix('weight')}bias"
    stored = {tensor.name: tensor for tensor in graph.initializer}
    sizes = {t.name.removesuffix(".float16"): list(t.dims) for t in graph.initializer}
    old = stored.get(node.input[2]) if len(node.input) > 2 else None
    if old is None and len(node.input) > 2:
        raise ModelError("a bias that is stored", node.input[2], "export the network again")
    outputs = sizes[node.input[1]][0]
    bias = np.zeros(outputs, np.float32) if old is None else numpy_helper.to_array(old)
    if name in stored:  # the exporter stores equal biases once: others may use this one
        _rename(model, name, f"{name}.before")
    values = bias.astype(np.float32) + np.tile(shift, outputs // len(shift))
    graph.initializer.append(numpy_helper.from_array(values, name))
    for node in nodes:
        del node.input[2:]
        node.input.append(name)
    used = {word for other in graph.node for word in other.input}
    unused = [tensor for tensor in graph.initializer if tensor.name not in used]
    for tensor in unused:
        graph.initializer.remove(tensor)


def _rename(model: ModelProto, old: str, new: str) -> None:
    for tensor in model.graph.initializer:
        if tensor.name == old:
            tensor.name = new
    for node in model.graph.node:
        for place, word in enumerate(node.input):
            if word == old:
                node.input[place] = new
