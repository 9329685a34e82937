"""A panorama made ready to be filmed quickly: its lights apart from the smooth rest.

Binning every texel of a panorama into the mirror ball takes most of a frame's time. Here only the
brightest texels are binned, each into the one pixel it falls into, so a sun keeps its power; the
rest is smooth and is looked up in a coarse panorama.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float32

from deeplight.camera_response import LUMINANCE
from deeplight.frames import Directions, Rotation, turned
from deeplight.mappings import latlong, mirror_ball, resample

LIGHT_SHARE = 0.015  # of all directions: where the panorama is brightest
SMOOTH_HEIGHT = 128


@dataclass(frozen=True, eq=False)
class PlaceLight:
    """Light of one place, seen from one height above its ground.

    Attributes:
        sharp: the panorama, its first column repeated at its end.
        smooth: the same at 128 rows, without what `light_power` holds.
        light_directions: world frame, of the brightest texels at the height of the panorama.
        light_power: radiance above the rest times solid angle, of each of these.
        mean_luminance: over all directions.
        ev100: exposure value at ISO 100 that brings the mean luminance to white, as assumed for
            the place: panoramas state no absolute scale.
        height: of the camera above the ground, as a share of the panorama's.
    """

    sharp: Float32[np.ndarray, "rows columns 3"]
    smooth: Float32[np.ndarray, "few_rows few_columns 3"]
    light_directions: Float32[np.ndarray, "lights 3"]
    light_power: Float32[np.ndarray, "lights 3"]
    mean_luminance: float
    ev100: float = 10.0
    height: float = 1.0

    @classmethod
    def of(
        cls, panorama: Float32[np.ndarray, "height width 3"], ev100: float = 10.0
    ) -> "PlaceLight":
        """Prepare a panorama; its radiance is not negative."""
        luminance = panorama @ LUMINANCE.astype(np.float32)
        weight = latlong.solid_angles(*luminance.shape)
        few = slice(None, None, 4)  # a sixteenth of the texels gives the limit well enough
        limit = _brightest_share(luminance[few, few], weight[few, few], LIGHT_SHARE)
        rows, columns = np.nonzero(luminance > limit)
        excess = np.maximum(1 - limit / luminance[rows, columns], 0)[:, None]
        power = panorama[rows, columns] * excess * weight[rows, columns][:, None]
        rest = panorama.copy()
        rest[rows, columns] *= 1 - excess
        smooth = resample.shrink_latlong(rest, min(SMOOTH_HEIGHT, len(panorama)))
        directions = latlong.directions(*luminance.shape)[rows, columns]
        mean = float((luminance * weight).sum() / weight.sum())
        power = power.astype(np.float32)
        return cls(_wrapped(panorama), _wrapped(smooth), directions, power, mean, ev100)

    def from_height(self, height: float) -> "PlaceLight":
        """The place from `height` times as far above its ground, which is taken as level.

        What lies above the horizon stays; a point of the ground at depression a is now seen at
        depression b with tan b = height tan a. Call it on the place as `of` gave it.
        """
        if self.height != 1:
            raise ValueError("a place already seen from another height")
        moved = self.light_directions.copy()
        below = moved[:, 1] < 0
        moved[below, 1] *= height
        length = np.linalg.norm(moved, axis=1, keepdims=True)
        spread = np.where(below[:, None], height / length**3, 1)  # new over old solid angle
        power = (self.light_power * spread).astype(np.float32)
        return replace(
            self, light_directions=moved / length, light_power=power, height=float(height)
        )

    def seen(self, directions: Directions) -> Float32[np.ndarray, "*batch 3"]:
        """Radiance along world directions (of any length), as sharp as the panorama is."""
        return _looked_up(self.sharp, self._in_panorama(directions))

    def ball(self, size: int, world_from_camera: Rotation) -> Float32[np.ndarray, "size size 3"]:
        """The mirror ball in the camera's frame; pixels off the disc are zero."""
        lit, directions, solid_angle = _ball_pixels(size)
        ball = np.zeros((size * size, 3), np.float32)
        world = turned(directions, world_from_camera)
        ball[lit] = _looked_up(self.smooth, self._in_panorama(world))
        towards = turned(self.light_directions, world_from_camera.T)
        pixel = mirror_ball.pixel_of_directions(towards, size)
        for channel in range(3):
            power = np.bincount(pixel, self.light_power[:, channel], size * size)
            ball[lit, channel] += power[lit] / solid_angle
        return ball.reshape(size, size, 3)

    def _in_panorama(self, directions: Directions) -> Directions:
        """Where the panorama shows what is seen along `directions`."""
        if self.height == 1:
            return directions
        old = directions.copy()
        old[..., 1] = np.where(old[..., 1] < 0, old[..., 1] / np.float32(self.height), old[..., 1])
        return old


_PIXELS: dict[int, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}


def _ball_pixels(size: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Index, direction and solid angle of every pixel that holds light."""
    if size not in _PIXELS:
        solid_angle = mirror_ball.solid_angles(size).ravel()
        lit = np.flatnonzero(solid_angle > 0)
        directions = mirror_ball.pixel_directions(size).reshape(-1, 3)[lit].astype(np.float32)
        _PIXELS[size] = lit, directions, solid_angle[lit].astype(np.float32)
    return _PIXELS[size]


def _brightest_share(luminance: np.ndarray, weight: np.ndarray, share: float) -> float:
    """The luminance that `share` of all directions exceeds."""
    order = np.argsort(luminance, axis=None)
    total = np.cumsum(weight.ravel()[order])
    return float(luminance.ravel()[order[np.searchsorted(total, (1 - share) * total[-1])]])


def _wrapped(radiance: np.ndarray) -> np.ndarray:
    return np.concatenate([radiance, radiance[:, :1]], axis=1).astype(np.float32)


def _looked_up(wrapped: np.ndarray, directions: Directions) -> Float32[np.ndarray, "*batch 3"]:
    """`resample.sample_latlong` of a panorama whose first column is repeated at its end."""
    height, columns, _ = wrapped.shape
    row, column = latlong.position(directions, height, columns - 1)
    row = np.clip(row, 0, height - 1.001)
    column = np.where(column < 0, column + np.float32(columns - 1), column)
    top, left = row.astype(np.int32), np.minimum(column.astype(np.int32), columns - 2)
    down, right = (
        (value - whole.astype(np.float32))[..., None]
        for value, whole in ((row, top), (column, left))
    )
    texels, first = wrapped.reshape(-1, 3), top * columns + left
    upper, lower = (
        _mixed(texels.take(first + step, axis=0), texels.take(first + step + 1, axis=0), right)
        for step in (0, columns)
    )
    lower -= upper
    lower *= down
    upper += lower
    return upper


def _mixed(left: np.ndarray, right: np.ndarray, share: np.ndarray) -> np.ndarray:
    """(1 - share) of `left` and `share` of `right`; both are used up."""
    left *= 1 - share
    right *= share
    left += right
    return left
