"""Lighting: the value every step hands on."""

from dataclasses import dataclass
from typing import Protocol, Self, runtime_checkable

import numpy as np
from jaxtyping import Float

from deeplight.errors import ShapeError
from deeplight.frames import Rotation
from deeplight.mappings import mirror_ball, resample

LIGHTING_SIZE = 32  # the network's output


@runtime_checkable
class HasLighting(Protocol):
    """What has light on the mirror ball: a `Lighting` itself, or an `Environment`."""

    @property
    def lighting(self) -> "Lighting":
        """Its light on the mirror ball."""


@dataclass(frozen=True, eq=False)
class Lighting:
    """Light from all directions, on the mirror ball, in the camera frame.

    Attributes:
        radiance: linear, relative to the camera's white: 1.0 is where a pixel of the photo
            just saturates. Finite and not negative; pixels off the disc mean nothing.
            Read-only.

    Examples:
        >>> deeplight.Lighting(np.ones((32, 32, 3), np.float32))
        Lighting(32 x 32 ball, mean radiance [1.0, 1.0, 1.0])
    """

    radiance: Float[np.ndarray, "size size 3"]

    def __post_init__(self) -> None:
        radiance = np.array(self.radiance, np.float32)
        if radiance.ndim != 3 or radiance.shape != (len(radiance), len(radiance), 3):
            raise ShapeError("a square RGB mirror ball", f"shape {radiance.shape}", "resample it")
        off = mirror_ball.coverage(len(radiance)) == 0
        radiance[off] = 0
        if not (np.isfinite(radiance).all() and (radiance >= 0).all()):
            raise ShapeError(
                "finite radiance of at least 0",
                "NaN, infinite or negative values",
                "clean it first",
            )
        radiance.setflags(write=False)
        object.__setattr__(self, "radiance", radiance)

    @classmethod
    def from_log_radiance(cls, log_radiance: Float[np.ndarray, "size size 3"]) -> Self:
        """From the network's output Q: radiance e^Q (equation 2), in float32."""
        with np.errstate(over="ignore"):  # infinite radiance is refused like any other
            return cls(np.exp(log_radiance.astype(np.float32)))

    @classmethod
    def from_latlong(
        cls,
        radiance: Float[np.ndarray, "height width 3"],
        camera_from_latlong: Rotation | None = None,
        size: int = LIGHTING_SIZE,
    ) -> Self:
        """From an equirectangular panorama, by area averages; its power is kept exactly."""
        turn = np.eye(3) if camera_from_latlong is None else camera_from_latlong
        return cls(resample.ball_from_latlong(radiance, size, turn, exact_power=True))

    @property
    def lighting(self) -> Self:
        """Itself, so that what takes an environment's light takes this, too."""
        return self

    @property
    def size(self) -> int:
        """Pixels along the ball."""
        return len(self.radiance)

    def latlong(self, height: int = 256) -> Float[np.ndarray, "height width 3"]:
        """The light as an equirectangular panorama: centre = the view, right of it = +X."""
        return resample.latlong_from_ball(self.radiance, height)

    def cube(self, size: int = 128) -> Float[np.ndarray, "6 size size 3"]:
        """The light as the six cube faces of `cube.FACES`."""
        return resample.cube_from_ball(self.radiance, size)

    def rotated(self, new_from_old: Rotation) -> Self:
        """The same light in a frame turned by `new_from_old`."""
        return type(self)(resample.turned_ball(self.radiance, new_from_old))

    def mirrored(self) -> Self:
        """The light of the horizontally flipped scene: u -> -u on the ball."""
        return type(self)(self.radiance[:, ::-1])

    def power(self) -> Float[np.ndarray, "3"]:
        """Radiance summed over all directions, per channel; white light of 1 gives 4 pi."""
        return np.einsum("ij,ijc->c", mirror_ball.solid_angles(self.size), self.radiance)

    def __repr__(self) -> str:
        mean = self.power() / (4 * np.pi)
        return f"Lighting({self.size} x {self.size} ball, mean radiance {mean.round(3).tolist()})"
