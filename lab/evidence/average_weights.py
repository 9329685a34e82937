"""One network from the weights of several runs of it.

python -m lab.evidence.average_weights --out soup.safetensors \
    --parts runs/a/best.safetensors 0.7 runs/b/best.safetensors 0.3
"""

from dataclasses import dataclass
from pathlib import Path

import tyro

from deeplight.training.weight_averaging import average_weights


@dataclass(frozen=True)
class Args:
    """Files and where the mean goes."""

    parts: tuple[tuple[Path, float], ...]
    """best.safetensors files or exported .onnx, each with its share."""
    out: Path
    """The mean; `deeplight export` takes it."""


if __name__ == "__main__":
    args = tyro.cli(Args)
    average_weights(args.parts, args.out)
    print(f"wrote {args.out}")
