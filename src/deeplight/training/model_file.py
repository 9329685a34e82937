"""A trained network from any file that holds one: a run, its best weights, or an exported ONNX."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from deeplight.contract import CONTRACT_KEY, HEADS, ModelContract
from deeplight.errors import ModelError
from deeplight.io.boundary import reading
from deeplight.training import checkpoint
from deeplight.training.checkpoint import BEST
from deeplight.training.network.generator import Generator, NetworkConfig, fold_batch_norm
from deeplight.training.network.mobilenet_v2 import STAGES, STEM_CHANNELS, scaled
from deeplight.training.release import contract_of, settings_of

_STEM = "encoder.features.0.conv.weight"
_WIDTHS = tuple(n / 20 for n in range(1, 61))
_DO = "give an .onnx file of deeplight, a best.safetensors or the folder of a run"


def load_network(path: Path, data: str = "") -> tuple[Generator, ModelContract]:
    """The network in `path`, in evaluation mode with batch norm folded, and its contract.

    An ONNX file's weights are those it stores: of a float16 file the rounded ones.

    Args:
        path: an exported .onnx, a run's best.safetensors, or its folder; or one of its
            checkpoints, of which the averaged weights are taken.
        data: what a run was trained on, in words; an ONNX file says that itself.

    Raises:
        ModelError: there is no such file, or it is not a network of deeplight.
    """
    path = path / BEST if path.is_dir() else path
    if not path.is_file():
        raise ModelError("a trained network", f"no file {path}", _DO)
    if path.suffix == ".onnx":
        with reading(path, ModelError):
            return _from_onnx(path)
    header, states = checkpoint.load(path)
    generator = Generator(settings_of(header).network)
    _fill(generator, checkpoint.averaged(states), path)
    fold_batch_norm(generator)
    return generator, contract_of(header, data)


def _from_onnx(path: Path) -> tuple[Generator, ModelContract]:
    import onnx
    from google.protobuf.message import DecodeError
    from onnx import external_data_helper, numpy_helper

    try:
        model = onnx.load(str(path), load_external_data=False)
    except DecodeError as error:
        raise ModelError("an ONNX model", f"{path}, which cannot be read", _DO) from error
    stored = {entry.key: entry.value for entry in model.metadata_props}
    if CONTRACT_KEY not in stored:
        raise ModelError("a model exported by deeplight", f"{path} without a contract", _DO)
    contract = ModelContract.from_json(stored[CONTRACT_KEY])
    if any(external_data_helper.uses_external_data(tensor) for tensor in model.graph.initializer):
        raise ModelError("weights inside the model", f"{path} with some outside", _DO)
    state = {
        tensor.name.removesuffix(".float16"): torch.tensor(numpy_helper.to_array(tensor)).float()
        for tensor in model.graph.initializer
    }
    add_equal_biases(state, model.graph.node)
    if any(name.startswith("members.") for name in state):
        raise ModelError("one network", f"{path}, the mean of several", "give one of its parts")
    generator = Generator(_shape_of(state, contract, path)).eval()
    own = generator.state_dict()
    # A file of before this head was known says nothing of it: its chance is a half.
    state = {name: own[name] for name in own if name.startswith("heads.indoors.")} | state
    _fill(generator, {name: state[name] for name in own if name in state}, path)
    return generator, replace(contract, heads=HEADS) if contract.heads else contract


def add_equal_biases(state: dict[str, Tensor], nodes: Iterable[Any]) -> None:
    """Put biases back under their names: the exporter stores equal ones once, and zeros never."""
    for node in nodes:
        weight = node.input[1] if node.op_type in ("Conv", "Gemm") else ""
        if weight.endswith(".weight") and weight in state:
            shared = state.get(node.input[2]) if len(node.input) > 2 else None
            bias = torch.zeros(len(state[weight])) if shared is None else shared
            state.setdefault(f"{weight.removesuffix('weight')}bias", bias)


def _shape_of(state: Mapping[str, Tensor], contract: ModelContract, path: Path) -> NetworkConfig:
    """The settings of a network without batch norm, from the sizes of its weights."""
    try:
        stem, latent = state[_STEM], state["latent.weight"]
        up1, up3 = state["decoder.up1.conv.weight"], state["decoder.up3.weight"]
    except KeyError as error:
        raise ModelError("a network of deeplight", f"{path} without {error}", _DO) from error
    up2 = state.get("decoder.up2.conv.weight", up3)
    mean = state.get("mixture.components")
    return NetworkConfig(
        orientation="landscape" if contract.width > contract.height else "portrait",
        latent_size=latent.shape[0],
        decoder_widths=(up1.shape[0], up2.shape[0]),
        encoder_norm="none",
        decoder_norm="none",
        width=_width_of(state, stem.shape[0], path),
        output_size=contract.output_size,
        components=0 if mean is None else mean.shape[0],
        lamps=contract.lamps,
        brightness=contract.brightness,
        mirrored=contract.mirrored,
        heads=bool(contract.heads),
        colour="colour.weight" in state,
    )


def _width_of(state: Mapping[str, Tensor], stem: int, path: Path) -> float:
    """A width that gives an encoder with these channels; several may, of the same network."""
    found, layer = [stem], 0
    for _, _, blocks, _ in STAGES:
        layer += blocks
        project = state.get(f"encoder.features.{layer}.project.conv.weight")
        found.append(0 if project is None else project.shape[0])
    full = (STEM_CHANNELS, *(channels for _, channels, _, _ in STAGES))
    for width in sorted(_WIDTHS, key=lambda w: w not in (1.0, 0.5, 0.35)):
        if found == [scaled(channels, width) for channels in full]:
            return width
    raise ModelError("an encoder of MobileNetV2", f"{path} with channels {found}", _DO)


def _fill(generator: Generator, state: Mapping[str, Tensor], path: Path) -> None:
    try:
        generator.load_state_dict(state)
    except RuntimeError as error:
        raise ModelError("weights of one network of deeplight", f"others in {path}", _DO) from error
