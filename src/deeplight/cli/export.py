"""Write a trained network as a file that phones, browsers and other programs run.

deeplight export runs/mine --out mine.onnx --precision float16

deeplight export mine.onnx --format tflite --precision int8 --calibrate data/sim --out mine.tflite

deeplight export runs/a runs/b --flips --precision float16 --out both.onnx
"""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import tyro

from deeplight.deploy.network import Refinement


@dataclass(frozen=True)
class Args:
    """Options of `deeplight export`."""

    models: Annotated[
        tuple[Path, ...],
        tyro.conf.Positional,
        tyro.conf.arg(metavar="MODEL...", help_behavior_hint="(one or more)"),
    ]
    """Folder of a training run, a best.safetensors, or an .onnx of deeplight. Several become one
    .onnx that answers with the mean of their light and the lamps they agree on."""
    out: Path
    """File to write."""
    format: Literal["onnx", "tflite"] | None = None
    """Left out, by the suffix of --out."""
    precision: Literal["float32", "float16", "int8-weights", "int8"] = "float32"
    """float16: weights stored in half precision, computed in float32. int8-weights: weights of 8
    bits. int8: signals of 8 bits too, but for the decoder. The last two are TFLite's."""
    calibrate: Path | None = None
    """Data set whose training photos choose the integers of the two int8."""
    photos: int = 128
    """Number of them, evenly spread."""
    trained_on: str = ""
    """Of a run: what it was trained on, in words; the file keeps them."""
    without_colour: bool = False
    """Leave out the photo's colour (network.colour) that a run learnt to add to the light's."""
    flips: bool = False
    """Answer the mirrored photo as well, in the same file, and take the mean: twice the work, and
    a photo and its mirror image have mirrored light."""
    shares: Annotated[tuple[float, ...], tyro.conf.arg(help_behavior_hint="(optional)")] = ()
    """Of each of several networks in the mean; left out, all alike."""
    refine: Annotated[Refinement, tyro.conf.OmitArgPrefixes] = field(default_factory=Refinement)


def run(args: Args) -> None:
    """Read the network, write the file, say what it is."""
    from deeplight.cli.flags import refuse_unused
    from deeplight.cli.screen import results_console
    from deeplight.deploy.network import write_network

    if not args.precision.startswith("int8"):
        refuse_unused(args, f"with --precision {args.precision}", "calibrate", "photos")
    console = results_console()
    with console.status("exporting"):
        contract = write_network(
            args.models,
            args.out,
            args.format,
            args.precision,
            args.calibrate,
            args.photos,
            args.trained_on,
            args.without_colour,
            args.flips,
            args.shares,
            args.refine,
        )
    size = args.out.stat().st_size / 1e6
    console.print(
        f"{args.out}: {size:.1f} MB, {args.precision}, {contract.width} x {contract.height} photos "
        f"-> {contract.output_size} x {contract.output_size} light",
        markup=False,
    )
