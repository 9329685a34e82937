"""What a caller must do to run a model, stored inside the model file itself."""

import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from types import MappingProxyType
from typing import Any

from deeplight.brdf import REFLECTIVITY
from deeplight.camera import (
    BACKGROUND_FRACTION,
    BACKGROUND_HEIGHT,
    BACKGROUND_WIDTH,
    FRAME_HEIGHT,
    FRAME_WIDTH,
    LANDSCAPE_FRAME_ROWS,
    LANDSCAPE_HEIGHT,
    LANDSCAPE_WIDTH,
    TRAINED_VERTICAL_FOV_RAD,
)
from deeplight.camera_response import GAMMA, SOFT_CLIP_N
from deeplight.errors import ModelError

CONTRACT_KEY = "deeplight.contract"
"""Name of the metadata entry of an ONNX file that holds the contract."""

MAX_SIDE = 4096  # of what goes in and comes out
MOST = 100.0  # no angle, gamma or aspect of a camera comes near
MOST_LAMPS = 64
MOST_HEADS = 64
CONTRACT_VERSION = 3

SINCE_VERSION_2: Mapping[str, Any] = MappingProxyType(
    {"lamps": 0, "lamps_name": "lamps", "brightness": 0.0}
)
"""Entries that a contract of version 1 lacks, and what it means by that."""
SINCE_VERSION_3: Mapping[str, Any] = MappingProxyType(
    {"mirrored": False, "heads": (), "heads_name": "heads"}
)
"""Entries that a contract of version 1 or 2 lacks."""

SERVED: Mapping[str, str] = MappingProxyType(
    {
        "input_layout": "NCHW, RGB, gamma-encoded",
        "output_layout": "NCHW, RGB",
        "output_quantity": "ln radiance",
        "output_mapping": "mirror ball",
        "output_frame": "camera: +X right, +Y up, +Z towards the camera",
        "output_unit": "1.0 = the camera's white",
    }
)
"""Entries of a contract that can have one value only: what this version knows to do."""

HEADS = (
    "fov_rad", "fov_scale", "pitch_rad", "pitch_scale", "roll_rad", "roll_scale",
    "upright_0", "upright_90", "upright_180", "upright_270",
    "brightness_scale", "colour_scale", "direction_scale", "log_radiance_scale", "indoors",
)  # fmt: skip
"""What a network may say besides light. Vertical field of view of what it was shown, pitch
(upwards) and roll (counter-clockwise as the holder sees it) of the camera, in rad; the chances that
the photo is upright, or must be turned by that many degrees clockwise to be; how far off the light
is: total brightness (ln), colour (angle, rad), direction of the main light (angle, rad), ln
radiance in one direction. 68 % of the errors on places that it did not see were below the scale.
The chance that the photo was taken in a room."""

LAMP_NUMBERS = 7
"""Of each lamp in a network's second output; see `ModelContract.lamps`."""

_REMEDY = "use a model exported by this version of deeplight, or update deeplight"


