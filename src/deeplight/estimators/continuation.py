"""The photo continued all around, so that what it does not show looks like the same place.

Floor, walls and ceiling of a room, ground, horizon and sky lie at much the same elevation on all
sides. So each level row of the photo goes on to both sides as its own mirror images, which meet
without a seam, and its lowest ground reaches down to the feet. Of the estimate and of that the
geometric mean is taken, weighted; the power of what is not seen stays the estimate's.
"""

from collections.abc import Mapping

import numpy as np
from jaxtyping import Bool, Float, Float32, Int64

from deeplight.estimators.projection import ProjectedPhoto, smoothstep
from deeplight.estimators.surroundings import kept_power, power_of
from deeplight.estimators.upright import SURE_CHANCE, likeliest_turn
from deeplight.frames import VIEW, Rotation, turned, world_from_camera
from deeplight.io.tilt import Tilt
from deeplight.mappings import latlong, resample

WEIGHT = 0.6
"""Of the continued photo; the estimate has the rest. Chosen on validation places, where 0.5 to 0.7
are as good (`benchmarks/photo_environment.py`)."""
COLOUR = float(__import__('os').environ.get('COL','1'))
NEAR=float(__import__('os').environ.get('NEAR','180'))
FAR=float(__import__('os').environ.get('FAR','1'))
NARROW=float(__import__('os').environ.get('NARROW','.75'))
WEIGHT = float(__import__('os').environ.get('WEIGHT','.6'))
_SHOWN = 0.98  # of a texel, from which on it is a piece of the photo
_LEAST_TURN_RAD = np.radians(15)  # of a row: less of it says nothing of the rest
_FADE_RAD = np.radians(10)  # beyond the highest and the lowest row
_GROUND_RAD = np.radians((10, 25))  # below the horizon: from here on the lowest row is ground
_DARKEST = 1e-3
_STEEPEST = 0.98  # sine of the pitch beyond which nothing is ahead


def up_of(tilt: Tilt | None, heads: Mapping[str, float]) -> Float[np.ndarray, "3"] | None:
    """Where up is in the camera frame: by the tilt that is known, else by the network's guess of
    the pitch. None where neither says, and where the network takes the photo to lie on its side."""
    if tilt is not None:
        return world_from_camera(0, tilt.pitch_rad, tilt.roll_rad)[1]
    if not heads:
        return None
    turn, chance = likeliest_turn(heads)
    if turn and chance >= SURE_CHANCE:
        return None
    return world_from_camera(0, heads["pitch_rad"])[1]


def continued(
    surroundings: Float32[np.ndarray, "height width 3"],
    photo: ProjectedPhoto,
    up: Float[np.ndarray, "3"],
) -> Float32[np.ndarray, "height width 3"]:
    """The surroundings blended with the photo's level rows, continued to both sides.

    Args:
        surroundings: linear radiance, camera frame; what lies where the photo looks stays.
        photo: at as many rows or a whole multiple of them.
        up: unit vector, camera frame.
    """
    camera_from_level = _level(up)
    if camera_from_level is None:
        return surroundings
    height, width, _ = surroundings.shape
    grid = latlong.directions(height, width)
    seen = resample.shrink(photo.seen[..., None], height, width)
    both = np.concatenate([resample.shrink(photo.radiance, height, width), seen], -1)
    strip = resample.sample_latlong(both, turned(grid, camera_from_level))
    rows = _continued_rows(np.log(np.maximum(strip[..., :3], _DARKEST)), strip[..., 3] > _SHOWN)
    if rows is None:
        return surroundings
    found = resample.sample_latlong(rows, turned(grid, camera_from_level.T)) * (1 - seen)
    change = found[..., :3] - found[..., 3:4] * np.log(np.maximum(surroundings, _DARKEST))
    grey = change.mean(-1, keepdims=True)
    ratio = np.exp(grey + COLOUR * (change - grey))
    unseen = surroundings * (1 - seen)
    result: np.ndarray = kept_power(unseen * ratio, power_of(unseen)) + surroundings * seen
    return result


def _level(up: Float[np.ndarray, "3"]) -> Rotation | None:
    """Camera_from_level: +Y is up there and -Z straight ahead; None where no side is ahead."""
    if abs(VIEW @ up) > _STEEPEST:
        return None
    right = np.cross(VIEW, up)
    right /= np.linalg.norm(right)
    return np.stack([right, up, np.cross(right, up)], axis=1)


def _continued_rows(
    logs: Float32[np.ndarray, "rows columns 3"], shown: Bool[np.ndarray, "rows columns"]
) -> Float32[np.ndarray, "rows columns 4"] | None:
    """A level panorama of the photo going on to all sides: ln radiance times weight, and weight.

    None where the photo is too small to go on.
    """
    height, width = shown.shape
    first, last = _runs(shown)
    length = last - first
    wide = length >= max(_LEAST_TURN_RAD * width / (2 * np.pi), NARROW * length.max())
    if not wide.any():
        return None
    known = np.flatnonzero(wide)
    row = np.arange(height).clip(known[0], known[-1])
    row = known[np.searchsorted(known, row)]
    columns = _mirrored(first[row], last[row], width)
    goes_on = np.take_along_axis(logs[row], columns[..., None], axis=1)
    mean = np.stack([logs[r, first[r] : last[r] + 1].mean(0) for r in row])[:, None]
    aside = np.maximum(first[row][:, None] - np.arange(width), np.arange(width) - last[row][:, None])
    aside = np.maximum(aside, 0) * (2 * np.pi / width)
    near = FAR + (1 - FAR) * smoothstep(1 - aside / np.radians(NEAR))
    goes_on = mean + near[..., None] * (goes_on - mean)
    beyond = np.abs(np.arange(height) - row) * (np.pi / height)
    fade = smoothstep(1 - beyond / _FADE_RAD)
    lowest = (known[-1] + 0.5) * (np.pi / height) - np.pi / 2
    ground = smoothstep((lowest - _GROUND_RAD[0]) / (_GROUND_RAD[1] - _GROUND_RAD[0]))
    below = np.arange(height) > known[-1]
    weight = WEIGHT * np.where(below, np.maximum(fade, ground), fade)[:, None, None]
    result = np.empty((height, width, 4), np.float32)
    result[..., :3] = weight * (mean + fade[:, None, None] * (goes_on - mean))
    result[..., 3:] = weight
    return result


def _runs(shown: Bool[np.ndarray, "rows columns"]) -> tuple[np.ndarray, np.ndarray]:
    """First and last column of what is shown without a gap around straight ahead; of rows where
    nothing is, the last comes before the first."""
    middle = shown.shape[1] // 2
    right = np.logical_and.accumulate(shown[:, middle:], axis=1).sum(1)
    left = np.logical_and.accumulate(shown[:, middle - 1 :: -1], axis=1).sum(1)
    return middle - left, middle + right - 1


def _mirrored(
    first: Int64[np.ndarray, " rows"], last: Int64[np.ndarray, " rows"], width: int
) -> Int64[np.ndarray, "rows columns"]:
    """For every column the one between first and last that it repeats, back and forth."""
    span = (last - first + 1)[:, None]
    along = (np.arange(width) - first[:, None]) % (2 * span)
    return first[:, None] + np.where(along < span, along, 2 * span - 1 - along)

