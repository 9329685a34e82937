"""Rays from points of a surface: the directions to try and what blocks them."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from jaxtyping import Float, Float32, Int

from deeplight.errors import MissingExtraError
from deeplight.transfer.mesh import TransferSurface

OFFSET = 2e-4  # rays start so far off the surface, whose size is 1
_GOLDEN_RAD = np.pi * (3 - np.sqrt(5))


@dataclass(frozen=True, eq=False)
class Hemisphere:
    """Directions over a surface whose normal is +Z.

    Attributes:
        directions: unit, evenly spread, somewhat denser around the normal.
        solid_angles: that each stands for; they sum to 2 pi.
    """

    directions: Float32[np.ndarray, "samples 3"]
    solid_angles: Float32[np.ndarray, "samples"]


@lru_cache(maxsize=4)
def hemisphere(samples: int) -> Hemisphere:
    """A spiral of directions, whose density grows from the horizon to the normal by 1 : 3."""
    share = (np.arange(samples) + 0.5) / samples
    height = (np.sqrt(1 + 8 * share) - 1) / 2  # density (1 + 2 z) / 2
    ring, angle = np.sqrt(1 - height**2), np.arange(samples) * _GOLDEN_RAD
    directions = np.stack([ring * np.cos(angle), ring * np.sin(angle), height], -1)
    solid_angles = 4 * np.pi / (samples * (1 + 2 * height))
    solid_angles *= 2 * np.pi / solid_angles.sum()
    return Hemisphere(directions.astype(np.float32), solid_angles.astype(np.float32))


def frames_at(
    normals: Float[np.ndarray, "n 3"], numbers: Int[np.ndarray, "n"]
) -> Float32[np.ndarray, "n 3 3"]:
    """`world_from_surface` at each normal, turned about it by an angle of the point's number.

    The same directions everywhere would draw the spiral into the shadows.
    """
    helper = np.where(np.abs(normals[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    x = np.cross(helper, normals)
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    y = np.cross(normals, x)
    angle = numbers[:, None] * _GOLDEN_RAD
    turned = x * np.cos(angle) + y * np.sin(angle)
    return np.stack([turned, np.cross(normals, turned), normals], -1).astype(np.float32)


class Blockers:
    """The surface as Embree holds it."""

    def __init__(self, surface: TransferSurface) -> None:
        try:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene
        except ImportError as error:
            raise MissingExtraError("render", "tracing rays") from error
        self._scene: Any = EmbreeScene()
        self._triangles = surface.triangles.astype(np.int32)
        TriangleMesh(self._scene, surface.vertices.astype(np.float32), self._triangles)

    def hit(
        self,
        points: Float[np.ndarray, "rows 3"],
        normals: Float[np.ndarray, "rows 3"],
        directions: Float32[np.ndarray, "rows samples 3"],
    ) -> Int[np.ndarray, "rows samples"]:
        """The vertex nearest to where each ray meets the surface; -1 where it does not."""
        rows, samples, _ = directions.shape
        origins = np.repeat(points + OFFSET * normals, samples, axis=0)
        triangle, u, v = self.met(origins, directions.reshape(-1, 3))
        meets, result = triangle >= 0, np.full(rows * samples, -1)
        nearest = np.stack([1 - u - v, u, v])[:, meets].argmax(0)
        result[meets] = self._triangles[triangle[meets], nearest]
        return result.reshape(rows, samples)

    def met(
        self, origins: Float[np.ndarray, "rays 3"], directions: Float[np.ndarray, "rays 3"]
    ) -> tuple[Int[np.ndarray, "rays"], Float[np.ndarray, "rays"], Float[np.ndarray, "rays"]]:
        """The first triangle on each ray, -1 for none, and the shares of its corners 1 and 2."""
        starts, toward = origins.astype(np.float32), directions.astype(np.float32)
        found = self._scene.run(starts, toward, output=True)
        return found["primID"], found["u"], found["v"]
