"""Seen pixels and the network's estimates of all views as one light, its power right.

Where a view looked, its pixels count. Elsewhere the estimates are merged twice: the mean of their
logarithms is the sharper map (a lamp that each view puts elsewhere does not smear), the mean of
their radiance has the right power. So the map is that of the logarithms, and the power that it
lacks stands as one lobe where it is brightest: maps as logarithms, lamps as lamps. No lamp is
looked for below the horizon, where floors are as dark as the logarithms say.

A clipped pixel says only how much light there is at least. How much more it is follows from what is
usual and from the estimates' power, less all that comes from elsewhere: what lamps must have for
things to be lit as the network sees them lit. It goes where most channels clip (a coloured surface
clips in one; a lamp in all) and where the estimates are bright, too, in the estimates' colour.
docs/fuse.md has the measurements behind each choice.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Float32

from deeplight.camera_response import LUMINANCE
from deeplight.environment import Environment
from deeplight.frames import Rotation, turned
from deeplight.fuse.blend import Seen, blended
from deeplight.fuse.steady import Steadily
from deeplight.fuse.view import View
from deeplight.mappings import latlong, mirror_ball, resample

ESTIMATE_ROWS = 64
"""Rows of the panorama in which estimates are merged; a pixel of theirs is 7 degrees wide."""
_LEVEL = 0.5  # sine of the pitch at which an estimate's power counts 1 / e
_DIM = 1.2  # what estimates lack: found on simulated pans, see docs/fuse.md
_POWER_SIGMA = 0.6  # ln by which the whole light is off then, standard deviation
_CLIPPED_LOG, _CLIPPED_SCALE = 1.4, 0.5  # ln of the factor by which clipped parts exceed white
_CLIPPED_HIGH_LOG = 2.3  # the same of what is overhead: lamps and the sun, not windows
_HIGH_FROM, _HIGH_TO = 0.3, 0.6  # sine of the elevation between which one becomes the other
_LOG_STEP, _LOG_STEPS = 0.025, 400
_NEAR = 1.0  # how much more an estimate counts near where its camera looked: e^(cos - 1)
_LOBE_KAPPA = 250.0  # of the lobe of lost power: 5 degrees, a lamp and no glow
_HORIZON = 0.2  # sines of elevations across which power begins to be looked for: no lamp is below
_FIND_KAPPA = 12.0  # width in which the brightest place is looked for
_FIND_ROWS = 32
_STILL_HIDDEN = 0.5  # share of a texel that must be unseen for a lamp to stay there

Panorama = Float32[np.ndarray, "height width 3"]
Gains = Float[np.ndarray, "views 3"]


def log_power(view: View) -> Float[np.ndarray, "3"]:
    """ln of the estimate's mean radiance over all directions, relative to the view's white."""
    share = mirror_ball.solid_angles(len(view.log_estimate)) / (4 * np.pi)
    return np.log(np.einsum("ij,ijc->c", share, np.exp(view.log_estimate.astype(np.float64))))


def environment_of(
    views: Sequence[View],
    log_gain: Gains,
    trust: Float[np.ndarray, "views cells"],
    world_from_frame: Rotation,
    height: int,
    steadily: Steadily | None = None,
) -> Environment:
    """One light out of all views.

    Args:
        views: in one world.
        log_gain: of each view, relative to the unit wanted.
        trust: of each view in each coarse cell of the world.
        world_from_frame: the frame wanted.
        height: rows of the panorama.
        steadily: how to change what is only believed, to be shown while one turns; left out, not.
    """
    directions = latlong.directions(height, 2 * height)
    seen = blended(views, log_gain, trust, turned(directions, world_from_frame))
    rows = min(ESTIMATE_ROWS, height)
    coarse = turned(latlong.directions(rows, 2 * rows), world_from_frame)
    logs, mean = merged(views, log_gain, coarse)
    if rows < height:
        bands = np.array_split(directions, 8)  # a look-up takes five times what it gives
        logs, mean = (
            np.concatenate([resample.sample_latlong(part, band) for band in bands])
            for part in (logs, mean)
        )
    known = seen.share[..., None]
    radiance = known * seen.radiance + (1 - known) * logs
    rises = (directions @ (up_of(views) @ world_from_frame)).astype(np.float32)
    above = np.clip(rises / _HORIZON + 0.5, 0, 1)
    radiance += _lost_lobe(logs, mean, (1 - seen.share) * above, steadily)
    if seen.clipped.any():
        radiance = _with_lamps(radiance, mean, seen, expected_power(views, log_gain), rises)
    if steadily is not None:
        radiance = _shaded(radiance, seen, steadily)
    return Environment(radiance, np.clip(seen.share, 0, 1))


def merged(
    views: Sequence[View], log_gain: Gains, directions: Panorama
) -> tuple[Panorama, Panorama]:
    """All estimates along directions (world): e^(mean of logarithms), and mean of radiance.

    In the first an estimate counts more near where its camera looked; the second is about power,
    to which all of them contribute alike.
    """
    shape, directions = directions.shape, directions.reshape(-1, 3)
    logs, mean = (np.zeros((len(directions), 3), np.float32) for _ in range(2))
    weight = np.zeros((len(directions), 1), np.float32)
    for view, gain in zip(views, log_gain, strict=True):
        own = turned(directions, view.world_from_camera.T)
        estimate = resample.sample_ball(view.log_estimate, own) - gain.astype(np.float32)
        near = np.exp(_NEAR * (directions @ view.towards.astype(np.float32) - 1))[:, None]
        logs += near * estimate
        weight += near
        mean += np.exp(estimate)
    return np.exp(logs / weight).reshape(shape), (mean / len(views)).reshape(shape)


def share_of(part: Float32[np.ndarray, "h w"]) -> float:
    """Mean over all directions."""
    height = len(part)
    return float((part * latlong.solid_angles(height, 2 * height)).sum() / (4 * np.pi))


def _shaded(radiance: Panorama, seen: Seen, steadily: Steadily) -> Panorama:
    """The light with what is unseen or clips brighter or darker; seen pixels stay themselves."""
    height = len(radiance)
    solid_angle = latlong.solid_angles(height, 2 * height)
    known = (seen.share * (seen.clipped == 0))[..., None] * seen.radiance
    powers = [np.einsum("hwc,hw->c", part, solid_angle) for part in (known, radiance - known)]
    factor = np.float32(steadily.shade(powers[0], powers[1], share_of(seen.share)))
    return known + factor * (radiance - known)


def _lost_lobe(
    logs: Panorama,
    mean: Panorama,
    unseen: Float32[np.ndarray, "h w"],
    steadily: Steadily | None,
) -> Panorama:
    """The power that the logarithms' map lacks where nothing was seen above, as one lobe there."""
    height = len(logs)
    solid_angle = latlong.solid_angles(height, 2 * height).astype(np.float32)
    weight = unseen * solid_angle
    lost = np.einsum("hwc,hw->c", np.maximum(mean - logs, 0), weight)
    if not lost @ LUMINANCE > 0:
        return np.zeros_like(logs)
    towards = _brightest(logs * weight[..., None], unseen, steadily)
    lobe = np.exp(_LOBE_KAPPA * (latlong.directions(height, 2 * height) @ towards - 1)) * unseen
    power = float((lobe * solid_angle).sum())
    if power <= 0:
        return np.zeros_like(logs)
    result: np.ndarray = lobe[..., None] * (lost / power).astype(np.float32)
    return result


