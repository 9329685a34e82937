"""The plane an object stands on: points whose light the object blocks or adds to."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int

from deeplight import harmonics
from deeplight.errors import ConfigError

MOST_POINTS = 256  # along a side
MIDDLE_STEP = 0.4  # how far apart points are in the middle, over the mean of the map


@dataclass(frozen=True)
class Ground:
    """The plane y = 0 and points of it around the origin, closer together in the middle.

    Point i, j stands at x = coordinates[j], z = coordinates[i].

    Attributes:
        size: points along a side.
        half: from the middle to the edge; the object's longest side is 1.
        reflectivity: of the plane, a perfect diffuser.
    """

    size: int = 48
    half: float = 1.6
    reflectivity: float = 0.3

    def __post_init__(self) -> None:
        if not 2 <= self.size <= MOST_POINTS:
            raise ConfigError(f"2 to {MOST_POINTS} points", f"{self.size}", "correct it")
        if not 0 <= self.reflectivity <= 1:
            raise ConfigError("a reflectivity from 0 to 1", f"{self.reflectivity}", "correct it")

    @property
    def coordinates(self) -> Float[np.ndarray, "size"]:
        """x of the columns, and z of the rows: half (0.4 t + 0.6 t^3), t from -1 to 1 evenly."""
        return _coordinates(self.size, self.half)

    @property
    def points(self) -> Float[np.ndarray, "points 3"]:
        """Every point, row after row."""
        z, x = np.meshgrid(self.coordinates, self.coordinates, indexing="ij")
        return np.stack([x, np.zeros_like(x), z], -1).reshape(-1, 3)

    def nearest(self, positions: Float[np.ndarray, "n 3"]) -> Int[np.ndarray, "n"]:
        """The point nearest to each position; size x size for those off the map."""
        ends = (self.coordinates[1:] + self.coordinates[:-1]) / 2
        column = np.searchsorted(ends, positions[:, 0])
        row = np.searchsorted(ends, positions[:, 2])
        off = np.abs(positions[:, [0, 2]]).max(1) > self.half
        return np.where(off, self.size**2, row * self.size + column)


@lru_cache(maxsize=4)
def _coordinates(size: int, half: float) -> Float[np.ndarray, "size"]:
    t = np.linspace(-1, 1, size)
    result: np.ndarray = half * (MIDDLE_STEP * t + (1 - MIDDLE_STEP) * t**3)
    return result


def open_plane(order: int) -> Float[np.ndarray, "coefficients"]:
    """Irradiance over pi on a plane that nothing stands on, in light of each harmonic."""
    up = harmonics.basis(np.array([0.0, 1.0, 0.0]), order)
    result: np.ndarray = up * harmonics.cosine_kernel(order) / np.pi
    return result
