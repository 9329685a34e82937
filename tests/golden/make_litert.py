"""Writes tiny.onnx, tiny.tflite and tiny-int8.tflite: one network of random weights, three files.

Run in the environment that docs/export.md describes: python tests/golden/make_litert.py
"""

from pathlib import Path

import numpy as np
import torch

from deeplight.contract import ModelContract
from deeplight.deploy.litert import export_litert
from deeplight.deploy.onnx import export_onnx
from deeplight.training.network.generator import Generator, NetworkConfig

HERE = Path(__file__).resolve().parent
SHAPE = NetworkConfig(
    latent_size=16,
    decoder_widths=(8, 8),
    encoder_norm="none",
    decoder_norm="none",
    width=0.05,
    output_size=16,
)


def main() -> None:
    """Write the files."""
    torch.manual_seed(0)
    network = Generator(SHAPE).eval()
    torch.nn.init.normal_(network.decoder.up3.weight, std=0.1)  # the spread of a trained network
    contract = ModelContract(output_size=SHAPE.output_size, trained_on="random weights")
    photos = np.random.default_rng(0).uniform(-0.5, 0.5, (16, 3, 1, 1)).astype(np.float32)
    photos = np.broadcast_to(photos, (16, 3, contract.height, contract.width)).copy()
    export_onnx(network, contract, HERE / "tiny.onnx", float16=False)
    export_litert(network, contract, HERE / "tiny.tflite")
    export_litert(network, contract, HERE / "tiny-int8.tflite", "int8", photos)


if __name__ == "__main__":
    main()
