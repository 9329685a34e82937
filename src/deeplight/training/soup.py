"""The weights of several runs averaged into one network (Wortsman et al., ICML 2022).

Runs that started from the same weights and seed often end in one valley, and a network between
them is better than either, at the cost of one. Measure it before it is believed.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import torch

from deeplight.errors import ModelError
from deeplight.training import checkpoint


def average_weights(parts: Sequence[tuple[Path, float]], out: Path) -> checkpoint.Header:
    """Write the mean of best.safetensors files to `out`, which can be exported; gives its header.

    The header is the first's, without a validation score: nobody has measured the mean yet.

    Args:
        parts: files and their shares, which are divided by their sum.

    Raises:
        ModelError: no parts, shares that are not above 0, or a file of another network.
        OSError: a file cannot be read or written.
    """
    if not parts or min(share for _, share in parts) <= 0:
        raise ModelError("files with shares above 0", f"{len(parts)} files", "correct the shares")
    total = sum(share for _, share in parts)
    loaded = [(path, *checkpoint.load(path)) for path, _ in parts]
    _, header, first = loaded[0]
    shapes = {name: value.shape for name, value in first["generator"].items()}
    for path, _, states in loaded:
        if {n: v.shape for n, v in states.get("generator", {}).items()} != shapes:
            got = f"{path} of another network than {parts[0][0]}"
            raise ModelError("weights of one network", got, "leave it out")
    mean = {
        name: torch.stack(
            [states["generator"][name] * (share / total)
             for (_, _, states), (_, share) in zip(loaded, parts, strict=True)]
        ).sum(0).to(value.dtype)
        for name, value in first["generator"].items()
    }  # fmt: skip
    header = replace(header, best_score=float("inf"))
    checkpoint.save(out, header, generator=mean)
    return header
