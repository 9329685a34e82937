"""The photo continued all around, so that what it does not show looks like the same place.

Floor, walls and ceiling of a room, ground, horizon and sky lie at much the same elevation on all
sides. So the estimate is brought to the mean of the photo's level rows, row by row, wholly next to
the photo, in part and blurred behind the camera, and the more blurred the less the pitch is known;
the lowest ground goes on to the feet, the highest sky to
the zenith. What the estimate knows of left and right stays, and so does the power of what is not
seen. Nothing but means goes on: things would come again as ghosts.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Int

from deeplight.estimators.projection import ProjectedPhoto, smoothstep
from deeplight.estimators.surroundings import hidden_kept
from deeplight.frames import VIEW, normalised
from deeplight.io.tilt import Tilt
from deeplight.mappings import latlong

BEHIND = 0.8
"""Of the photo's rows behind a camera whose tilt is known; next to the photo they are whole. Chosen
on validation places, as is what follows (`benchmarks/photo_environment.py`)."""
DOUBT_RAD = 0.2
"""A pitch that may be so far off is worth 0.6 of a known one, twice as far 0.14 (Gaussian)."""
BLUR_RAD = float(np.radians(5))
"""How far rows are blurred behind the camera: floors end nearer or farther there. Sharp ones were
stripes all around."""
DOUBTED = 0.25
"""Of the rows behind a camera of quite unknown pitch; next to the photo they are worth a half."""
BLUR_OF_DOUBT = 1.5
"""How far those are blurred, in scales of the pitch."""
SKY = 0.6
"""Of the highest row, above it: the sky is brighter or darker there more often than the ground."""
_SHOWN = 0.98  # of a texel, from which on it is a piece of the photo
_LEAST_OF_WIDEST = 0.5  # a row of which the photo's corners cut off more is left out
_LEAST_TURN_RAD = np.radians(15), np.radians(45)  # whatever the widest: too little, and enough
_FADE_RAD = float(np.radians(10))  # beyond the highest and the lowest row
_OUTER_RAD = np.radians(10), np.radians(25)  # from the horizon: the outermost row is ground or sky
_EVERY = 2  # texels of the estimate, which is smooth: of these its rows' means are taken
_DARKEST = 1e-3
_STEEPEST = 0.98  # sine of the pitch beyond which nothing is ahead


@dataclass(frozen=True, eq=False)
class _Rows:
    """Means along the level rows of a panorama, the highest first.

    Attributes:
        turn_rad: how much of each row they are of.
        logs: ln radiance.
        clipped: part that is clipped.
    """

    turn_rad: Float[np.ndarray, " rows"]
    logs: Float[np.ndarray, "rows 3"]
    clipped: Float[np.ndarray, "rows 3"]


def continued(
    surroundings: Float32[np.ndarray, "height width 3"], photo: ProjectedPhoto, tilt: Tilt
) -> Float32[np.ndarray, "height width 3"]:
    """The surroundings brought to the photo's level rows all around.

    Also where the photo looks, so that its edge is compared with what goes on from it. Power of the
    rest is kept.

    Args:
        surroundings: linear radiance, camera frame.
        photo: at as many rows or more.
        tilt: the camera's; the less it is known, the less goes on.
    """
    up = tilt.up
    if abs(VIEW @ up) > _STEEPEST:
        return surroundings
    height, width, _ = surroundings.shape
    shown = _rows_of_photo(photo, up, height)
    change = _change(shown, _rows_of_map(surroundings, up))
    if change is None:
        return surroundings
    trust = np.exp(-((tilt.scale_rad / DOUBT_RAD) ** 2) / 2)
    axes = np.stack([up, normalised(VIEW - (VIEW @ up) * up)], axis=1).astype(np.float32)
    upwards, ahead = np.moveaxis(latlong.directions(height, width) @ axes, -1, 0)
    first, part = _row_and_part(upwards, height)
    doubtful = _blurred(change, BLUR_OF_DOUBT * tilt.scale_rad) * (1 - trust)
    in_front = change * ((1 + trust) / 2) + doubtful / 2
    behind = _blurred(change, BLUR_RAD) * (BEHIND * trust) + doubtful * DOUBTED
    # Channels first: numpy is slow where its inner loop is a texel's three.
    rows = np.concatenate([in_front, behind], axis=1).T.astype(np.float32)
    both = rows.take(first, axis=1)
    both += (rows.take(first + 1, axis=1) - both) * part
    factor, back = both[:3], both[3:]
    factor -= back
    factor *= ((1 + ahead) / 2) ** 2
    factor += back
    np.exp(factor, out=factor)
    result = surroundings * np.ascontiguousarray(np.moveaxis(factor, 0, -1))
    return hidden_kept(result, surroundings, photo)


def _change(
    shown: _Rows, estimated: Float[np.ndarray, "rows 3"]
) -> Float32[np.ndarray, "rows 3"] | None:
    """What brings the estimate's rows to the photo's, as ln, and goes on beyond them.

    None where the photo is too small to go on.
    """
    count = len(estimated)
    least = np.clip(_LEAST_OF_WIDEST * shown.turn_rad.max(), *_LEAST_TURN_RAD)
    known = np.flatnonzero(shown.turn_rad >= least)
    if not len(known):
        return None
    row = np.arange(count)
    nearest = known[np.searchsorted(known, row.clip(known[0], known[-1]))]
    texel = np.pi / count
    fade = smoothstep(1 - np.abs(row - nearest) * texel / _FADE_RAD)
    above_horizon = np.pi / 2 - (nearest + 0.5) * texel
    outer = smoothstep((np.abs(above_horizon) - _OUTER_RAD[0]) / (_OUTER_RAD[1] - _OUTER_RAD[0]))
    is_sky = (row < known[0]) & (above_horizon > 0)
    is_ground = (row > known[-1]) & (above_horizon < 0)
    change = shown.logs[nearest] - estimated
    # Where the photo is clipped it only says "at least".
    change *= np.where(change < 0, 1 - shown.clipped[nearest], 1)
    change *= np.maximum(fade, outer * (SKY * is_sky + is_ground))[:, None]
    return change.astype(np.float32)


def _blurred(change: Float[np.ndarray, "rows 3"], sigma_rad: float) -> Float[np.ndarray, "rows 3"]:
    """Rows blurred by a Gaussian of elevation; a width of 0 leaves them."""
    if sigma_rad <= 0:
        return change
    row = np.arange(len(change)) * (np.pi / len(change) / sigma_rad)
    weight = np.exp(-((row[:, None] - row) ** 2) / 2)
    blurred: np.ndarray = weight @ change / weight.sum(1, keepdims=True)
    return blurred


def _rows_of_photo(photo: ProjectedPhoto, up: Float[np.ndarray, "3"], rows: int) -> _Rows:
    """What the photo shows of `rows` level rows."""
    height, width = photo.seen.shape
    whole = photo.seen[photo.box] > _SHOWN
    upwards = (latlong.directions(height, width)[photo.box] @ up.astype(np.float32))[whole]
    solid_angle = latlong.solid_angles(height, width)[photo.box][whole]
    values = [photo.radiance[photo.box][whole], photo.clipped[photo.box][whole]]
    values[0] = np.log(np.maximum(values[0], _DARKEST))
    turn, means = _means(upwards, solid_angle, np.concatenate(values, axis=1), rows)
    return _Rows(turn, means[:, :3], means[:, 3:])


def _rows_of_map(
    surroundings: Float32[np.ndarray, "height width 3"], up: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "height 3"]:
    """Mean ln radiance of a smooth panorama's level rows."""
    height, width, _ = surroundings.shape
    some = slice(None, None, _EVERY), slice(None, None, _EVERY)
    upwards = (latlong.directions(height, width)[some] @ up.astype(np.float32)).ravel()
    logs = np.log(np.maximum(surroundings[some], _DARKEST)).reshape(-1, 3)
    means = _means(
        upwards, latlong.solid_angles(height, width)[some].ravel(), logs, height // _EVERY
    )[1]
    at = (np.arange(height) + 0.5) / _EVERY - 0.5
    return np.stack([np.interp(at, np.arange(len(means)), mean) for mean in means.T], axis=1)


