"""From a trained network to the file that estimates: ONNX or TFLite, with its contract."""

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32

from deeplight.contract import ModelContract
from deeplight.deploy.precision import Precision
from deeplight.errors import ConfigError

FORMATS = {".onnx": "onnx", ".tflite": "tflite"}


def write_network(
    model: Path,
    out: Path,
    kind: str | None = None,
    precision: Precision = "float32",
    calibrate: Path | None = None,
    photos: int = 128,
    trained_on: str = "",
    without_colour: bool = False,
) -> ModelContract:
    """Write a trained network to `out`; gives the contract in the file.

    Args:
        model: folder of a training run, a best.safetensors, or an .onnx of ours.
        out: file to write.
        kind: onnx or tflite; left out, the suffix of `out` decides.
        precision: float32, float16, int8-weights or int8; the last two are TFLite's.
        calibrate: data set whose training photos choose the integers.
        photos: number of them.
        trained_on: what a run was trained on, in words; the file keeps them.
        without_colour: leave out what a run learnt of the photo's colour (`network.colour`).

    Raises:
        InputError: the model, the settings or the data set cannot be used.
    """
    form = _format_of(out, kind, precision, calibrate is not None)
    from deeplight.training.model_file import load_network

    generator, contract = load_network(model, trained_on)
    if without_colour:
        generator.colour = None
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
