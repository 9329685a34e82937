"""A network as an estimator, whatever runs it: photo in, framing, light and notes out."""

import gc
import hashlib
import os
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import islice
from math import degrees, radians
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32

from deeplight.contract import LAMP_NUMBERS, ModelContract
from deeplight.errors import ModelError, ShapeError
from deeplight.estimators.calibration import Calibration, Use
from deeplight.estimators.look import Answer, seen_from_photo
from deeplight.estimators.upright import turn_notes
from deeplight.frames import normalised
from deeplight.io.photo_like import PhotoLike, as_photo
from deeplight.io.photos import Photo
from deeplight.lamp import Lamp
from deeplight.lighting import Lighting
from deeplight.preprocess import (
    FovSource,
    Framing,
    frame_photo,
    looks,
    network_input,
    slid_into_photo,
)

MAX_THREADS = 4
"""More threads than this make so small a network slower, not faster."""

NETWORK_SIDE = 896
"""Pixels along a photo's longer side that the network's input needs: from this number on the light
differs by 0.016 in ln radiance from the whole photo's, from half of them by 0.05."""

WHOLE_VIEW = 0.995
"""From this visible fraction on the photo counts as showing the whole trained view."""

# A forked process (of torch's DataLoader, say) that frees a session waits for ever for threads that
# only its parent has. What it inherits as garbage stays where it is.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=gc.freeze)


@dataclass(frozen=True)
class Estimate:
    """One photo's light and how it came about.

    Attributes:
        lighting: the result, in the photo's camera frame.
        photo: what was read.
        framing: the trained view in the photo; `preprocess.looks` says what the network saw.
        notes: what the user should know, one line each; the photo's own notes come first.
        seconds: time spent on "read", "prepare" and "network".
        lamps: compact lights, the strongest first, in the frame and unit of `lighting`, which holds
            them already (`lobe.lobe_on_ball` is how); none from a network without lamps.
    """

    lighting: Lighting
    photo: Photo
    framing: Framing
    notes: tuple[str, ...]
    seconds: Mapping[str, float]
    lamps: tuple[Lamp, ...] = ()
    heads: Mapping[str, float] = field(default_factory=dict)
    """What the network says of the camera and of how sure it is (`contract.HEADS`), by name."""