def _means(
    upwards: Float[np.ndarray, " texels"],
    solid_angle: Float[np.ndarray, " texels"],
    values: Float[np.ndarray, "texels channels"],
    rows: int,
) -> tuple[Float[np.ndarray, " rows"], Float[np.ndarray, "rows channels"]]:
    """Means of texels along level rows, and how much of a row's turn they make up, in rad."""
    first, part = _row_and_part(upwards, rows)
    turn = solid_angle * (rows / np.pi) / np.sqrt(np.maximum(1 - upwards**2, _DARKEST))
    whole = np.zeros((1 + values.shape[1], rows))
    for row, share in ((first, turn * (1 - part)), (first + 1, turn * part)):
        whole[0] += np.bincount(row, share, rows)
        for total, channel in zip(whole[1:], values.T, strict=True):
            total += np.bincount(row, share * channel, rows)
    return whole[0], (whole[1:] / np.maximum(whole[0], 1e-9)).T


def _row_and_part(
    upwards: Float[np.ndarray, "*texels"], rows: int
) -> tuple[Int[np.ndarray, "*texels"], Float[np.ndarray, "*texels"]]:
    """The level row at or above each direction, by its cosine from up, and the next one's part."""
    at = np.arccos(upwards.clip(-1, 1)) * np.float32(rows / np.pi) - np.float32(0.5)
    at = at.clip(0, rows - 1)
    first = np.minimum(at.astype(np.intp), rows - 2)
    return first, at - first.astype(np.float32)
