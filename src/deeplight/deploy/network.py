"""From a trained network to the file that estimates: ONNX or TFLite, with its contract."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import tyro
from jaxtyping import Float32

from deeplight.contract import HEADS, ModelContract
from deeplight.deploy.precision import Precision
from deeplight.errors import ConfigError, ModelError

if TYPE_CHECKING:
    from torch import nn

FORMATS = {".onnx": "onnx", ".tflite": "tflite"}


@dataclass(frozen=True)
class Refinement:
    """What may be changed of one network after its training, in this order."""

    lamp_gain: float = 0.0
    """ln of what the lamps' flux is multiplied by: on new places a network makes them fainter than
    they are. Choose it on validation places."""
    heads: Annotated[tuple[str, ...], tyro.conf.arg(help_behavior_hint="(optional)")] = ()
    """Data sets whose photos teach it to say what camera took a photo and how sure its light is;
    their validation places set how sure. Some minutes."""
    scales: Annotated[tuple[str, ...], tyro.conf.arg(help_behavior_hint="(optional)")] = ()
    """Data sets whose validation places set anew how sure a network with heads is; what its heads
    have learnt stays. About a minute."""
    indoors: Annotated[tuple[str, ...], tyro.conf.arg(help_behavior_hint="(optional)")] = ()
    """Data sets whose photos teach a network with heads anew whether a photo was taken in a room;
    all else stays. Some minutes."""

    @property
    def of_heads(self) -> bool:
        """Whether it changes what a network says besides light."""
        return bool(self.heads or self.scales or self.indoors)


def write_network(
    model: Path | Sequence[Path],
    out: Path,
    kind: str | None = None,
    precision: Precision = "float32",
    calibrate: Path | None = None,
    photos: int = 128,
    trained_on: str = "",
    without_colour: bool = False,
    flips: bool = False,
    shares: Sequence[float] = (),
    refinement: "Refinement | None" = None,
) -> ModelContract:
    """Write a trained network to `out`; gives the contract in the file.

    Args:
        model: folder of a training run, a best.safetensors, or an .onnx of ours; several of them
            become one file that answers with the mean of their light (ONNX only).
        out: file to write.
        kind: onnx or tflite; left out, the suffix of `out` decides.
        precision: float32, float16, int8-weights or int8; the last two are TFLite's.
        calibrate: data set whose training photos choose the integers.
        photos: number of them.
        trained_on: what a run was trained on, in words; the file keeps them.
        without_colour: leave out what a run learnt of the photo's colour (`network.colour`).
        flips: answer the mirrored photo too and take the mean, at twice the cost (ONNX only).
        shares: of each network in the mean; left out, all alike.
        refinement: changes to one network after its training.

    Raises:
        InputError: the model, the settings or the data set cannot be used.
    """
    models = [model] if isinstance(model, Path) else list(model)
    form = _format_of(out, kind, precision, calibrate is not None)
    if shares and len(models) == 1:
        raise ConfigError("several networks for --shares", "one", "leave it out")
    if form != "onnx" and (flips or len(models) > 1):
        do = "write .onnx, or train one network that answers as they do (distil.teacher)"
        got = f"{len(models)}{' with --flips' * flips}"
        raise ConfigError("one network, without --flips, for TFLite", got, do)
    if form != "onnx" and refinement is not None and refinement.of_heads:
        got = "TFLite, whose files hold light only"
        raise ConfigError("ONNX for --heads, --scales and --indoors", got, "leave it out")
    generator, contract = _loaded(models, flips, shares, trained_on, without_colour)
    if refinement is not None and refinement != Refinement():
        contract = _refined(generator, contract, refinement)
    if form == "onnx":
        from deeplight.deploy.onnx import export_onnx

        export_onnx(generator, contract, out, float16=precision == "float16")
    else:
        from deeplight.deploy.litert import export_litert

        examples = None
        if calibrate is not None and precision.startswith("int8"):
            examples = _calibration_photos(calibrate, photos, contract)
        export_litert(generator, contract, out, precision, examples)
    return contract


def _loaded(
    models: Sequence[Path],
    flips: bool,
    shares: Sequence[float],
    trained_on: str,
    without_colour: bool,
) -> "tuple[nn.Module, ModelContract]":
    """One network as it is; several, or one with flips, as their mean, and the contract of that.

    Raises:
        ModelError: one cannot be read, or they do not take the same photos.
    """
    from deeplight.training.model_file import load_network
    from deeplight.training.network.average import Average

    networks = [load_network(path, trained_on) for path in models]
    if without_colour:
        for generator, _ in networks:
            generator.colour = None
    if len(networks) == 1 and not flips and not shares:
        return networks[0]
    contract = networks[0][1]
    for path, (_, other) in zip(models, networks, strict=True):
        if _view(other) != _view(contract):
            got = f"{path} that does not"
            raise ModelError(f"networks that see and give what {models[0]} does", got, "leave it")
    both = 2 if flips else 1
    parts = "; ".join(dict.fromkeys(other.trained_on for _, other in networks))
    contract = replace(
        contract,
        lamps=both * sum(other.lamps for _, other in networks),
        mirrored=False,
        heads=(),
        trained_on=f"mean of {len(networks)}{', flipped too' * flips}: {parts}",
    )
    return Average([generator for generator, _ in networks], flips, shares), contract


def _refined(
    generator: "nn.Module", contract: ModelContract, refinement: Refinement
) -> ModelContract:
    """Change one network after its training; gives its contract."""
    from deeplight.training.heads import set_indoors, set_scales, teach
    from deeplight.training.network.generator import Generator

    if not isinstance(generator, Generator):
        expected = "one network for --heads, --scales, --indoors and --lamp-gain"
        raise ConfigError(expected, "a mean", "leave them out")
    if refinement.lamp_gain:
        if generator.lamps is None:
            raise ConfigError("a network with lamps for --lamp-gain", "none", "leave it out")
        generator.lamps.brighten(refinement.lamp_gain)
    if refinement.heads:
        generator.heads, _ = teach(generator, refinement.heads)
        contract = replace(contract, heads=HEADS)
    if refinement.scales or refinement.indoors:
        if generator.heads is None:
            expected = "a network with heads for --scales and --indoors"
            raise ConfigError(expected, "none", "give --heads too")
        if refinement.scales:
            set_scales(generator, generator.heads, refinement.scales)
        if refinement.indoors:
            set_indoors(generator, generator.heads, refinement.indoors)
    return contract


def _view(contract: ModelContract) -> tuple[Any, ...]:
    """What a network is fed and what it gives."""
    size = (contract.height, contract.width, contract.output_size)
    return *size, contract.top, contract.bottom, contract.right, contract.gamma


def _format_of(out: Path, kind: str | None, precision: str, calibrated: bool) -> str:
    """onnx or tflite, and whether it can have the precision asked for."""
    form = kind or FORMATS.get(out.suffix.lower())
    if form is None:
        raise ConfigError("--out FILE.onnx or FILE.tflite", f"{out}", "or give --format")
    if FORMATS.get(out.suffix.lower(), form) != form:
        got = f"{out} for {form}"
        raise ConfigError("a file name of the format", got, "change --out or --format")
    if form == "onnx" and precision.startswith("int8"):
        do = "use --format tflite, or float16"
        raise ConfigError("float32 or float16 for ONNX", precision, do)
    if precision.startswith("int8") and not calibrated:
        raise ConfigError(f"photos for {precision}", "none", "give --calibrate DATA")
    return form


def _calibration_photos(
    folder: Path, count: int, contract: ModelContract
) -> Float32[np.ndarray, "photos 3 height width"]:
    """Training photos of a data set as the network gets them, evenly spread over the split."""
    from deeplight.dataset import open_dataset
    from deeplight.preprocess import landscape_background, normalise

    index = open_dataset(folder).index("train")
    chosen = np.unique(np.linspace(0, len(index) - 1, count).astype(int))
    backgrounds: list[Any] = [index.pixels(int(number))[0] for number in chosen]
    if contract.width > contract.height:
        backgrounds = [landscape_background(background) for background in backgrounds]
    return normalise(np.stack(backgrounds))


def write_best_network(run_dir: Path, path: Path, data: str = "", float16: bool = True) -> None:
    """Write the best weights of a run as an ONNX file with its contract."""
    from deeplight.deploy.onnx import export_onnx
    from deeplight.training.release import contract_of, load_best

    generator, header = load_best(run_dir)
    export_onnx(generator, contract_of(header, data), path, float16)