def _brightest(
    power: Panorama, unseen: Float32[np.ndarray, "h w"], steadily: Steadily | None
) -> Float[np.ndarray, "3"]:
    """The direction round which most of the power lies, or where the lamp was, if not much less."""
    rows = min(_FIND_ROWS, len(power))
    coarse = resample.shrink(power, rows, 2 * rows).reshape(-1, 3) @ LUMINANCE.astype(np.float32)
    directions = latlong.directions(rows, 2 * rows).reshape(-1, 3)
    brightness = _nearness(rows) @ coarse
    best = int(brightness.argmax())
    if steadily is None:
        return directions[best]
    hidden = resample.shrink(unseen[..., None], rows, 2 * rows).ravel()

    def of(direction: Float[np.ndarray, "3"]) -> float:
        texel = int((directions @ direction).argmax())
        return float(brightness[texel] * (hidden[texel] > _STILL_HIDDEN))

    return steadily.place(directions[best], of).astype(np.float32)


@lru_cache(maxsize=2)
def _nearness(rows: int) -> Float32[np.ndarray, "texels texels"]:
    """e^(kappa (cos - 1)) between all texels of a panorama."""
    directions = latlong.directions(rows, 2 * rows).reshape(-1, 3)
    return np.asarray(np.exp(_FIND_KAPPA * (directions @ directions.T - 1)), np.float32)