class NetworkEstimator(ABC):
    """What every runtime's estimator does alike.

    Attributes:
        path: the model's file.
        contract: what it says of itself.
        calibration: what `deeplight calibrate` put into it, if it did.
        calibrated: which light has that. Prepared pictures state no camera: theirs has it, unless
            this is "never".
    """

    path: Path
    contract: ModelContract
    calibration: Calibration | None = None
    calibrated: Use = "matching"

    @property
    def name(self) -> str:
        """What tables call it."""
        return "deeplight"

    @cached_property
    def sha256(self) -> str:
        """Hash of the model file, written next to every result."""
        return hashlib.sha256(self.path.read_bytes()).hexdigest()

    def estimate(self, photo: PhotoLike, fov_deg: float | None = None) -> Lighting:
        """Estimate the light of one photo; see `deeplight.estimate`."""
        return self.explain(photo, fov_deg).lighting

    def explain(
        self,
        photo: PhotoLike,
        fov_deg: float | None = None,
        max_side: int | None = NETWORK_SIDE,
    ) -> Estimate:
        """Estimate the light of one photo and say how: framing, notes, times.

        Args:
            photo: of it.
            fov_deg: vertical field of view of the upright photo; left out, EXIF's or assumed.
            max_side: for files, as `read_photo` takes it; None reads all their pixels.

        Raises:
            InputError: the photo or the field of view cannot be used.
            OSError: the file cannot be read.
        """
        return self.explain_many([photo], fov_deg, max_side)[0]

    def explain_many(
        self,
        photos: Sequence[PhotoLike],
        fov_deg: float | None = None,
        max_side: int | None = NETWORK_SIDE,
    ) -> list[Estimate]:
        """As `explain`, with one call of the network for all; times are shared out evenly.

        Raises:
            InputError: a photo or the field of view cannot be used.
            OSError: a file cannot be read.
        """
        started = time.perf_counter()
        opened = [as_photo(photo, max_side) for photo in photos]
        read = time.perf_counter()
        framings = [self.frame(photo, fov_deg) for photo in opened]
        views = [looks(framing) for framing in framings]
        inputs = np.stack(
            [network_input(p.pixels, v) for p, own in zip(opened, views, strict=True) for v in own]
        )
        prepared = time.perf_counter()
        answers = map(Answer, *self.estimate_fully(inputs))
        done = time.perf_counter()
        whole = {"read": read - started, "prepare": prepared - read, "network": done - prepared}
        seconds = {name: value / len(opened) for name, value in whole.items()}
        return [
            self._estimate_of(photo, framing, seconds, list(islice(answers, len(own))), own)
            for photo, framing, own in zip(opened, framings, views, strict=True)
        ]

    def _estimate_of(
        self,
        photo: Photo,
        framing: Framing,
        seconds: Mapping[str, float],
        answers: Sequence[Answer],
        views: Sequence[Framing],
    ) -> Estimate:
        """One photo's estimate from the network's answers, for the camera that took it."""
        own, use = self.calibration, self.calibrated
        notes: tuple[str, ...] = ()
        if own is not None:
            notes = own.note(photo.camera, use)
            if use != "never" and not own.suits(photo.camera, use):
                answers = [
                    replace(
                        answer,
                        log_radiance=own.light_without(answer.log_radiance),
                        lamps=own.lamps_without(answer.lamps),
                    )
                    for answer in answers
                ]
        whole = seen_from_photo(answers, views)
        notes = photo.notes + _notes(framing) + turn_notes(whole.heads) + notes
        light = Lighting.from_log_radiance(whole.log_radiance)
        return Estimate(light, photo, framing, notes, seconds, whole.lamps, whole.heads)

    def frame(self, photo: Photo, fov_deg: float | None = None) -> Framing:
        """Find the trained view in a photo: a given field of view wins over the EXIF data's."""
        height, width, _ = photo.pixels.shape
        source: FovSource = "exif" if fov_deg is None else "given"
        fov_rad = photo.vertical_fov_rad if fov_deg is None else radians(fov_deg)
        return slid_into_photo(frame_photo(height, width, fov_rad, source, self.contract))

    def estimate_inputs(
        self, inputs: Float32[np.ndarray, "batch 3 height width"]
    ) -> Float32[np.ndarray, "batch size size 3"]:
        """Give ln radiance for pictures already brought to the trained view and to [-0.5, 0.5].

        Raises:
            ModelError: the network cannot be run, or gives NaN or more radiance than a float holds.
        """
        output: np.ndarray = self._answer(self.run, inputs)
        log_radiance = self._light(output, len(inputs))
        if self.calibration is None or self.calibrated != "never":
            return log_radiance
        return self.calibration.light_without(log_radiance)

    def estimate_fully(
        self, inputs: Float32[np.ndarray, "batch 3 height width"]
    ) -> tuple[
        Float32[np.ndarray, "batch size size 3"], list[tuple[Lamp, ...]], list[dict[str, float]]
    ]:
        """As `estimate_inputs`, the lamps of each picture, the strongest first, and its heads.

        Raises:
            ModelError: the network cannot be run, or gives NaN or more than a float holds.
        """
        output, lamps, heads = self._answer(self.run_fully, inputs)
        log_radiance = self._light(output, len(inputs))
        if not np.isfinite(heads).all():
            got = f"{self.path} that gives NaN or infinite numbers"
            raise ModelError("a trained model", got, "use another model file")
        said = [dict(zip(self.contract.heads, row.tolist(), strict=True)) for row in heads]
        try:
            found = [lamps_of(numbers) for numbers in lamps]
            if self.calibration is not None and self.calibrated == "never":
                found = [self.calibration.lamps_without(own) for own in found]
                log_radiance = self.calibration.light_without(log_radiance)
            return log_radiance, found, said
        except (ShapeError, ValueError) as error:
            got = f"{self.path} that gives impossible lamps"
            raise ModelError("a trained model", got, "use another model file") from error

    def _answer(self, network: Callable[[Any], Any], inputs: np.ndarray) -> Any:
        try:
            return network(np.ascontiguousarray(inputs, np.float32))
        except Exception as error:  # a file can be made to fail in any way
            got = f"{self.path} that cannot be run"
            raise ModelError("a whole model", got, "export it again") from error

    def _light(self, output: np.ndarray, count: int) -> np.ndarray:
        size = self.contract.output_size
        if output.shape != (count, 3, size, size):
            got = f"{self.path} that gives {output.shape}"
            raise ModelError(f"light of {(count, 3, size, size)}", got, "export it again")
        log_radiance: np.ndarray = output.transpose(0, 2, 3, 1)
        if not np.all(log_radiance < np.log(np.finfo(np.float32).max)):  # false for nan as well
            got = f"{self.path} that gives NaN or infinite light"
            raise ModelError("a trained model", got, "use another model file")
        return log_radiance

    @abstractmethod
    def run(
        self, inputs: Float32[np.ndarray, "batch 3 height width"]
    ) -> Float32[np.ndarray, "batch 3 size size"]:
        """The bare network."""

    def run_fully(
        self, inputs: Float32[np.ndarray, "batch 3 height width"]
    ) -> tuple[
        Float32[np.ndarray, "batch 3 size size"],
        Float32[np.ndarray, "batch lamp numbers"],
        Float32[np.ndarray, "batch heads"],
    ]:
        """The bare network, its lamps and heads, as the contract has them; here with neither."""
        none = np.zeros((len(inputs), 0, LAMP_NUMBERS), np.float32)
        return self.run(inputs), none, np.zeros((len(inputs), 0), np.float32)


