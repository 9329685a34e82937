"""The picture of the place behind the rig, at half the film's size, averaged over the shutter.

Trigonometry for two million pixels, several times a frame, would take seconds. So directions
are followed into the place on a coarse grid, expressed on a plane chart of the world
(stereographic: smooth, and no stretching anywhere near the view), and interpolated. Colour
changes slowly and is read at an eighth of the film's size, the fine texture at half.
"""

from typing import TypeVar

import numpy as np
from jaxtyping import Float, Float32

from deeplight.camera import PinholeCamera
from deeplight.frames import Rotation, normalised, turned
from lab.film.reflections import Place, interpolation
from lab.film.world import World

Item = TypeVar("Item")

_STEP = 16  # pixels of the film between followed directions
_REACH_RAD = 2.15  # how far from its centre the chart goes
_BLOCK = 16  # rows
_COLOUR_STEPS = 3  # of a shutter's sub-frames: what has no detail needs no more
_TILE_PER_PIXEL = 3.0  # texels of noise along a pixel of half size: so fine needs no blending


class Scenery:
    """A place as one clip's camera sees it; everything that a clip does not change is kept."""

    def __init__(
        self, world: World, camera: PinholeCamera, looks: Rotation, tile: np.ndarray
    ) -> None:
        """Set up.

        Args:
            world: the place.
            camera: of the film; the picture is half its size, rounded up.
            looks: world_from_camera half-way through the clip, where the chart is centred.
            tile: noise of the fine texture, periodic.
        """
        self._world, self._camera, self._tile = world, camera, tile
        self._chart_from_world = looks.T
        self._texel = np.pi / len(world.levels[0])  # of the chart: as fine as the panorama
        self._chart = self._painted()
        height, width = camera.height, camera.width
        rows, columns = -(-height // _STEP) + 1, -(-width // _STEP) + 1
        self._rays = self._grid_rays(rows, columns)
        self._half = _reading(height, 2, rows), _reading(width, 2, columns)
        self._eighth = _reading(height, 8, rows), _reading(width, 8, columns)
        focal = height / 2 / camera.tangents[1]
        self._tile_scale = _TILE_PER_PIXEL * focal / 2

    def picture(self, places: list[Place]) -> Float32[np.ndarray, "3 half_height half_width"]:
        """Mean radiance while the camera was at `places`, planes first.

        Colour and texture are averaged each for itself: over a shutter only the texture changes.
        """
        charted = [self._charted(*place) for place in places]
        some = spread(charted, _COLOUR_STEPS)
        colour = np.sum([self._colour(*at) for at in some], axis=0)
        texture = np.sum([self._texture(*at) for at in charted], axis=0)
        height, width = texture.shape
        planes = doubled(doubled(colour.transpose(2, 0, 1) / np.float32(len(some))))
        planes = planes[:, :height, :width]
        modulation = planes[3] * texture
        modulation *= np.float32(1 / len(places))
        modulation += 1
        return planes[:3] * modulation

    def movement_px(self, first: Place, last: Place) -> float:
        """How far the picture moves between two places, in pixels of the film: the mean."""
        (pose, position), (pose_after, position_after) = first, last
        points = self._world.points_m(position, turned(self._rays, pose))
        camera_after = turned(normalised(points - position_after.astype(np.float32)), pose_after.T)
        before = self._camera.pixel_of_directions(self._rays.astype(float))
        after = self._camera.pixel_of_directions(camera_after.astype(float))
        moved = np.hypot(after[0] - before[0], after[1] - before[1])
        return float(moved.mean())

    def _grid_rays(self, rows: int, columns: int) -> np.ndarray:
        half_width, half_height = self._camera.tangents
        x = (np.arange(columns) * (2 * _STEP / self._camera.width) - 1) * half_width
        y = (1 - np.arange(rows) * (2 * _STEP / self._camera.height)) * half_height
        plane = np.stack([*np.meshgrid(x, y), np.full((rows, columns), -1.0)], axis=-1)
        return normalised(plane).astype(np.float32)

    def _charted(self, pose: Rotation, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Chart coordinates of what the grid's rays see."""
        seen = self._world.seen(position, turned(self._rays, pose))
        d = turned(seen, self._chart_from_world)
        scale = 2 / np.maximum(1 - d[..., 2], 1e-3)
        return d[..., 0] * scale, d[..., 1] * scale

    def _colour(self, x: np.ndarray, y: np.ndarray) -> Float[np.ndarray, "_height _width 4"]:
        down, right = self._eighth
        middle, last = (len(self._chart) - 1) / 2, len(self._chart) - 2
        column = np.clip((down @ x @ right.T) / self._texel + middle, 0, last + 0.999)
        row = np.clip(middle - (down @ y @ right.T) / self._texel, 0, last + 0.999)
        left, top = column.astype(np.int32), row.astype(np.int32)
        u = (column - left.astype(np.float32))[..., None]
        v = (row - top.astype(np.float32))[..., None]
        flat, width = self._chart.reshape(-1, 4), len(self._chart)
        at = top * width + left
        upper = flat[at] * (1 - u) + flat[at + 1] * u
        lower = flat[at + width] * (1 - u) + flat[at + width + 1] * u
        result: np.ndarray = upper * (1 - v) + lower * v
        return result

    def _texture(self, x: np.ndarray, y: np.ndarray) -> Float[np.ndarray, "h_height h_width"]:
        down, right = self._half
        size = len(self._tile)
        scaled = [(down @ (values * self._tile_scale) @ right.T) for values in (x, y)]
        column, row = (np.floor(values).astype(np.int32) & (size - 1) for values in scaled)
        row *= size
        row += column
        return self._tile.ravel().take(row)

    def _painted(self) -> Float[np.ndarray, "chart chart 4"]:
        """The panorama on the chart, and how strong the texture is there."""
        size = round(2 * 2 * np.tan(_REACH_RAD / 2) / self._texel)
        along = ((np.arange(size) - (size - 1) / 2) * self._texel).astype(np.float32)
        chart = np.empty((size, size, 4), np.float32)
        for row in range(size):  # row by row keeps the working set small
            x, y = along / 2, np.full(size, -along[row] / 2, np.float32)
            square = x * x + y * y
            d = np.stack([2 * x, 2 * y, square - 1], axis=-1) / (1 + square)[:, None]
            world = turned(d.astype(np.float32), self._chart_from_world.T)
            chart[row, :, :3] = self._world.radiance(world)
            chart[row, :, 3:] = self._world.texture_at(world)
        return chart


def spread(items: list[Item], most: int) -> list[Item]:
    """At most this number of the items, evenly from first to last."""
    if len(items) <= most:
        return items
    return [items[round(n)] for n in np.linspace(0, len(items) - 1, most)]


def doubled(
    planes: Float32[np.ndarray, "planes height width"],
) -> Float32[np.ndarray, "planes twice_height twice_width"]:
    """Planes at twice the size, linearly interpolated."""
    count, height, width = planes.shape
    full = np.empty((count, 2 * height, 2 * width), np.float32)
    padded = np.pad(planes, ((0, 0), (1, 1), (1, 1)), mode="edge")
    near, far = np.float32(0.75), np.float32(0.25)
    for top in range(0, height, _BLOCK):  # block by block: what stays in the cache is fast
        some = padded[:, top : top + _BLOCK + 2]
        wide = np.empty((count, some.shape[1], 2 * width), np.float32)
        main = some[:, :, 1:-1] * near
        np.add(main, some[:, :, :-2] * far, out=wide[:, :, ::2])
        np.add(main, some[:, :, 2:] * far, out=wide[:, :, 1::2])
        main = wide[:, 1:-1] * near
        rows = full[:, 2 * top : 2 * (top + _BLOCK)]
        wide *= far
        np.add(main, wide[:, :-2], out=rows[:, ::2])
        np.add(main, wide[:, 2:], out=rows[:, 1::2])
    return full


def _reading(pixels: int, step: int, nodes: int) -> np.ndarray:
    """The matrix that reads the grid at the middles of pixels `step` times the film's."""
    at = (np.arange(-(-pixels // step)) + 0.5) * step / _STEP
    return interpolation(at.clip(0, nodes - 1), nodes)
