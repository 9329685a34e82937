"""A trained network as a TFLite file for LiteRT, with its contract inside."""

import copy
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float32
from torch import Tensor, nn

from deeplight.contract import ModelContract
from deeplight.deploy.precision import Precision
from deeplight.deploy.rounding import round_weights
from deeplight.errors import ConfigError, MissingExtraError
from deeplight.io.atomic import replacing
from deeplight.io.quiet import quiet

LEAST_PHOTOS = 16

SIGNATURE = "serving_default"
EXACT = (".*Decoder.*",)
"""Layers, by the names of their tensors, that `int8` leaves in float32: one of the decoder's steps
in 8 bits would be 5 % of radiance, and it does a twentieth of the work."""


def export_litert(
    generator: nn.Module,
    contract: ModelContract,
    path: Path,
    precision: Precision = "float32",
    photos: Float32[np.ndarray, "n 3 height width"] | None = None,
) -> None:
    """Write `generator` (evaluation mode, batch norm folded, on the CPU) to `path`.

    The file has one output: lamps are in its light, but are not given by themselves.

    Args:
        precision: float32; float16: weights stored in half precision, computed as the device
            likes (float32 on a CPU); int8-weights: weights of 8 bits, computed in float32; int8:
            weights and signals of 8 bits but for the decoder. Input and output are float32.
        photos: real photos in the contract's range, for the two int8; 100 are enough.

    Raises:
        ConfigError: int8 without enough photos, or of a network with lamps.
        MissingExtraError: the converter is not installed.
    """
    if find_spec("litert_torch") is None:
        raise MissingExtraError("tflite", "writing TFLite (in an environment of its own)")
    if precision == "int8" and contract.lamps:
        expected = "float32, float16 or int8-weights for a network with lamps"
        raise ConfigError(expected, precision, "8 bits are too few for a lamp's direction")
    network, contract = copy.deepcopy(generator).eval(), replace(contract, lamps=0, heads=())
    if precision.startswith("int8"):
        if photos is None or len(photos) < LEAST_PHOTOS:
            got = "none" if photos is None else f"{len(photos)}"
            expected = f"{LEAST_PHOTOS} photos or more to choose integers with"
            raise ConfigError(expected, got, "give --calibrate DATA, a data set")
        round_weights(network, torch.from_numpy(photos))
    with quiet():
        model = converted(network, contract)
        if precision != "float32":
            model = quantised(model, contract, precision, photos)
    from deeplight.deploy.tflite_file import finished

    with replacing(path) as temporary:
        temporary.write_bytes(finished(model, contract))


class Named(nn.Module):
    """The network with the contract's names for input and output."""

    def __init__(self, network: nn.Module, contract: ModelContract) -> None:
        super().__init__()
        self.network, self.name = network, contract.output_name

    def forward(self, photo: Tensor) -> dict[str, Tensor]:
        return {self.name: self.network(photo)}


def converted(network: nn.Module, contract: ModelContract) -> bytes:
    """The network as a TFLite model of float32, for one photo."""
    import litert_torch

    photo = torch.zeros(1, 3, contract.height, contract.width)
    model = litert_torch.convert(
        Named(network, contract).eval(), sample_kwargs={contract.input_name: photo}
    )
    return bytes(model.model_content())


def quantised(
    model: bytes, contract: ModelContract, precision: Precision, photos: np.ndarray | None
) -> bytes:
    """The model with what it stores, and for int8 what it computes with, in fewer bits."""
    from ai_edge_quantizer import quantizer

    work, rules = quantizer.Quantizer(bytearray(model)), recipe(precision)
    work.load_quantization_recipe(rules.get_quantization_recipe())
    found = None
    if work.need_calibration:
        assert photos is not None
        found = signal_ranges(model, contract, rules, photos)
    done = work.quantize(found, enable_progress_bar=False, enable_progress_report=False)
    return bytes(done.quantized_model)


def signal_ranges(
    model: bytes,
    contract: ModelContract,
    rules: Any,
    photos: Float32[np.ndarray, "n 3 height width"],
) -> dict[str, Any]:
    """Least and greatest value of every signal over all photos.

    The quantiser's own default, a moving average over photos, cuts the few photos off that make
    a layer answer most: their light was off by a factor of up to 1.5.
    """
    from ai_edge_quantizer import calibrator
    from ai_edge_quantizer.utils import qsv_utils

    watching = calibrator.Calibrator(model, num_threads=1, qsv_update_func=qsv_utils.min_max_update)
    watching.calibrate({SIGNATURE: [{contract.input_name: photo[None]} for photo in photos]}, rules)
    return dict(watching.get_model_qsvs())


def recipe(precision: Precision) -> Any:
    """What the quantiser is to do, as its rules."""
    from ai_edge_quantizer import qtyping, recipe_manager
    from ai_edge_quantizer.algorithm_manager import AlgorithmName

    operation, rules = qtyping.TFLOperationName, recipe_manager.RecipeManager()
    every = (operation.CONV_2D, operation.DEPTHWISE_CONV_2D, operation.FULLY_CONNECTED)
    if precision == "float16":
        halved = qtyping.OpQuantizationConfig(
            weight_tensor_config=qtyping.TensorQuantizationConfig(
                num_bits=16, dtype=qtyping.TensorDataType.FLOAT
            ),
            compute_precision=qtyping.ComputePrecision.FLOAT,
            explicit_dequantize=True,
        )
        for name in every:
            rules.add_quantization_config(".*", name, halved, AlgorithmName.FLOAT_CASTING)
    elif precision == "int8-weights":
        rules.add_weight_only_config(".*", operation.ALL_SUPPORTED, num_bits=8)
    else:
        rules.add_static_config(
            ".*", operation.ALL_SUPPORTED, activation_num_bits=8, weight_num_bits=8
        )
        left = [(".*", operation.INPUT), (".*", operation.OUTPUT)]
        for pattern, name in [*left, *((layer, operation.ALL_SUPPORTED) for layer in EXACT)]:
            rules.add_quantization_config(pattern, name, algorithm_key=AlgorithmName.NO_QUANTIZE)
    return rules