@dataclass(frozen=True)
class ModelContract:
    """Sizes, ranges, geometry and units of one trained model.

    A model file without a contract, or with one this version does not know, is refused: a wrong
    crop or a wrong gamma would still give a plausible picture and silently wrong light.

    Raises:
        ModelError: the version is unknown, or a value is one this version cannot serve.
    """

    version: int = CONTRACT_VERSION
    input_name: str = "photo"
    input_layout: str = SERVED["input_layout"]
    width: int = BACKGROUND_WIDTH
    height: int = BACKGROUND_HEIGHT
    input_low: float = -0.5  # value of pixel 0
    input_high: float = 0.5  # value of pixel 255
    output_name: str = "log_radiance"
    output_layout: str = SERVED["output_layout"]
    output_size: int = 32
    output_quantity: str = SERVED["output_quantity"]  # the caller applies exp, in float32
    output_mapping: str = SERVED["output_mapping"]
    output_frame: str = SERVED["output_frame"]
    output_unit: str = SERVED["output_unit"]
    lamps: int = SINCE_VERSION_2["lamps"]
    """Lamps that a second output has, shape (batch, lamps, 7): direction towards the lamp x, y, z
    (unit, in the frame of the first output), ln of its flux RGB (radiance integrated over solid
    angle, in its unit), angular radius in rad. They are part of the first output already. 0: there
    is no second output."""
    lamps_name: str = SINCE_VERSION_2["lamps_name"]
    vertical_fov_deg: float = round(
        math.degrees(TRAINED_VERTICAL_FOV_RAD), 9
    )  # of the full training frame
    frame_aspect: float = FRAME_WIDTH / FRAME_HEIGHT  # width / height of the full training frame
    background_top: float = 0.0  # the input shows the rows from here ...
    background_fraction: float = BACKGROUND_FRACTION  # ... to here, as fractions of the frame
    gamma: float = GAMMA
    soft_clip_n: float = SOFT_CLIP_N
    reflectivity: Mapping[str, float] = field(default_factory=lambda: dict(REFLECTIVITY))
    trained_on: str = ""  # data set, places and steps, in words
    brightness: float = SINCE_VERSION_2["brightness"]
    """Share of the photo's brightness that the network itself takes out and puts back."""
    mirrored: bool = SINCE_VERSION_3["mirrored"]
    """Whether the network reads its features in both directions; of interest to training only."""
    heads: tuple[str, ...] = SINCE_VERSION_3["heads"]
    """Names of the numbers in one more output, shape (batch, names): what the network says of the
    camera and how sure it is of the light (`estimators.sureness`). Empty: there is none."""
    heads_name: str = SINCE_VERSION_3["heads_name"]

    @classmethod
    def landscape(cls, **changes: Any) -> "ModelContract":
        """The contract of the landscape network (section 4.3), which sees the background's middle.

        Args:
            changes: entries that differ from their defaults.
        """
        middle = BACKGROUND_FRACTION / 2
        half = LANDSCAPE_FRAME_ROWS / FRAME_HEIGHT / 2
        return cls(
            width=LANDSCAPE_WIDTH,
            height=LANDSCAPE_HEIGHT,
            background_top=middle - half,
            background_fraction=middle + half,
            **changes,
        )

    def __post_init__(self) -> None:
        if self.version != CONTRACT_VERSION:
            raise _unknown_version(self.version)
        for name, value in SERVED.items():
            if getattr(self, name) != value:
                got = f"{getattr(self, name)!r}"
                raise ModelError(f"a model whose {name} is {value!r}", got, _REMEDY)
        self._check_numbers()

    def _check_numbers(self) -> None:
        sane = {
            "width": self._whole(self.width, MAX_SIDE),
            "height": self._whole(self.height, MAX_SIDE),
            "output_size": self._whole(self.output_size, MAX_SIDE),
            "lamps": self.lamps == 0 or self._whole(self.lamps, MOST_LAMPS),
            "brightness": 0 <= self.brightness <= 1,
            "heads": len(self.heads) <= MOST_HEADS and all(isinstance(h, str) for h in self.heads),
            "input_low": abs(self.input_low) < MOST,
            "input_high": self.input_low < self.input_high < MOST,
            "vertical_fov_deg": 1 < self.vertical_fov_deg < 179,
            "frame_aspect": 1 / MOST < self.frame_aspect < MOST,
            "background_fraction": 0 <= self.background_top < self.background_fraction <= 1,
            "gamma": 1 / MOST < self.gamma < MOST,
            "soft_clip_n": 1 / MOST < self.soft_clip_n < MOST,
        }
        for name, holds in sane.items():
            if not holds:
                got = f"{getattr(self, name)!r}"
                raise ModelError(f"a possible {name} in the model contract", got, _REMEDY)

    @staticmethod
    def _whole(value: object, most: int) -> bool:
        return isinstance(value, int) and not isinstance(value, bool) and 0 < value <= most

    @property
    def top(self) -> float:
        """Upper edge of the input on the image plane at distance 1, upwards from the axis."""
        return self._half_height * (1 - 2 * self.background_top)

    @property
    def bottom(self) -> float:
        """Lower edge of the input on the image plane at distance 1 (negative: below the axis)."""
        return self._half_height * (1 - 2 * self.background_fraction)

    @property
    def right(self) -> float:
        """Right edge of the input on the image plane at distance 1; the left one is its mirror."""
        return self._half_height * self.frame_aspect

    @property
    def _half_height(self) -> float:
        return math.tan(math.radians(self.vertical_fov_deg) / 2)

    def to_json(self) -> str:
        """Give the text to store under `CONTRACT_KEY`."""
        return json.dumps(asdict(self), indent=1)

    @classmethod
    def from_json(cls, text: str) -> "ModelContract":
        """Read what `to_json` wrote; older ones become this one.

        Raises:
            ModelError: not JSON, another version, or entries missing, unknown or of a wrong type.
        """
        try:
            entries = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise ModelError("a model contract in JSON", str(error), _REMEDY) from error
        if not isinstance(entries, dict):
            raise ModelError("a model contract (a JSON object)", type(entries).__name__, _REMEDY)
        if entries.get("version") == 1:
            entries = {**SINCE_VERSION_2, **entries, "version": 2}
        if entries.get("version") == 2:
            entries = {**SINCE_VERSION_3, **entries, "version": CONTRACT_VERSION}
        if entries.get("version") != CONTRACT_VERSION:
            raise _unknown_version(entries.get("version"))
        known = {entry.name for entry in fields(cls)}
        if entries.keys() != known:
            got = f"wrong or missing entries: {', '.join(sorted(entries.keys() ^ known))}"
            raise ModelError("a complete model contract", got, _REMEDY)
        heads = entries["heads"]
        if not isinstance(heads, list | tuple):
            raise ModelError("a list of names as heads in the contract", f"{heads!r}", _REMEDY)
        try:
            return cls(**{**entries, "heads": tuple(heads)})
        except TypeError as error:
            got = "a value of another type"
            raise ModelError("numbers in the model contract", got, _REMEDY) from error


def _unknown_version(version: object) -> ModelError:
    expected = f"model contract version 1 to {CONTRACT_VERSION}"
    return ModelError(expected, f"version {version!r}", _REMEDY)
