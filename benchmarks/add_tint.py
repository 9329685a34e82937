"""Give a trained network the hues that its features know of, and export it.

python benchmarks/add_tint.py soup.safetensors --data data/sim --out tinted.onnx

The ridge regression takes some tens of seconds; the network stays as fast as it was. Whether the
hues are better in places it has not seen is for `deeplight evaluate` to tell.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import torch
import tyro

from deeplight.export.onnx import export_onnx
from deeplight.training.batches import DataConfig, ExampleBytes
from deeplight.training.losses import RigBases
from deeplight.training.model_file import load_network
from deeplight.training.sources import Sources
from deeplight.training.tint import hue_gap, ridge, tinted
from deeplight.training.validation import some_of


@dataclass(frozen=True)
class Args:
    """Options of the command."""

    model: Annotated[Path, tyro.conf.Positional]
    """A trained network: .onnx, best.safetensors or a run's folder."""
    data: str
    """Data set whose training split the hues are learnt from."""
    out: Path
    """ONNX file to write."""
    more: Annotated[tuple[str, ...], tyro.conf.UseAppendAction] = ()
    """Another data set to learn them from."""
    examples: int = 3168
    """At most so many training examples, evenly spread."""
    trained_on: str = ""
    """What the network was trained on, in words; the file keeps them."""


def main(args: Args) -> None:
    """Fit, build in, write."""
    sources = Sources(args.data, args.more)
    names = list(sources.rigs)
    network, contract = load_network(args.model, args.trained_on)
    chosen = ExampleBytes(sources.training(DataConfig(), 0), names)
    some = some_of(chosen, args.examples, workers=0)
    bases = RigBases.from_rigs(list(sources.rigs.values()), contract.output_size)
    features, gaps = hue_gap(network, bases, some)
    weights, offsets = ridge(features, gaps)
    left = (gaps - features @ weights.T - offsets).square().mean().sqrt()
    made = tinted(network, weights, offsets)
    export_onnx(made, contract, args.out)
    torch.set_printoptions(precision=3)
    print(f"hue of {len(gaps)} training examples off by {gaps.square().mean().sqrt():.3f} before,")
    print(f"{left:.3f} after (root mean square of ln). Wrote {args.out}")


if __name__ == "__main__":
    main(tyro.cli(Args))
