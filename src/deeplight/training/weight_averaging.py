"""The weights of several runs averaged into one network (Wortsman et al., ICML 2022).

Runs that started from the same weights and seed often end in one valley, and a network between
them is better than either, at the cost of one. Measure it before it is believed.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import torch
from torch import Tensor

from deeplight.errors import ModelError
from deeplight.training import checkpoint
from deeplight.training.model_file import load_network


def average_weights(parts: Sequence[tuple[Path, float]], out: Path) -> checkpoint.Header:
    """Write the mean of best.safetensors files to `out`, which can be exported; gives its header.

    The header is the first's, without a validation score: nobody has measured the mean yet.

    Args:
        parts: best.safetensors files, checkpoints or exported .onnx, and their shares, divided by
            their sum.

    Raises:
        ModelError: no parts, shares that are not above 0, or a file of another network.
        OSError: a file cannot be read or written.
    """
    if not parts or min(share for _, share in parts) <= 0:
        raise ModelError("files with shares above 0", f"{len(parts)} files", "correct the shares")
    total = sum(share for _, share in parts)
    loaded = loaded_parts([path for path, _ in parts])
    _, header, first = loaded[0]
    shapes = {name: value.shape for name, value in checkpoint.averaged(first).items()}
    for path, other, states in loaded:
        same = {n: v.shape for n, v in checkpoint.averaged(states).items()} == shapes
        if not same or orientation(other) != orientation(header):  # which the shapes do not say
            got = f"{path} of another network than {parts[0][0]}"
            raise ModelError("weights of one network", got, "leave it out")
    shares = [share / total for _, share in parts]
    mean = {
        name: weighted_mean([checkpoint.averaged(states)[name] for _, _, states in loaded], shares)
        for name in shapes
    }
    header = replace(header, best_score=float("inf"))
    checkpoint.save(out, header, generator=mean)
    return header


def loaded_parts(
    paths: Sequence[Path],
) -> list[tuple[Path, checkpoint.Header, dict[str, dict[str, Tensor]]]]:
    """Header and weights of each file. An exported .onnx has no header and no batch norm: its is
    that of the first run, and then every run's norms are folded, too."""
    exported = [path for path in paths if path.suffix == ".onnx"]
    if not exported:
        return [(path, *checkpoint.load(path)) for path in paths]
    runs = [path for path in paths if path not in exported]
    if not runs:
        raise ModelError("at least one best.safetensors", "exported files only", "add one")
    header = checkpoint.read_header(runs[0])
    no_norms = {"network.encoder_norm": "none", "network.decoder_norm": "none"}
    header = replace(header, settings={**header.settings, **no_norms})
    return [(path, header, {"generator": load_network(path)[0].state_dict()}) for path in paths]


def orientation(header: checkpoint.Header) -> str:
    """Which photos the network takes."""
    return str(header.settings.get("network.orientation", "portrait"))


def weighted_mean(values: Sequence[Tensor], shares: Sequence[float]) -> Tensor:
    """In the values' own type: counters are rounded, not cut."""
    mean = torch.stack([v * share for v, share in zip(values, shares, strict=True)]).sum(0)
    return mean if values[0].is_floating_point() else mean.round().to(values[0].dtype)
