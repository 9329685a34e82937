"""Light from one mapping to another, energy kept.

Going to fewer pixels is an area average over everything a pixel sees: a look-up would miss
the sun, which is smaller than one pixel of a 4k panorama. Going from the 32 x 32 ball to
more pixels is smooth, and then corrected until every ball pixel holds its energy again.
Radiance is linear and unclipped throughout.
"""

from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int, Shaped

from deeplight.errors import ShapeError
from deeplight.frames import Rotation, rotation, turned
from deeplight.mappings import cube, latlong, mirror_ball

Radiance = Float[np.ndarray, "height width channels"]

_IDENTITY = np.eye(3)
SUPERSAMPLED_UP_TO = 2048
"""Rows; a larger panorama is turned without supersampling, for memory's sake."""
_KEPT_UP_TO = 2**20
"""Texels of a panorama whose places on the ball are kept for the next one, if it is not turned."""
_TEXELS_PER_PIXEL = 24  # below this, panorama texels are split before they are binned
_TEXELS_OF_EXACT_POWER = 200


def shrink(
    values: Shaped[np.ndarray, "height width channels"], height: int, width: int
) -> Float[np.ndarray, "new_height new_width channels"]:
    """Mean over exact, also fractional, areas: an image at `height` x `width`.

    Also enlarges, as a piecewise-constant image would. float32 result.
    """
    return _area_mean(_area_mean(values, height, axis=0), width, axis=1)


def shrink_latlong(
    radiance: Radiance, height: int
) -> Float[np.ndarray, "new_height new_width channels"]:
    """A panorama at `height` x 2 `height`, averaged by solid angle: near the poles a cell's
    upper rows are much smaller than its lower ones."""
    weight = latlong.solid_angles(*radiance.shape[:2])[..., None]
    power = shrink(radiance * weight, height, 2 * height)
    return power / shrink(weight, height, 2 * height)


def ball_from_latlong(
    radiance: Radiance,
    size: int,
    ball_from_latlong: Rotation = _IDENTITY,
    exact_power: bool = False,
) -> Float[np.ndarray, "size size channels"]:
    """The mirror ball of a panorama: each pixel is the mean radiance over what it sees.

    Every texel's power goes into the one pixel it falls into, so nothing is missed and
    the total over 4 pi is kept. Pixels off the disc are zero.

    Args:
        exact_power: a pixel's texels do not quite make up its solid angle, so a sun of one
            texel gains or loses up to 14 % of its power in a small panorama. With this, what
            stands out of the darkest texel of a pixel is divided by the pixel's own solid angle:
            the power is kept to float32's precision (from 32 rows on), and even light stays even.
    """
    texels = _TEXELS_OF_EXACT_POWER if exact_power else _TEXELS_PER_PIXEL
    parts = _parts_of_texels(radiance, size, texels)
    height, width, channels = radiance.shape
    kept = height * width * parts**2 <= _KEPT_UP_TO and np.array_equal(ball_from_latlong, _IDENTITY)
    if kept:
        texel, pixel, solid_angle = _shares_of_upright(height, width, parts, size)
    else:
        texel, pixel, solid_angle = _shares(height, width, parts, size, ball_from_latlong)
    area = np.bincount(pixel, solid_angle, size * size)
    ball = np.zeros((size * size, channels), np.float32)
    for channel in range(channels):
        values = radiance[..., channel].ravel()[texel]
        power = np.bincount(pixel, values * solid_angle, size * size)
        if exact_power:
            darkest = _darkest(values, pixel, size)
            own = mirror_ball.solid_angles(size).ravel()
            ball[:, channel] = darkest
            standing_out = np.maximum(power - darkest * area, 0)
            ball[:, channel] += np.divide(standing_out, own, np.zeros_like(own), where=own > 0)
        else:
            np.divide(power, area, out=ball[:, channel], where=area > 0, casting="same_kind")
    _fill_missed(ball, area, radiance, parts, ball_from_latlong)
    return ball.reshape(size, size, channels)


def latlong_from_ball(
    ball: Float[np.ndarray, "size size channels"],
    height: int = 256,
    latlong_from_ball: Rotation = _IDENTITY,
) -> Radiance:
    """A smooth `height` x 2 `height` panorama that holds the energy of each ball pixel."""
    # Made finer and averaged: at 256 rows a ball pixel catches some 100 texels, and their
    # count would misstate its solid angle, so a lone sun's power, by up to 5 %.
    fine = height if height >= 512 else 2 * height
    directions = latlong.directions(fine, 2 * fine)
    weights = latlong.solid_angles(fine, 2 * fine).astype(np.float32)
    radiance = _enlarge(ball, turned(directions, latlong_from_ball.T), weights)
    return shrink_latlong(radiance, height) if fine > height else radiance


def cube_from_ball(
    ball: Float[np.ndarray, "ball ball channels"], size: int = 128
) -> Float[np.ndarray, "6 size size channels"]:
    """The six faces of `cube.FACES`, smooth, with the energy of each ball pixel."""
    weights = np.broadcast_to(cube.solid_angles(size), (6, size, size)).astype(np.float32)
    return _enlarge(ball, cube.directions(size).astype(np.float32), weights)


