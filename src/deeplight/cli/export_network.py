"""The work of `deeplight export`: the network's file, its format, its photos to calibrate with."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from deeplight.contract import ModelContract
from deeplight.errors import ConfigError

if TYPE_CHECKING:
    import numpy as np

    from deeplight.cli.export import Args

FORMATS = {".onnx": "onnx", ".tflite": "tflite"}


def exported(args: "Args") -> ModelContract:
    """Write the file; gives the contract in it.

    Raises:
        InputError: the model, the settings or the data set cannot be used.
    """
    form = format_of(args)
    from deeplight.training.model_file import load_network

    generator, contract = load_network(args.model, args.trained_on)
    if form == "onnx":
        from deeplight.deploy.onnx import export_onnx

        export_onnx(generator, contract, args.out, float16=args.precision == "float16")
    else:
        from deeplight.deploy.litert import export_litert

        photos = None
        if args.calibrate is not None and args.precision.startswith("int8"):
            photos = calibration_photos(args.calibrate, args.photos, contract)
        export_litert(generator, contract, args.out, args.precision, photos)
    return contract


def format_of(args: "Args") -> str:
    """onnx or tflite, and whether it can have the precision asked for."""
    form = args.format or FORMATS.get(args.out.suffix.lower())
    if form is None:
        raise ConfigError("--out FILE.onnx or FILE.tflite", f"{args.out}", "or give --format")
    if FORMATS.get(args.out.suffix.lower(), form) != form:
        got = f"{args.out} for {form}"
        raise ConfigError("a file name of the format", got, "change --out or --format")
    if form == "onnx" and args.precision.startswith("int8"):
        do = "use --format tflite, or float16"
        raise ConfigError("float32 or float16 for ONNX", args.precision, do)
    if args.precision.startswith("int8") and args.calibrate is None:
        raise ConfigError(f"photos for {args.precision}", "none", "give --calibrate DATA")
    return form


def calibration_photos(folder: Path, count: int, contract: ModelContract) -> "np.ndarray":
    """Training photos of a data set as the network gets them, evenly spread over the split."""
    import numpy as np

    from deeplight.dataset import open_dataset
    from deeplight.preprocess import landscape_background, normalise

    index = open_dataset(folder).index("train")
    chosen = np.unique(np.linspace(0, len(index) - 1, count).astype(int))
    backgrounds: list[Any] = [index.pixels(int(number))[0] for number in chosen]
    if contract.width > contract.height:
        backgrounds = [landscape_background(background) for background in backgrounds]
    return normalise(np.stack(backgrounds))
