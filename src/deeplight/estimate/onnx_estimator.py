"""The network as an estimator: an ONNX file that carries its own contract."""

import hashlib
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import resources
from math import degrees, radians
from pathlib import Path

import numpy as np
import onnxruntime as ort
from jaxtyping import Float32

from deeplight.contract import CONTRACT_KEY, ModelContract
from deeplight.errors import ModelError
from deeplight.estimate.estimator import PhotoLike, as_photo
from deeplight.io.image import Photo
from deeplight.lighting import Lighting
from deeplight.preprocess import Framing, frame_photo, network_input

MAX_THREADS = 4
"""More threads than this make so small a network slower, not faster."""

WHOLE_VIEW = 0.995
"""From this visible fraction on the photo counts as showing the whole trained view."""


@dataclass(frozen=True)
class Estimate:
    """One photo's light and how it came about.

    Attributes:
        lighting: the result, in the photo's camera frame.
        photo: what was read.
        framing: the part of the photo the network saw.
        notes: what the user should know, one line each; the photo's own notes come first.
        seconds: time spent on "read", "prepare" and "network".
    """

    lighting: Lighting
    photo: Photo
    framing: Framing
    notes: tuple[str, ...]
    seconds: Mapping[str, float]


class OnnxEstimator:
    """Runs a model exported by `deeplight.export.onnx`.

    Args:
        model_path: left out, the model shipped with the package.
        threads: cores the network may use; left out, all that this process has, at most 4.

    Raises:
        ModelError: no such file, no ONNX model, not one of ours, or one of another version.
    """

    def __init__(self, model_path: Path | str | None = None, threads: int | None = None) -> None:
        self.path = shipped_model() if model_path is None else Path(model_path)
        self._session = _open(self.path, threads or min(MAX_THREADS, _cores()))
        self.contract = _contract(self._session, self.path)

    @property
    def name(self) -> str:
        """What tables call it."""
        return "deeplight"

    @cached_property
    def sha256(self) -> str:
        """Hash of the model file, written beside every result."""
        return hashlib.sha256(self.path.read_bytes()).hexdigest()

    def estimate(self, photo: PhotoLike, fov_deg: float | None = None) -> Lighting:
        """Estimate the light of one photo; see `deeplight.estimate`."""
        return self.explain(photo, fov_deg).lighting

    def explain(self, photo: PhotoLike, fov_deg: float | None = None) -> Estimate:
        """Estimate the light of one photo and tell how: framing, notes, times.

        Raises:
            InputError: the photo or the field of view cannot be used.
            OSError: the file cannot be read.
        """
        started = time.perf_counter()
        opened = as_photo(photo)
        read = time.perf_counter()
        framing = self.frame(opened, fov_deg)
        inputs = network_input(opened.pixels, framing)[None]
        prepared = time.perf_counter()
        log_radiance = self.estimate_inputs(inputs)[0]
        done = time.perf_counter()
        seconds = {"read": read - started, "prepare": prepared - read, "network": done - prepared}
        lighting = Lighting.from_log_radiance(log_radiance)
        return Estimate(lighting, opened, framing, opened.notes + _notes(framing), seconds)

    def frame(self, photo: Photo, fov_deg: float | None = None) -> Framing:
        """Find the trained view in a photo: a given field of view wins over the EXIF data's."""
        height, width, _ = photo.pixels.shape
        if fov_deg is not None:
            return frame_photo(height, width, radians(fov_deg), "given", self.contract)
        return frame_photo(height, width, photo.vertical_fov_rad, "exif", self.contract)

    def estimate_inputs(
        self, inputs: Float32[np.ndarray, "batch 3 height width"]
    ) -> Float32[np.ndarray, "batch size size 3"]:
        """Give ln radiance for pictures already brought to the trained view and to [-0.5, 0.5].

        Raises:
            ModelError: the network gives NaN or more radiance than a float holds.
        """
        feed = {self.contract.input_name: np.ascontiguousarray(inputs, np.float32)}
        (output,) = self._session.run([self.contract.output_name], feed)
        log_radiance: np.ndarray = output.transpose(0, 2, 3, 1)
        if not np.all(log_radiance < np.log(np.finfo(np.float32).max)):  # false for nan as well
            got = f"{self.path} that gives NaN or infinite light"
            raise ModelError("a trained model", got, "use another model file")
        return log_radiance


def shipped_model() -> Path:
    """Give the path of the model inside the package.

    Raises:
        ModelError: this installation has none.
    """
    path = Path(str(resources.files("deeplight") / "weights" / "deeplight.onnx"))
    if not path.is_file():
        do = "install deeplight again or give --model FILE"
        raise ModelError("the model that comes with deeplight", f"no file {path}", do)
    return path


def _open(path: Path, threads: int) -> ort.InferenceSession:
    if not path.is_file():
        got = f"{path}, which is a folder" if path.is_dir() else f"no file {path}"
        raise ModelError("a model file", got, "give the path of a .onnx file")
    options = ort.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = 4  # faults come as exceptions; stderr is for our one line
    # Threads that spin while they wait would keep whole cores busy between two photos.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    try:
        return ort.InferenceSession(path.read_bytes(), options, ["CPUExecutionProvider"])
    except OSError as error:
        raise ModelError(
            "a readable model file", f"{path}: {error.strerror}", "check it"
        ) from error
    except Exception as error:  # onnxruntime has no common base class for its errors
        got = f"{path}, which onnxruntime cannot load"
        raise ModelError("an ONNX model", got, "give a .onnx file of deeplight") from error


def _contract(session: ort.InferenceSession, path: Path) -> ModelContract:
    """Read the model's contract and check that the network keeps it."""
    text = session.get_modelmeta().custom_metadata_map.get(CONTRACT_KEY)
    if text is None:
        got = f"{path} without a '{CONTRACT_KEY}' entry"
        raise ModelError("a model exported by deeplight", got, "give a .onnx file of deeplight")
    contract = ModelContract.from_json(text)
    inputs = {entry.name: entry.shape[1:] for entry in session.get_inputs()}
    outputs = {entry.name: entry.shape[1:] for entry in session.get_outputs()}
    size = contract.output_size
    keeps_input = inputs == {contract.input_name: [3, contract.height, contract.width]}
    if not keeps_input or outputs.get(contract.output_name) != [3, size, size]:
        got = f"{path} with inputs {inputs} and outputs {outputs}"
        raise ModelError("a model that keeps its own contract", got, "export it again")
    return contract


def _cores() -> int:
    """Cores this process may use, which in a container are often fewer than the machine has."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _notes(framing: Framing) -> tuple[str, ...]:
    """Say in plain words what the photo's field of view costs."""
    notes = []
    if framing.fov_source == "assumed":
        fov = degrees(framing.vertical_fov_rad)
        notes.append(f"field of view unknown, assumed {fov:.0f} degrees vertically: give --fov")
    if framing.visible_fraction < WHOLE_VIEW:
        seen = f"{framing.visible_fraction:.0%} of the view the network was trained on"
        notes.append(f"the photo shows {seen}; its edges fill the rest, which costs accuracy")
    return tuple(notes)