def up_of(views: Sequence[View]) -> Float[np.ndarray, "3"]:
    """Where up is in the world: people hold phones straight."""
    up = np.mean([view.world_from_camera[:, 1] for view in views], axis=0)
    result: np.ndarray = up / max(float(np.linalg.norm(up)), 1e-9)
    return result


def expected_power(views: Sequence[View], log_gain: Gains) -> Float[np.ndarray, "3"]:
    """Radiance summed over all directions that the estimates speak for, per channel.

    The network knows pictures held level best; of one that looks into a lamp it may say ten times
    too much. So views count by how level they look, and between the mean of their power and that
    of its logarithm, which is too dark, stands the square of the mean root.
    """
    up = up_of(views)
    weight = np.array([np.exp(-((view.towards @ up / _LEVEL) ** 2)) for view in views])
    weight = weight / weight.sum()
    roots = np.exp((np.stack([log_power(view) for view in views]) - log_gain) / 2)
    result: np.ndarray = 4 * np.pi * _DIM * (weight @ roots) ** 2
    return result


def _with_lamps(
    radiance: Panorama,
    mean: Panorama,
    seen: Seen,
    whole: Float[np.ndarray, "3"],
    rises: Float32[np.ndarray, "height width"],
) -> Panorama:
    """Clipped pixels with the power that is likely for them."""
    height = len(radiance)
    solid_angle = latlong.solid_angles(height, 2 * height)
    power = (radiance @ LUMINANCE) * solid_angle
    bound = power * (seen.clipped > 0)
    least, rest = float(bound.sum()), float((power - bound).sum())
    usual = float((bound * usual_factor(rises)).sum() / least)
    share = seen.clipped**3 * (radiance @ LUMINANCE) * (mean @ LUMINANCE) ** 2
    share = share / (share * solid_angle).sum()
    colour = np.einsum("hwc,hw->c", mean, share * solid_angle)
    more = least * (likely_factor(least, rest, float(whole @ LUMINANCE), usual) - 1)
    result: np.ndarray = radiance + share[..., None] * (colour * (more / (colour @ LUMINANCE)))
    return result.astype(np.float32)


def usual_factor(sine: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """By how much what clips at an elevation (its sine) is usually brighter than white."""
    high = np.clip((sine - _HIGH_FROM) / (_HIGH_TO - _HIGH_FROM), 0, 1)
    result: np.ndarray = np.exp(_CLIPPED_LOG + (_CLIPPED_HIGH_LOG - _CLIPPED_LOG) * high)
    return result


def likely_factor(bound: float, rest: float, whole: float, usual: float) -> float:
    """By how much clipped pixels are likely to be brighter than white, all in all.

    Two things are known of it. It is about `usual`, and now and then something quite different
    (the sun): Cauchy's distribution. And the whole light is about `whole`, with an error
    that is normal in its logarithm. The likeliest factor is looked for step by step.

    Args:
        bound: power of the clipped pixels if they were just white.
        rest: power of everything else.
        whole: power that the estimates speak for.
        usual: factor of such pixels in other places.
    """
    logs = np.arange(_LOG_STEPS + 1) * _LOG_STEP
    off = np.log(whole / (rest + bound * np.exp(logs))) / _POWER_SIGMA
    unusual = 2 * np.log(1 + ((logs - np.log(usual)) / _CLIPPED_SCALE) ** 2)
    log: np.ndarray = logs[(off**2 + unusual).argmin()]
    return float(np.exp(log))
