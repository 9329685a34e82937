"""Where objects may stand: a patch below the horizon that looks the same all over.

A free floor is a plane of one material: seen through cells of a few percent of the photo its colour
changes little, however fine its texture. What stands on it, and where it ends, changes the colour.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float32, UInt8

from deeplight.area_means import mean_over_squares
from deeplight.camera_response import CameraResponse
from deeplight.compose.ground import Viewpoint
from deeplight.errors import ConfigError

_CELLS = 40  # along the photo's shorter side
_STEPS = 24  # places tried along each side
_WIDTH = 0.40  # of a patch, in the photo's shorter side: an object of the default size and more
_DEPTH = 0.25  # of it, over its width where the camera looks straight down, at least
LEAST_DEPRESSION_RAD = float(np.radians(8))
"""A floor seen more flatly than this is too far away to stand on."""
UNEVEN = 0.16
"""A patch whose colour varies by more than this (standard deviation of ln radiance) is not free."""
_AWAY = 0.25  # what being one shorter side away from the usual place costs, in that unit
_DARKEST = 0.01  # radiance: where it is darker nothing can be distinguished
_MOST_DARK = 0.3  # of a patch


@dataclass(frozen=True)
class Spot:
    """A place to stand.

    Attributes:
        x, y: pixel of the photo.
        unevenness: of the patch around it: standard deviation of ln radiance.
        sure: whether it is below the horizon for all that is known of the camera's pitch.
    """

    x: float
    y: float
    unevenness: float
    sure: bool = True

    @property
    def free(self) -> bool:
        """Whether it is floor on which nothing seems to stand."""
        return self.sure and self.unevenness <= UNEVEN


def free_spots(
    photo: UInt8[np.ndarray, "height width 3"],
    viewpoint: Viewpoint,
    count: int,
    usual_row: float,
) -> list[Spot]:
    """The places for `count` objects that look most like free floor, from left to right.

    Args:
        photo: upright.
        viewpoint: its camera.
        count: how many; they keep a patch's width between them where there is room.
        usual_row: the row to be near to, in pixels.

    Raises:
        ConfigError: the photo shows nothing below the horizon.
    """
    camera = viewpoint.camera
    height, width = camera.height, camera.width
    shorter = min(height, width)
    logs = _cells(photo)
    margin = _WIDTH * shorter / 2
    columns = np.linspace(margin, width - margin, _STEPS)
    rows = np.linspace(0.3 * height, 0.97 * height, _STEPS)
    below = [
        (float(x), float(y))
        for y in rows
        for x in columns
        if viewpoint.depression(x, y) >= LEAST_DEPRESSION_RAD
    ]
    sure = [place for place in below if not viewpoint.may_be_above(*place)]
    spots = [Spot(x, y, _unevenness(logs, viewpoint, x, y), bool(sure)) for x, y in sure or below]
    if not spots:
        got = f"a horizon at row {viewpoint.horizon_row:.0f} of {height}"
        raise ConfigError("a photo that shows floor", got, "give --at, or a lower --pitch")
    chosen: list[Spot] = []
    for number in range(count):
        usual = width * (number + 1) / (count + 1)
        away = [np.hypot(s.x - usual, s.y - usual_row) / shorter for s in spots]
        crowd = [_crowded(s, chosen, _WIDTH * shorter) for s in spots]
        costs = [s.unevenness + _AWAY * a + c for s, a, c in zip(spots, away, crowd, strict=True)]
        chosen.append(spots[int(np.argmin(costs))])
    return sorted(chosen, key=lambda spot: spot.x)


def _cells(photo: UInt8[np.ndarray, "height width 3"]) -> Float32[np.ndarray, "rows columns 3"]:
    """ln of the mean radiance of square cells."""
    side = max(min(photo.shape[:2]) / _CELLS, 1.0)
    radiance = CameraResponse().radiance_from_pixel(mean_over_squares(photo, side))
    logs: np.ndarray = np.log(np.maximum(radiance, _DARKEST)).astype(np.float32)
    return logs


def _unevenness(
    logs: Float32[np.ndarray, "rows columns 3"], viewpoint: Viewpoint, x: float, y: float
) -> float:
    """Over an ellipse that is a circle on the floor, a slow change of the light taken out."""
    camera = viewpoint.camera
    rows, columns, _ = logs.shape
    side = camera.height / rows
    half_width = _WIDTH * min(camera.height, camera.width) / 2 / side
    flat = max(float(np.sin(viewpoint.depression(x, y))), _DEPTH)
    down, right = np.mgrid[:rows, :columns] + 0.5
    down = (down - y / side) / (half_width * flat)
    right = (right - x / side) / half_width
    inside = down**2 + right**2 <= 1
    values = logs[inside].astype(float)
    below_the_photo = y + half_width * flat * side > camera.height
    if below_the_photo or len(values) < 8:
        return np.inf
    if (values.max(1) <= np.log(_DARKEST) + 0.1).mean() > _MOST_DARK:
        return np.inf
    plane = np.stack([np.ones(inside.sum()), down[inside], right[inside]], -1)
    fitted, *_ = np.linalg.lstsq(plane, values, rcond=None)
    return float((values - plane @ fitted).std(0).mean() + 0.25 * np.abs(fitted[1:]).mean())


def _crowded(spot: Spot, others: Sequence[Spot], width: float) -> float:
    return float(sum(np.hypot(spot.x - o.x, spot.y - o.y) < width for o in others))
