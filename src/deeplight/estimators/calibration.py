"""Which camera a model is calibrated for, and its light as it was before, for all others."""

import json
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float32

from deeplight.errors import ModelError
from deeplight.lamp import Lamp

CALIBRATION_KEY = "deeplight.calibration"
"""Name of the metadata entry of an ONNX file that holds a `Calibration`. The gains are in the
network: who does not read the entry has them in all light."""

Use = Literal["matching", "always", "never"]
"""When a model's gains count. matching: for photos of its camera, and where either is unknown."""

MOST = 10.0  # no ln gain comes near
_DO = "calibrate the model again"


@dataclass(frozen=True)
class Calibration:
    """What `deeplight calibrate` put into a model.

    Attributes:
        log_gains: ln of the factors on red, green and blue of all its light.
        camera: make and model that they were found for, as `io.exif.camera_name` gives them; empty
            where the clips did not say.

    Raises:
        ModelError: not three plausible numbers and a text.
    """

    log_gains: tuple[float, float, float]
    camera: str = ""

    def __post_init__(self) -> None:
        numbers = [g for g in self.log_gains if isinstance(g, int | float) and math.isfinite(g)]
        if len(numbers) != 3 or len(self.log_gains) != 3 or max(map(abs, numbers)) > MOST:
            raise ModelError("three ln gains of a calibrated model", f"{self.log_gains}", _DO)
        if not isinstance(self.camera, str):
            raise ModelError("the name of a camera", f"{self.camera!r}", _DO)

    def suits(self, camera: str, use: Use) -> bool:
        """Whether the gains count for a photo of `camera`, which is empty where it says none."""
        if use != "matching" or not self.camera or not camera:
            return use != "never"
        return _alike(camera) == _alike(self.camera)

    def note(self, camera: str, use: Use) -> tuple[str, ...]:
        """What a user should know of a photo's light: a line, or none where all is as expected."""
        if use != "matching" or not self.camera:
            return ()
        if not camera:
            return (f"calibrated for {self.camera}; the photo does not say which camera took it",)
        if self.suits(camera, use):
            return ()
        return (f"taken with {camera}: what was calibrated for {self.camera} is left out",)

    def light_without(
        self, log_radiance: Float32[np.ndarray, "*size 3"]
    ) -> Float32[np.ndarray, "*size 3"]:
        """ln radiance as it was before the gains, but for rounding."""
        return log_radiance - np.array(self.log_gains, np.float32)

    def lamps_without(self, lamps: Sequence[Lamp]) -> tuple[Lamp, ...]:
        """Lamps as they were before the gains, but for rounding; the strongest first."""
        factor = np.exp(-np.array(self.log_gains, np.float32))
        before = [replace(lamp, flux=lamp.flux * factor) for lamp in lamps]
        return tuple(sorted(before, key=lambda lamp: -lamp.luminous_flux))

    def to_json(self) -> str:
        """Give the text to store under `CALIBRATION_KEY`."""
        return json.dumps(asdict(self))

    @classmethod
    def from_json(cls, text: str) -> "Calibration":
        """Read what `to_json` wrote.

        Raises:
            ModelError: it is something else.
        """
        try:
            entries = json.loads(text)
            return cls(tuple(entries["log_gains"]), entries["camera"])
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            got = f"{type(error).__name__} in it"
            raise ModelError(f"a whole entry {CALIBRATION_KEY}", got, _DO) from error


def _alike(camera: str) -> str:
    return " ".join(camera.casefold().split())
