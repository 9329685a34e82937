"""One picture whose rotation is known, kept small: what fusing works with."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, UInt8

from deeplight.camera import PinholeCamera
from deeplight.camera_response import decode
from deeplight.frames import Rotation, turned
from deeplight.mappings import latlong

ROWS = 192
"""Rows of a kept picture of 66 degrees: a pixel is then as wide as a texel of `HEIGHT`."""
HEIGHT = 512
"""Rows of a fused panorama."""
CELL_ROWS = 64
"""Rows of the coarse sky in which views are compared; a cell is 2.8 degrees wide."""
CELLS = 2 * CELL_ROWS**2
CLIPPED = 250
"""From this pixel value on a channel says only that there is at least so much light."""
DARKEST = 8
"""Below this pixel value there is more noise and rounding than light."""
_FEWEST = 0.9  # share of a cell that a view must have seen: half of it may look different

_LINEAR = decode(np.arange(256, dtype=np.float32) / np.float32(255))
_LINEAR.setflags(write=False)


@dataclass(frozen=True, eq=False)
class View:
    """One picture in the world.

    Attributes:
        pixels: upright, gamma-encoded, small.
        world_from_camera: how the camera was turned.
        vertical_fov_rad: of the upright picture.
        log_estimate: ln radiance that the network gives for it, on the mirror ball, camera frame,
            relative to this picture's white.
        log_exposure: ln of how much brighter than another picture of the same camera this one
            makes the same scene, where its file says; nan where it does not.
        number: of the frame it was.
    """

    pixels: UInt8[np.ndarray, "height width 3"]
    world_from_camera: Rotation
    vertical_fov_rad: float
    log_estimate: Float32[np.ndarray, "size size 3"]
    log_exposure: float = float("nan")
    number: int = 0

    @property
    def camera(self) -> PinholeCamera:
        """The camera of the small picture."""
        height, width, _ = self.pixels.shape
        return PinholeCamera(width, height, self.vertical_fov_rad)

    @property
    def radiance(self) -> Float32[np.ndarray, "height width 3"]:
        """Linear, relative to this picture's white; a clipped value is a lower bound."""
        return _LINEAR[self.pixels]

    @staticmethod
    def linear(pixels: UInt8[np.ndarray, "*n 3"]) -> Float32[np.ndarray, "*n 3"]:
        """Linear values of pixel values; 1.0 is white."""
        return _LINEAR[pixels]

    @property
    def towards(self) -> Float[np.ndarray, "3"]:
        """Where the camera looked, world."""
        return -self.world_from_camera[:, 2]

    def cells(self) -> tuple[Float32[np.ndarray, "cells 3"], Float32[np.ndarray, "cells 3"]]:
        """ln of the mean radiance of each coarse cell, and how much it counts; 0 is not seen.

        A channel that clips in a cell, or is near black on average, says nothing about its mean.
        """
        camera = self.camera
        cell = cell_of(turned(_rays(camera).reshape(-1, 3), self.world_from_camera))
        flat = self.pixels.reshape(-1, 3)
        count = np.bincount(cell, minlength=CELLS)
        covered = np.bincount(cell, _pixel_solid_angles(camera), CELLS)
        whole = covered > _FEWEST * cell_solid_angles()
        trust = np.bincount(cell, feather(camera).ravel(), CELLS) / np.maximum(count, 1)
        weight = np.where(whole, trust * cell_solid_angles(), 0).astype(np.float32)
        logs, weights = np.zeros((CELLS, 3), np.float32), np.zeros((CELLS, 3), np.float32)
        for channel in range(3):
            values = flat[:, channel]
            mean = np.bincount(cell, _LINEAR[values], CELLS) / np.maximum(count, 1)
            spoilt = np.bincount(cell, values >= CLIPPED, CELLS) > 0
            usable = ~spoilt & (mean > _LINEAR[DARKEST])
            weights[:, channel] = np.where(usable, weight, 0)
            logs[:, channel] = np.log(np.maximum(mean, _LINEAR[DARKEST]))
        return logs, weights


def cell_of(directions: Float[np.ndarray, "*n 3"]) -> Int[np.ndarray, "*n"]:
    """Index of the coarse cell that each direction lies in, row by row from the top."""
    row, column = latlong.position(directions, CELL_ROWS, 2 * CELL_ROWS)
    row = np.clip(np.rint(row).astype(np.int32), 0, CELL_ROWS - 1)
    return row * (2 * CELL_ROWS) + np.rint(column).astype(np.int32) % (2 * CELL_ROWS)


@lru_cache(maxsize=1)
def cell_directions() -> Float32[np.ndarray, "cells 3"]:
    """Unit direction of every coarse cell's centre."""
    return latlong.directions(CELL_ROWS, 2 * CELL_ROWS).reshape(-1, 3)


@lru_cache(maxsize=1)
def cell_solid_angles() -> Float32[np.ndarray, " cells"]:
    """Solid angle of every coarse cell, sr."""
    return latlong.solid_angles(CELL_ROWS, 2 * CELL_ROWS).ravel().astype(np.float32)


@lru_cache(maxsize=8)
def _rays(camera: PinholeCamera) -> Float32[np.ndarray, "height width 3"]:
    return camera.rays().astype(np.float32)


@lru_cache(maxsize=8)
def _pixel_solid_angles(camera: PinholeCamera) -> Float[np.ndarray, " pixels"]:
    """Solid angle of every pixel of a camera, sr: its area on the plane times cos^3."""
    x, y = camera.tangents
    area = 4 * x * y / (camera.width * camera.height)
    return area * np.abs(_rays(camera)[..., 2].ravel()) ** 3


@lru_cache(maxsize=8)
def feather(camera: PinholeCamera) -> Float32[np.ndarray, "height width"]:
    """How well a camera's pixels are trusted: 1 in the middle, near 0 at the edge.

    Lenses darken and blur towards the edge, and a weight that ends softly leaves no seam.
    """
    row = (np.arange(camera.height) + 0.5) * (2 / camera.height) - 1
    column = (np.arange(camera.width) + 0.5) * (2 / camera.width) - 1
    return np.outer(1 - row**2, 1 - column**2).astype(np.float32)


def inside(
    camera: PinholeCamera, directions: Float[np.ndarray, "n 3"], margin: float = 0.0
) -> Bool[np.ndarray, " n"]:
    """Which directions (camera frame) the camera's picture shows."""
    x, y = camera.tangents
    depth = -directions[:, 2]
    within = np.abs(directions[:, 0]) < depth * x * (1 - margin)
    return within & (np.abs(directions[:, 1]) < depth * y * (1 - margin)) & (depth > 0)