def sample_ball(
    ball: Float[np.ndarray, "size size channels"], directions: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n channels"]:
    """Values of a mirror ball in directions, bilinear; pixels off the disc are not looked at."""
    size = len(ball)
    values = _spread_over_rim(ball).reshape(size * size, -1)
    return _interpolate(values, _bilinear_taps(directions, size))


def turned_ball(
    ball: Float[np.ndarray, "size size channels"], new_from_old: Rotation
) -> Float[np.ndarray, "size size channels"]:
    """The same light on a ball turned into another frame."""
    size = ball.shape[0]
    height = max(256, 8 * size)
    return ball_from_latlong(latlong_from_ball(ball, height), size, new_from_old)


def turned_latlong(radiance: Radiance, new_from_old: Rotation) -> Radiance:
    """A panorama whose light is turned; about the vertical by whole columns it stays exact.

    Otherwise bilinear, twice supersampled up to `SUPERSAMPLED_UP_TO` rows.
    """
    height, width, _ = radiance.shape
    about_up = np.arctan2(new_from_old[0, 2], new_from_old[2, 2])
    columns = about_up * width / (2 * np.pi)
    upright = np.allclose(new_from_old, rotation("y", about_up), atol=1e-9)
    if upright and abs(columns - round(columns)) < 1e-6:
        return np.roll(radiance, -round(columns), axis=1)
    fine = 2 * height if height <= SUPERSAMPLED_UP_TO else height
    shown = turned(latlong.directions(fine, 2 * fine), new_from_old.T)
    result = sample_latlong(radiance, shown)
    return (shrink_latlong(result, height) if fine > height else result).astype(np.float32)


def sample_latlong(
    radiance: Radiance, directions: Float[np.ndarray, "*batch 3"]
) -> Float[np.ndarray, "*batch channels"]:
    """Bilinear look-up of a panorama, around the back and held at the poles.

    A look-up, not an average: for views at least as fine as the panorama.
    """
    height, width, channels = radiance.shape
    row, column = latlong.position(directions, height, width)
    top, left = np.floor(row), np.floor(column)
    # As 64-bit numbers: the published shards are filmed with these sums, to the last bit.
    down, right = (row - top).astype(np.float64), (column - left).astype(np.float64)
    starts = [(top + k).clip(0, height - 1).astype(np.intp) * width for k in (0, 1)]
    first = np.where(left < 0, width - 1, left).astype(np.intp)
    columns = [first, np.where(first == width - 1, 0, first + 1)]
    pairs = [[(start + column) * channels for column in columns] for start in starts]
    numbers = radiance.ravel()
    result = np.empty((*row.shape, channels), radiance.dtype)
    # Channel by channel: numpy is slow where its inner loop is a texel's three.
    for channel in range(channels):
        own = numbers[channel:]
        upper, lower = (own.take(at[0]) * (1 - right) + own.take(at[1]) * right for at in pairs)
        result[..., channel] = upper * (1 - down) + lower * down
    return result


def _area_mean(values: np.ndarray, size: int, axis: int) -> np.ndarray:
    """Mean over `size` equal stretches of one axis, from differences of its running sum."""
    length = values.shape[axis]
    if length == size:
        return values.astype(np.float32)
    if length % size == 0:
        shape = (*values.shape[:axis], size, length // size, *values.shape[axis + 1 :])
        return values.reshape(shape).mean(axis=axis + 1, dtype=np.float32)
    total = np.cumsum(values, axis=axis, dtype=np.float64)
    total = np.concatenate([np.zeros_like(total.take([0], axis)), total], axis=axis)
    edge = np.arange(size + 1) * (length / size)
    whole = np.minimum(edge.astype(int), length - 1)
    part = (edge - whole).reshape([-1 if a == axis else 1 for a in range(values.ndim)])
    at_edge = total.take(whole, axis) + part * values.take(whole, axis)
    return (np.diff(at_edge, axis=axis) * (size / length)).astype(np.float32)


def _darkest(
    values: Float[np.ndarray, " texels"], pixel: Int[np.ndarray, " texels"], size: int
) -> Float[np.ndarray, " pixels"]:
    """The least value of each pixel's texels; 0 where there are none."""
    least = np.full(size * size, np.inf, values.dtype)
    np.minimum.at(least, pixel, values)
    return np.where(np.isfinite(least), least, 0)


Shares = tuple[
    Int[np.ndarray, " shares"] | slice, Int[np.ndarray, " shares"], Float[np.ndarray, " shares"]
]


def _shares(height: int, width: int, parts: int, size: int, ball_from_latlong: Rotation) -> Shares:
    """The ball pixel that each texel of a panorama falls into, and its solid angle.

    A texel is split into `parts` along a side. Where all of them fall into one pixel, they are one.

    Returns:
        Numbers of texels, all in turn if they are whole, and of pixels, and solid angles.
    """
    fine = height * parts, width * parts
    directions = turned(latlong.directions(*fine), ball_from_latlong)
    found = mirror_ball.pixel_of_directions(directions, size)
    if parts == 1:
        return slice(None), found.ravel(), latlong.solid_angles(*fine).ravel()
    pixel, solid_angle = (
        values.reshape(height, parts, width, parts).swapaxes(1, 2).reshape(-1, parts**2)
        for values in (found, latlong.solid_angles(*fine))
    )
    is_one = (pixel == pixel[:, :1]).all(1)
    whole, split = np.flatnonzero(is_one), np.flatnonzero(~is_one)
    return (
        np.concatenate([whole, split.repeat(parts**2)]),
        np.concatenate([pixel[whole, 0], pixel[split].ravel()]),
        np.concatenate([solid_angle[whole].sum(1), solid_angle[split].ravel()]),
    )


@lru_cache(maxsize=4)
def _shares_of_upright(height: int, width: int, parts: int, size: int) -> Shares:
    """`_shares` where nothing is turned: most of the way to the ball."""
    return _shares(height, width, parts, size, _IDENTITY)


def _parts_of_texels(radiance: Radiance, size: int, texels: int) -> int:
    """Into how many along a side a panorama's texels are split for a ball pixel to get `texels`."""
    if radiance.ndim != 3 or radiance.shape[1] != 2 * radiance.shape[0]:
        raise ShapeError(
            "an equirectangular panorama twice as wide as high",
            f"shape {radiance.shape}",
            "crop or pad it to the full sphere",
        )
    height, width, _ = radiance.shape
    return max(1, int(np.ceil(np.sqrt(texels * size * size / (height * width)))))


def _fill_missed(
    ball: np.ndarray, area: np.ndarray, radiance: Radiance, parts: int, ball_from_latlong: Rotation
) -> None:
    """Give rim slivers that caught no texel the radiance in their direction."""
    size = int(np.sqrt(len(ball)))
    missed = np.flatnonzero((area == 0) & (mirror_ball.coverage(size).ravel() > 0))
    if len(missed):
        directions = mirror_ball.pixel_directions(size).reshape(-1, 3)[missed]
        fine = radiance.repeat(parts, axis=0).repeat(parts, axis=1) if parts > 1 else radiance
        ball[missed] = sample_latlong(fine, turned(directions, ball_from_latlong.T))


def _enlarge(ball: np.ndarray, directions: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Smooth radiance along `directions` whose mean over each ball pixel is that pixel's.

    Interpolates its logarithm, bins the result back to the ball and interpolates the shortfall as a
    factor, a few times over; factors keep it positive where an added correction would not.
    What little is then still missing is made up pixel by pixel, so the mean is exact.
    """
    size, _, channels = ball.shape
    pixel = mirror_ball.pixel_of_directions(directions, size).ravel()
    area = np.bincount(pixel, weights.ravel(), size * size)[:, None]
    taps = _bilinear_taps(directions, size)
    wanted = _spread_over_rim(ball).reshape(-1, channels)
    # Logarithms do not carry the sun into its neighbours, which would then need a dark halo.
    darkest = np.float32(max(1e-6 * float(wanted.max()), 1e-30))
    result = np.exp(_interpolate(np.log(np.maximum(wanted, darkest)), taps))
    flat_weights = weights.reshape(-1, 1)
    for smooth in (True, True, True, False):
        power = np.stack(
            [np.bincount(pixel, c, size * size) for c in (result * flat_weights).T], axis=1
        )
        factor = np.ones_like(power)
        np.divide(wanted * area, power, out=factor, where=power > 0)
        factor = factor.astype(np.float32)
        if smooth:
            factor = np.exp(_interpolate(np.log(np.clip(factor, 0.05, 20)), taps))
        result *= factor if smooth else factor[pixel]
    return result.reshape(*directions.shape[:-1], channels)


def _spread_over_rim(ball: np.ndarray) -> np.ndarray:
    """The ball with pixels off the disc set to their nearest pixel on it."""
    size = ball.shape[0]
    nearest = mirror_ball.nearest_lit(size)
    return ball.reshape(size * size, -1)[nearest].reshape(ball.shape).astype(np.float32)


def _bilinear_taps(directions: np.ndarray, size: int) -> list[tuple[np.ndarray, np.ndarray]]:
    """Four (pixel index, weight) pairs per direction, for interpolation on the ball."""
    u, v = mirror_ball.uv_from_directions(directions.reshape(-1, 3))
    column, row = (u + 1) * (size / 2) - 0.5, (1 - v) * (size / 2) - 0.5
    left, top = np.floor(column).astype(int), np.floor(row).astype(int)
    right, down = column - left, row - top
    taps = []
    for dr, wr in ((0, 1 - down), (1, down)):
        for dc, wc in ((0, 1 - right), (1, right)):
            index = np.clip(top + dr, 0, size - 1) * size + np.clip(left + dc, 0, size - 1)
            taps.append((index, (wr * wc).astype(np.float32)[:, None]))
    return taps


def _interpolate(values: np.ndarray, taps: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    result = np.zeros((len(taps[0][0]), values.shape[-1]), values.dtype)
    for index, weight in taps:
        part = values.take(index, axis=0)  # faster than values[index]
        result += np.multiply(part, weight, out=part)
    return result
