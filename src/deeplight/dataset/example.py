"""One example: what the phone filmed, the three spheres in the picture, where and when."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from jaxtyping import Float32, UInt8

from deeplight.dataset.splits import SPLITS, TRAINING_SPLITS
from deeplight.errors import DataSetError
from deeplight.sphere import CROP_SIZE, SPHERES

BACKGROUND_SHAPES = ((192, 135, 3), (144, 192, 3))  # portrait, landscape
SCENES = ("indoor", "outdoor")

# WebDataset readers cut a member's name at its first dot, so a key must hold none.
_KEY = re.compile(r"[A-Za-z0-9_-]{1,80}")


@dataclass(frozen=True)
class ExampleMeta:
    """Where, when and with what an example was taken.

    Attributes:
        place: what splits are made by; all takes of one venue share it.
        take: one clip, filmed without a cut.
        frame: position in the take, from 0.
        scene: "indoor" or "outdoor".
        split: one of `SPLITS`.
        rig: name of a rig in the data set's manifest: where the spheres sit.
        camera: name of the camera or camera preset.
        licence: of the source.
        source: file or address the example was made from.
        details: anything else worth keeping (exposure, white balance, pose); JSON values.
    """

    place: str
    take: str
    frame: int
    scene: str
    split: str
    rig: str
    camera: str
    licence: str
    source: str
    details: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in ("place", "take", "rig", "camera", "licence", "source"):
            value = getattr(self, name)
            if not isinstance(value, str) or not value:
                raise _unfit(f"a text as `{name}`", repr(value))
        if not isinstance(self.frame, int) or self.frame < 0:
            raise _unfit("`frame` from 0 up", repr(self.frame))
        if self.scene not in SCENES:
            raise _unfit("`scene` indoor or outdoor", repr(self.scene))
        if self.split not in SPLITS:
            raise _unfit("`split` one of " + ", ".join(SPLITS), repr(self.split))
        if self.split.endswith("door") and not self.split.endswith("_" + self.scene):
            raise _unfit(f"an example of split {self.split}", f"scene {self.scene!r}")

    def to_dict(self) -> dict[str, Any]:
        return {item.name: getattr(self, item.name) for item in fields(self)}

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> "ExampleMeta":
        """Read what `to_dict` gave; an unknown or a missing name is a DataSetError."""
        known = {item.name for item in fields(cls)}
        required = known - {"details"}
        if not required <= set(values) <= known:
            wrong = sorted((required - set(values)) | (set(values) - known))
            raise _unfit("metadata with " + ", ".join(sorted(known)), "wrong: " + ", ".join(wrong))
        return cls(**values)


@dataclass(frozen=True, eq=False)
class Example:
    """A background and the three spheres that were filmed with it, 8 bit and clipped.

    Attributes:
        key: unique in its split; letters, digits, "_" and "-".
        background: what the network sees (the frame without its lower 20 %), as decoded from
            its JPEG.
        spheres: mirror, matte silver and diffuse sphere, each in its own tangent frame.
        meta: where and when.
        true_lighting: radiance on the mirror ball, camera frame, relative to camera white; only
            evaluation splits may have it.
        background_jpeg: the JPEG that `background` was decoded from, if the camera made one. It
            is stored as it is, so that a picture is never compressed twice.

    Arrays are copied and cannot be written to.
    """

    key: str
    background: UInt8[np.ndarray, "height width 3"]
    spheres: Mapping[str, UInt8[np.ndarray, "size size 3"]]
    meta: ExampleMeta
    true_lighting: Float32[np.ndarray, "light light 3"] | None = None
    background_jpeg: bytes | None = None

    def __post_init__(self) -> None:
        if not _KEY.fullmatch(self.key):
            raise _unfit("a key of letters, digits, _ and - (at most 80)", repr(self.key))
        background = _frozen(self.background, np.uint8, BACKGROUND_SHAPES, "the background")
        if set(self.spheres) != set(SPHERES):
            raise _unfit("the spheres " + ", ".join(SPHERES), ", ".join(sorted(self.spheres)))
        shape = (CROP_SIZE, CROP_SIZE, 3)
        spheres = {
            name: _frozen(self.spheres[name], np.uint8, (shape,), f"the {name} sphere")
            for name in SPHERES
        }
        object.__setattr__(self, "background", background)
        object.__setattr__(self, "spheres", spheres)
        if self.true_lighting is not None:
            object.__setattr__(self, "true_lighting", self._checked_lighting(self.true_lighting))

    @property
    def known_lighting(self) -> Float32[np.ndarray, "light light 3"]:
        """The true lighting, where there must be one.

        Raises:
            DataSetError: this example has none.
        """
        if self.true_lighting is None:
            got = f"example {self.key} without it"
            raise DataSetError("true lighting", got, "use an evaluation split of simulated takes")
        return self.true_lighting

    def _checked_lighting(
        self, radiance: Float32[np.ndarray, "light light 3"]
    ) -> Float32[np.ndarray, "light light 3"]:
        if self.meta.split in TRAINING_SPLITS:
            raise DataSetError(
                "8-bit spheres only in a training split",
                f"true HDR lighting in example {self.key} of split {self.meta.split}",
                "leave `true_lighting` out of training examples",
            )
        size = np.shape(radiance)[0]
        lighting = _frozen(radiance, np.float32, ((size, size, 3),), "the true lighting")
        if not (np.isfinite(lighting).all() and (lighting >= 0).all()):
            raise _unfit("finite true lighting >= 0", f"NaN, infinite or negative in {self.key}")
        return lighting


def _frozen(
    array: np.ndarray, dtype: type, shapes: tuple[tuple[int, ...], ...], what: str
) -> np.ndarray:
    if not isinstance(array, np.ndarray) or array.dtype != dtype or array.shape not in shapes:
        expected = f"{what} as {np.dtype(dtype)} " + " or ".join(map(str, shapes))
        got = f"{getattr(array, 'dtype', type(array).__name__)} {np.shape(array)}"
        raise _unfit(expected, got)
    copy = array.copy()
    copy.setflags(write=False)
    return copy


def _unfit(expected: str, got: str) -> DataSetError:
    return DataSetError(expected, got, "correct what makes the examples")
