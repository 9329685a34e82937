"""From a trained network to the file that estimates: ONNX or TFLite, with its contract."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float32

from deeplight.contract import HEADS, ModelContract
from deeplight.deploy.precision import Precision
from deeplight.errors import ConfigError, ModelError

if TYPE_CHECKING:
    from torch import nn

FORMATS = {".onnx": "onnx", ".tflite": "tflite"}


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
    heads: Sequence[str] = (),
    lamp_gain: float = 0.0,
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
        heads: data sets whose photos teach the network to say what camera took a photo and how
            sure its light is (`training.heads`), after it has been trained.
        lamp_gain: ln of what the lamps' flux is multiplied by: on new places a network makes them
            fainter than they are. To be chosen on validation places.

    Raises:
        InputError: the model, the settings or the data set cannot be used.
    """
    models = [model] if isinstance(model, Path) else list(model)
    form = _format_of(out, kind, precision, calibrate is not None)
    if form != "onnx" and (flips or len(models) > 1):
        do = "write .onnx, or train one network that answers as they do (distil.teacher)"
        raise ConfigError("one network, without --flips, for TFLite", f"{len(models)}", do)
    generator, contract = _loaded(models, flips, shares, trained_on, without_colour)
    if lamp_gain or heads:
        contract = _refined(generator, contract, lamp_gain, heads)
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
    generator: "nn.Module", contract: ModelContract, lamp_gain: float, heads: Sequence[str]
) -> ModelContract:
    """Change one network after its training as `write_network` says; gives its contract."""
    from deeplight.training.heads import teach
    from deeplight.training.network.generator import Generator

    if not isinstance(generator, Generator):
        raise ConfigError("one network for --heads and --lamp-gain", "a mean", "leave them out")
    if lamp_gain and generator.lamps is not None:
        generator.lamps.brighten(lamp_gain)
    if heads:
        generator.heads, _ = teach(generator, heads)
        contract = replace(contract, heads=HEADS)
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
