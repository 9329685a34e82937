"""A sphere's crop out of a photograph: the ideal camera of section 3.1, by area averages."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from jaxtyping import Float, Float32, Int

from deeplight.camera import PinholeCamera
from deeplight.frames import turned
from deeplight.light_stage.outline import Outline
from deeplight.mappings import mirror_ball

_EDGE_PX = 1.5  # the lens mixes what is behind the sphere into its edge


@dataclass(frozen=True, eq=False)
class Cropper:
    """Where in the photograph each sample of the crop lies.

    Attributes:
        index, weight: four neighbouring pixels of each sample and how much each counts.
        inside: share of a crop pixel's mean that each sample is.
        size: pixels along the crop.
    """

    index: Int[np.ndarray, "4 samples"]
    weight: Float[np.ndarray, "4 samples"]
    inside: Float[np.ndarray, "pixels supersamples"]
    size: int

    @classmethod
    def of(cls, outline: Outline, camera: PinholeCamera) -> Self:
        """For a sphere that does not move from photograph to photograph."""
        view, radius_px = outline.view, float(np.mean(outline.axes_px))
        supersample = int(np.clip(np.ceil(4 * radius_px / view.size), 4, 12))
        u, v = (
            _by_pixel(a, view.size, supersample) for a in mirror_ball.grid(view.size, supersample)
        )
        radius = np.hypot(u, v)
        inside = radius <= 1
        shown = (view.alpha().ravel() > 0) & ~inside.any(axis=1)
        inside[shown, radius[shown].argmin(axis=1)] = True
        held = np.minimum(1, max(1 - _EDGE_PX / radius_px, 0.5) / np.maximum(radius, 1e-9))
        reach = np.tan(view.angular_radius_rad)
        rays = np.stack([u * held * reach, v * held * reach, np.full(u.shape, -1.0)], -1)
        row, column = camera.pixel_of_directions(turned(rays, view.ball_from_camera.T))
        row = np.clip(row.ravel(), 0, camera.height - 1)
        column = np.clip(column.ravel(), 0, camera.width - 1)
        top = np.minimum(row.astype(int), camera.height - 2)
        left = np.minimum(column.astype(int), camera.width - 2)
        down, right = row - top, column - left
        first = top * camera.width + left
        index = np.stack([first, first + 1, first + camera.width, first + camera.width + 1])
        weight = np.stack(
            [(1 - down) * (1 - right), (1 - down) * right, down * (1 - right), down * right]
        )
        share = inside / np.maximum(inside.sum(axis=1, keepdims=True), 1)
        return cls(index, weight, share, view.size)

    def crop(
        self, photograph: Float32[np.ndarray, "height width 3"]
    ) -> Float[np.ndarray, "pixels 3"]:
        """The sphere alone, rim included, as rows of colours; zero off the sphere."""
        flat = photograph.reshape(-1, 3)
        samples = sum(
            flat[index] * weight[:, None]
            for index, weight in zip(self.index, self.weight, strict=True)
        )
        cells = samples.reshape(*self.inside.shape, 3)
        return np.einsum("ps,psc->pc", self.inside, cells)


def _by_pixel(values: np.ndarray, size: int, supersample: int) -> np.ndarray:
    blocks = values.reshape(size, supersample, size, supersample).swapaxes(1, 2)
    return blocks.reshape(size * size, supersample**2)
