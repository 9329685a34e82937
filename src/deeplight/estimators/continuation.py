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
from deeplight.estimators.upright import guessed_tilt
from deeplight.frames import VIEW, Rotation, turned
from deeplight.io.tilt import Tilt
from deeplight.mappings import latlong, resample

WEIGHT = 0.6
"""Of the continued photo; the estimate has the rest. Chosen on validation places, where 0.5 to 0.7
are as good, as are colours whole or half (`benchmarks/photo_environment.py`)."""
COLOUR = 0.7
"""So much of what the continued photo changes in colour. All of it would turn the sky blue above an
orange table, since the power of each channel is kept."""
_DETAIL_TO_RAD, _DETAIL_LEFT = np.radians(70), 0.15
"""So far from the photo its detail fades, to this share, into its row's mean: it is a place that
goes on, not its things."""
_SHOWN = 0.98  # of a texel, from which on it is a piece of the photo
_LEAST_TURN_RAD = np.radians(15)  # of a row: less of it says nothing of the rest
_LEAST_OF_WIDEST = 0.75  # a row that the photo's corners cut off is left out
_FADE_RAD = np.radians(10)  # beyond the highest and the lowest row
_GROUND_RAD = np.radians(10), np.radians(25)  # below the horizon: the lowest row becomes ground
_DARKEST = 1e-3
_STEEPEST = 0.98  # sine of the pitch beyond which nothing is ahead


def up_of(tilt: Tilt | None, heads: Mapping[str, float]) -> Float[np.ndarray, "3"] | None:
    """Where up is in the camera frame: by the tilt that is known, else by the network's guess of
    the pitch. None where neither says, and where the network takes the photo to lie on its side."""
    known = tilt or guessed_tilt(heads)
    return None if known is None else known.up


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
    rows = _continued_rows(*_level_photo(photo, seen, turned(grid, camera_from_level)))
    if rows is None:
        return surroundings
    found = resample.sample_latlong(rows, turned(grid, camera_from_level.T))
    found *= 1 - seen
    change = found[..., :3] - found[..., 3:] * np.log(np.maximum(surroundings, _DARKEST))
    change *= np.float32(COLOUR)
    change += change.mean(-1, keepdims=True) * np.float32(1 / COLOUR - 1)
    unseen = surroundings * (1 - seen)
    result = kept_power(unseen * np.exp(change), power_of(unseen))
    result += surroundings * seen
    return result


def _level(up: Float[np.ndarray, "3"]) -> Rotation | None:
    """Camera_from_level: +Y is up there and -Z straight ahead; None where no side is ahead."""
    if abs(VIEW @ up) > _STEEPEST:
        return None
    right = np.cross(VIEW, up)
    right /= np.linalg.norm(right)
    return np.stack([right, up, np.cross(right, up)], axis=1)


def _level_photo(
    photo: ProjectedPhoto,
    seen: Float32[np.ndarray, "height width 1"],
    directions: Float[np.ndarray, "height width 3"],
) -> tuple[Float32[np.ndarray, "height width 3"], Bool[np.ndarray, "height width"]]:
    """ln radiance of the photo in the given directions of the camera frame, and where it shows
    them."""
    height, width, _ = seen.shape
    shown = resample.sample_latlong(seen, directions)[..., 0] > _SHOWN
    radiance = photo.radiance
    if len(radiance) > 2 * height:  # looked up point by point, that would be noise
        radiance = resample.shrink(radiance, height, width)
    found = resample.sample_latlong(radiance, directions[shown])
    logs = np.zeros((height, width, 3), np.float32)
    logs[shown] = np.log(np.maximum(found, _DARKEST))
    return logs, shown


def _continued_rows(
    logs: Float32[np.ndarray, "rows columns 3"], shown: Bool[np.ndarray, "rows columns"]
) -> Float32[np.ndarray, "rows columns 4"] | None:
    """A level panorama of the photo going on to all sides: ln radiance times weight, and weight.

    None where the photo is too small to go on.
    """
    height, width = shown.shape
    first, last = _runs(shown)
    length = last - first
    least = _LEAST_TURN_RAD * width / (2 * np.pi)
    known = np.flatnonzero(length >= max(least, _LEAST_OF_WIDEST * length.max()))
    if not len(known):
        return None
    row = known[np.searchsorted(known, np.arange(height).clip(known[0], known[-1]))]
    first, last = first[row, None], last[row, None]
    column = np.arange(width)
    aside = np.maximum(np.maximum(first - column, column - last), 0) * (2 * np.pi / width)
    mean = ((aside == 0)[..., None] * logs[row]).sum(1) / (last - first + 1)
    beyond = np.abs(np.arange(height) - row) * (np.pi / height)
    fade = smoothstep(1 - beyond / _FADE_RAD)[:, None]
    detail = fade * (_DETAIL_LEFT + (1 - _DETAIL_LEFT) * smoothstep(1 - aside / _DETAIL_TO_RAD))
    lowest = (row + 0.5) * (np.pi / height) - np.pi / 2  # below the horizon
    ground = smoothstep((lowest - _GROUND_RAD[0]) / (_GROUND_RAD[1] - _GROUND_RAD[0]))
    ground[: known[-1]] = 0
    weight = WEIGHT * np.maximum(ground[:, None], fade)[..., None]
    again = logs.reshape(-1, 3)[row[:, None] * width + _mirrored(first, last, column)]
    again += (detail[..., None] - 1) * (again - mean[:, None])
    result = np.empty((height, width, 4), np.float32)
    result[..., :3] = weight * again
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
    first: Int64[np.ndarray, "rows 1"],
    last: Int64[np.ndarray, "rows 1"],
    column: Int64[np.ndarray, " columns"],
) -> Int64[np.ndarray, "rows columns"]:
    """For every column the one from first to last that it repeats, back and forth."""
    span = last - first + 1
    along = (column - first) % (2 * span)
    return first + np.minimum(along, 2 * span - 1 - along)