def lamps_of(numbers: Float32[np.ndarray, "lamp numbers"]) -> tuple[Lamp, ...]:
    """Lamps from the second output of a network, the strongest first."""
    with np.errstate(over="ignore"):  # infinite flux is refused like any other
        lamps = [Lamp(normalised(n[:3]), np.exp(n[3:6]), float(n[6])) for n in numbers]
    return tuple(sorted(lamps, key=lambda lamp: -lamp.luminous_flux))


def content_of(path: Path) -> bytes:
    """The bytes of a model file.

    Raises:
        ModelError: there is none, or it cannot be read.
    """
    if not path.is_file():
        got = f"{path}, which is a folder" if path.is_dir() else f"no file {path}"
        raise ModelError("a model file", got, "give the path of a .onnx or .tflite file")
    try:
        return path.read_bytes()
    except OSError as error:
        got = f"{path}: {error.strerror}"
        raise ModelError("a readable model file", got, "check it") from error


def refuse_other_sizes(
    contract: ModelContract, inputs: Mapping[str, object], outputs: Mapping[str, object], path: Path
) -> None:
    """Check that a network keeps its contract: names, and sizes without the batch.

    Raises:
        ModelError: it does not.
    """
    size = contract.output_size
    keeps_input = inputs == {contract.input_name: [3, contract.height, contract.width]}
    wanted: dict[str, object] = {contract.output_name: [3, size, size]}
    if contract.lamps:
        wanted[contract.lamps_name] = [contract.lamps, LAMP_NUMBERS]
    if contract.heads:
        wanted[contract.heads_name] = [len(contract.heads)]
    if not keeps_input or any(outputs.get(name) != shape for name, shape in wanted.items()):
        got = f"{path} with inputs {inputs} and outputs {outputs}"
        raise ModelError("a model that keeps its own contract", got, "export it again")


def cores() -> int:
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
