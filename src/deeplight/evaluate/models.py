"""The networks of an evaluation, each under the name that tables call it."""

import contextlib
import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float32

from deeplight.camera import BACKGROUND_FRACTION, TRAINED_VERTICAL_FOV_RAD
from deeplight.contract import ModelContract
from deeplight.errors import ConfigError, ModelError
from deeplight.estimators.network import NetworkEstimator
from deeplight.estimators.onnx import shipped_model
from deeplight.estimators.open import ClassEstimator, open_model
from deeplight.io.photo_like import PhotoLike
from deeplight.lamp import Lamp
from deeplight.lighting import Lighting
from deeplight.preprocess import frame_photo, network_input

RECORD = "run.toml"
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9 _.+-]{0,39}")


class NamedModel:
    """A network under a name of one's own, which takes the data set's pictures whatever its shape.

    A landscape network (section 4.3) is given its own view, cut from the portrait background.
    """

    def __init__(self, name: str, network: NetworkEstimator) -> None:
        self._name, self.network = name, network

    @property
    def name(self) -> str:
        """What tables call it."""
        return self._name

    @property
    def facts(self) -> dict[str, str]:
        """What a report says of it: file, hash, and what it was trained on."""
        return {
            "file": self.network.path.name,
            "sha256": self.network.sha256,
            "trained_on": self.network.contract.trained_on,
        }

    def estimate(self, photo: PhotoLike) -> Lighting:
        """Estimate the light of one photo of any size, in the photo's camera frame."""
        return self.network.estimate(photo)

    def estimate_inputs(
        self, inputs: Float32[np.ndarray, "batch 3 height width"]
    ) -> Float32[np.ndarray, "batch size size 3"]:
        """Give ln radiance for the data set's pictures, in [-0.5, 0.5]."""
        return self.network.estimate_inputs(self._own_views(inputs))

    def estimate_fully(
        self, inputs: Float32[np.ndarray, "batch 3 height width"]
    ) -> tuple[
        Float32[np.ndarray, "batch size size 3"], list[tuple[Lamp, ...]], list[dict[str, float]]
    ]:
        """The same with the network's lamps, which the ln radiance holds, and its heads."""
        return self.network.estimate_fully(self._own_views(inputs))

    def _own_views(self, inputs: Float32[np.ndarray, "batch 3 height width"]) -> np.ndarray:
        contract = self.network.contract
        if inputs.shape[2:] == (contract.height, contract.width):
            return inputs
        return np.stack([_own_view(picture, contract) for picture in inputs])


def named_models(given: Sequence[str]) -> list[NamedModel]:
    """Open the models that `--model` names, in that order; left out, the one in the package.

    Each is a file, NAME=file, or a folder of training runs, whose models go by their run's name.

    Raises:
        ModelError: a file or a folder has no usable model, or a run has no run.toml.
        ConfigError: a name that would not fit a table, or one twice.
    """
    if not given:
        return [NamedModel("deeplight", open_model())]
    models = []
    for item in given:
        name, equals, path = item.rpartition("=")
        if equals and not _NAME.fullmatch(name):
            expected = "a model's name of letters, digits and _ . + - (at most 40)"
            raise ConfigError(expected, repr(name), "write --model NAME=FILE")
        if Path(path).is_dir():
            models += [NamedModel(own, open_model(file)) for own, file in _runs(Path(path), name)]
        else:
            network = open_model(path)
            is_class = isinstance(network, ClassEstimator)
            own = name or (network.name if is_class else _own_name(Path(path)))
            models.append(NamedModel(own, network))
    return models


def _own_name(path: Path) -> str:
    """The file's name without its ending; the model of the package is "deeplight" by any path."""
    with contextlib.suppress(OSError):
        if path.samefile(shipped_model()):
            return "deeplight"
    return path.stem


def _runs(folder: Path, name: str) -> list[tuple[str, Path]]:
    """The models of a run's folder, or of a folder of runs, with the names of their runs."""
    files = sorted(folder.glob("*.onnx")) or sorted(folder.glob("*/*.onnx"))
    if not files:
        do = "export one with `deeplight train --export FILE`, or give the file"
        raise ModelError("models (.onnx) of training runs", f"none in {folder}", do)
    found = []
    for file in files:
        if not (file.parent / RECORD).is_file():
            got = f"{file} without it"
            raise ModelError(f"{RECORD} next to each model of a run", got, "give NAME=FILE instead")
        alone = len(list(file.parent.glob("*.onnx"))) == 1
        own = file.parent.name if alone else f"{file.parent.name}-{file.stem}"
        found.append((name if name and len(files) == 1 else own, file))
    return found


def _own_view(
    picture: Float32[np.ndarray, "3 height width"], contract: ModelContract
) -> Float32[np.ndarray, "3 own_height own_width"]:
    """The part of a background that a network of another shape sees."""
    pixels = np.round((picture.transpose(1, 2, 0) + 0.5) * 255).astype(np.uint8)
    height, width, _ = pixels.shape
    whole = round(height / BACKGROUND_FRACTION)  # the frame's lower part was cut away
    frame = np.concatenate([pixels, np.repeat(pixels[-1:], whole - height, axis=0)])
    framing = frame_photo(whole, width, TRAINED_VERTICAL_FOV_RAD, "given", contract)
    return network_input(frame, framing)
