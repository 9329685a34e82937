"""The outline of a sphere to a fraction of a pixel, from many frames at full size.

Along spokes across the outline every kept frame gives a profile of grey values. The rig is still,
so the step from sphere to world is at one place in all of them, whatever its height and sign are
in each. Each spoke's place is the one at which a sharp step explains its profiles best;
the cone is then fitted to all spokes robustly, which leaves out the stalk and the neighbours.
"""

from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from deeplight.camera import PinholeCamera
from deeplight.capture.conic import Cone, moved, pixel_scale, rays_around

SPOKES = 144
SURE = 0.8  # support from which on an outline is not looked for another way
MOST_FRAMES = 24  # looked at, more or less
_ANGLES = np.arange(SPOKES) * (2 * np.pi / SPOKES)
_STEP_PX = 0.5  # between samples of a profile
_SHARPNESS_PX = (0.4, 0.6, 0.9)  # how sharp a camera and its compression may draw an edge
_CLEAR = 0.1  # how much better, as a logarithm, an edge explains a spoke than no edge does
_HIT_PX, _COARSE_HIT_PX = 1.0, 2.0  # how near an outline a spoke's edge is its own
_TOGETHER = 9  # neighbouring spokes that are averaged: 22 degrees of the outline
_NOISE = 1.0  # grey levels of noise that no model explains

Profiles = Float[np.ndarray, "frames spokes samples"]


_BLUR_PX = 0.5  # a drawn edge is so wide, and counts as inside
_RINGED_BLUR_PX = 1.15  # by measuring: more of it does where a ring may end inside, too
_RIM_PX = 2.5  # the narrowest rim that is distinct from the ring inside of it
_RING_COST = 0.15  # of a third line: it must explain more than chance does


@dataclass(frozen=True)
class HeldSolution:
    """What is known of the size before an outline is fitted.

    Attributes:
        growth_px: of the circle, that is expected.
        stiffness: cost for each spoke and squared pixel of another growth.
    """

    growth_px: float
    stiffness: float


FREE = HeldSolution(0.0, 0.0)


@dataclass(frozen=True)
class Size:
    """About how large a sphere is seen.

    Attributes:
        radius_rad: the angular radius that is expected.
        stiffness: cost, of each spoke, of a radius that is 1 % off; grows with the square.
    """

    radius_rad: float
    stiffness: float

    def held(self, cone: Cone, camera: PinholeCamera) -> HeldSolution:
        """The same for a move of `cone`, in pixels."""
        expected_px = self.radius_rad * pixel_scale(camera)
        growth_px = expected_px - cone.angular_radius_rad * pixel_scale(camera)
        return HeldSolution(growth_px, self.stiffness * (100 / expected_px) ** 2)


@dataclass(frozen=True)
class SphereOutline:
    """A sphere's outline fitted to the frames.

    Attributes:
        cone: where the sphere is.
        support: share of all spokes with a clear edge that the outline passes within a pixel.
        seen: share of the outline that lies inside the picture.
        together: the same of spokes that are averaged with their neighbours first: in a dark or
            noisy picture the edges of a sphere are seen so, and those of a chance circle are not.
    """

    cone: Cone
    support: float
    seen: float
    together: float = 0.0


def refine(
    cone: Cone,
    frames: list[UInt8[np.ndarray, "height width"]],
    camera: PinholeCamera,
    near: bool = False,
) -> SphereOutline:
    """The outline around `cone` in full-size frames of a clip.

    `near`: it is known to lie within a few pixels, so nothing farther is looked at.
    """
    radius_px = cone.angular_radius_rad * pixel_scale(camera)
    start = cone
    reaches = (0.20 * radius_px, 0.12 * radius_px)
    for reach in reaches[near:]:
        reach = max(reach, 5.0)
        profiles, offsets, inside = profiles_across(cone, frames, camera, (-reach, reach))
        if not inside.any():
            return SphereOutline(cone, 0.0, 0.0)
        places, cost = split_cost(profiles, offsets)
        cone = _moved_to_best(cone, places, cost, inside, camera)
    outline = _fine(cone, frames, camera)
    if outline.support > SURE:
        return outline
    again = [
        _fine(moved(start, np.zeros(2), g * start.angular_radius_rad), frames, camera)
        for g in (0.0, 0.02)
    ]
    return max([outline, *again], key=lambda option: option.support)


def refine_place(
    cone: Cone,
    frames: list[UInt8[np.ndarray, "height width"]],
    camera: PinholeCamera,
    stiffness: float = np.inf,
) -> SphereOutline:
    """The outline around `cone` with the angular radius it has, or about that (see `Size`)."""
    return _fine(cone, frames, camera, Size(cone.angular_radius_rad, stiffness))


def refine_by_sides(
    cone: Cone,
    frames: list[UInt8[np.ndarray, "height width"]],
    camera: PinholeCamera,
    stiffness: float,
    ringed: bool = False,
) -> SphereOutline:
    """The outline where what is inside and what is outside differ most, edge or no edge.

    For the mirror, whose rim is hardly darker than what lies behind it: coarser than `refine`,
    but it does not take the reflections' rings for the rim.

    Args:
        cone: where to begin, with the angular radius that is expected.
        frames, camera: full size.
        stiffness: of that radius; see `Size`.
        ringed: a bright ring may end inside of the rim, such as a horizon before dark ground;
            coarser.
    """
    size = Size(cone.angular_radius_rad, stiffness)
    for share in (0.2, 0.15, 0.12, 0.1):
        reach = max(share * size.radius_rad * pixel_scale(camera), 5.0)
        profiles, offsets, inside = profiles_across(cone, frames, camera, (-reach, reach))
        if not inside.any():
            return SphereOutline(cone, 0.0, 0.0)
        places, cost = split_cost(profiles, offsets, ringed)
        outline = _judged(cone, places, cost, inside, _COARSE_HIT_PX)
        cone = _moved_to_best(cone, places, cost, inside, camera, size.held(cone, camera))
    blur_px = _RINGED_BLUR_PX if ringed else _BLUR_PX
    blurred = moved(cone, np.zeros(2), -blur_px / pixel_scale(camera))
    return replace(outline, cone=blurred)


def _judged(
    cone: Cone, places: np.ndarray, cost: np.ndarray, inside: np.ndarray, hit_px: float
) -> SphereOutline:
    """The outline with what its spokes say of it."""
    around = np.pad(cost, ((_TOGETHER // 2, _TOGETHER // 2), (0, 0)), mode="wrap")
    sums = np.cumsum(np.pad(around, ((1, 0), (0, 0))), axis=0, dtype=np.float64)
    pooled = (sums[_TOGETHER:] - sums[:-_TOGETHER]) / _TOGETHER
    # Noise, and so what is clear in it, falls with the root of how much is averaged.
    kinds = ((cost, _CLEAR), (pooled, _CLEAR / _TOGETHER**0.5))
    support, together = (_hits(places, each, clear, hit_px)[inside].sum() for each, clear in kinds)
    count = len(cost)
    return SphereOutline(
        cone, float(support / count), float(inside.mean()), float(together / count)
    )


def _hits(places: np.ndarray, cost: np.ndarray, clear: float, hit_px: float) -> np.ndarray:
    """Which spokes have a clear edge at the outline."""
    is_clear = np.median(cost, axis=1) - cost.min(axis=1) > clear
    hits: np.ndarray = (np.abs(places[cost.argmin(axis=1)]) < hit_px) & is_clear
    return hits


def _fine(
    cone: Cone,
    frames: list[UInt8[np.ndarray, "height width"]],
    camera: PinholeCamera,
    size: Size | None = None,
) -> SphereOutline:
    reach = float(np.clip(0.15 * cone.angular_radius_rad * pixel_scale(camera), 4.5, 6.0))
    for last in (False, False, True):
        profiles, offsets, inside = profiles_across(cone, frames, camera, (-0.7 * reach, reach))
        if not inside.any():
            return SphereOutline(cone, 0.0, 0.0)
        fits = [step_cost(profiles, offsets, sigma) for sigma in _SHARPNESS_PX]
        places, cost = min(fits, key=lambda fit: fit[1].min(axis=1).mean())
        if not last:
            held = size.held(cone, camera) if size else FREE
            cone = _moved_to_best(cone, places, cost, inside, camera, held)
    return _judged(cone, places, cost, inside, _HIT_PX)


def _moved_to_best(
    cone: Cone,
    places: np.ndarray,
    cost: np.ndarray,
    inside: np.ndarray,
    camera: PinholeCamera,
    held: HeldSolution = FREE,
) -> Cone:
    shift, growth = best_circle(places, cost[inside], _ANGLES[inside], held)
    return moved(cone, shift / pixel_scale(camera), growth / pixel_scale(camera))


def best_circle(
    places: Float[np.ndarray, "places"],
    cost: Float[np.ndarray, "spokes places"],
    angles_rad: Float[np.ndarray, "spokes"],
    held: HeldSolution = FREE,
) -> tuple[Float[np.ndarray, "2"], float]:
    """Shift and growth, in pixels, of the circle that costs least over all spokes together.

    No spoke costs more than a bound: one that sees the stalk or a neighbour gives up its say.
    """
    cost = cost - cost.min(axis=1, keepdims=True)
    cost = np.minimum(cost, 1.5 * np.median(cost, axis=1, keepdims=True).mean())
    step, reach = places[1] - places[0], places[-1]
    columns = np.stack([np.cos(angles_rad), np.sin(angles_rad), np.ones_like(angles_rad)], axis=-1)
    centre, spread = np.zeros(3), reach / 2
    grid = np.stack(np.meshgrid(*[np.linspace(-1, 1, 9)] * 3), axis=-1).reshape(-1, 3)
    if np.isinf(held.stiffness):
        grid, centre = grid[grid[:, 2] == 0], np.array([0.0, 0.0, held.growth_px])
    while spread > 0.02:
        tried = centre + spread * grid
        at = (tried @ columns.T - places[0]) / step
        low = np.clip(np.floor(at).astype(int), 0, len(places) - 2)
        part = np.clip(at - low, 0, 1)
        row = np.arange(len(cost))
        total = ((1 - part) * cost[row, low] + part * cost[row, low + 1]).sum(axis=1)
        if not np.isinf(held.stiffness):
            total += len(cost) * held.stiffness * (tried[:, 2] - held.growth_px) ** 2
        centre, spread = tried[total.argmin()], spread * 0.4
    return centre[:2], float(centre[2])


def profiles_across(
    cone: Cone,
    frames: list[UInt8[np.ndarray, "height width"]],
    camera: PinholeCamera,
    reach_px: tuple[float, float],
) -> tuple[Profiles, Float[np.ndarray, "samples"], np.ndarray]:
    """Grey values across the outline, their places in pixels outwards, which spokes are seen."""
    inner, outer = (round(reach / _STEP_PX) for reach in reach_px)
    offsets = np.arange(inner, outer + 1) * _STEP_PX
    rays = rays_around(cone, _ANGLES, offsets / pixel_scale(camera))
    row, column = (a.astype(np.float32) for a in camera.pixel_of_directions(rays))
    seen_by = frames[:: max(1, round(len(frames) / MOST_FRAMES))]
    profiles = np.stack([cv2.remap(f, column, row, cv2.INTER_LINEAR) for f in seen_by])
    inside = (row > 0) & (row < camera.height - 1) & (column > 0) & (column < camera.width - 1)
    seen: np.ndarray = np.all(inside, axis=1)
    return profiles.astype(np.float32), offsets, seen


def split_cost(
    profiles: Profiles, offsets: Float[np.ndarray, "samples"], ringed: bool = False
) -> tuple[Float[np.ndarray, "places"], Float[np.ndarray, "spokes places"]]:
    """How badly two straight lines, one each side of a place, explain the profiles; coarse.

    Each side has its own spread, so a smooth ball before a busy world and a busy ball before a
    smooth world are treated alike. Logarithms are averaged over the frames: a hand in some of
    them does not outvote the rest. `ringed`: the inner side may be two lines, as suits.
    """
    count, least = len(offsets), max(4, len(offsets) // 8)
    x = offsets - offsets[0] + 1
    y = profiles.astype(np.float64)
    y = y - y.mean(axis=2, keepdims=True)
    sums = [np.cumsum(v, axis=-1) for v in (np.ones_like(x), x, x * x, y, x * y, y * y)]

    def line(start: int, end: int) -> np.ndarray:
        part = [v[..., end - 1] - (v[..., start - 1] if start else 0) for v in sums]
        spread = _unexplained(part) / (end - start) + _NOISE**2
        share: np.ndarray = (end - start) / count * np.log(spread)
        return share

    rim = max(4, round(_RIM_PX / _STEP_PX))
    rings = range(least, count - least - rim, 3) if ringed else ()
    within = {ring: line(0, ring) + _RING_COST for ring in rings}
    cost = []
    for place in range(least, count - least):
        inner = line(0, place)
        for ring in [ring for ring in rings if ring < place - rim]:
            inner = np.minimum(inner, within[ring] + line(ring, place))
        cost.append((inner + line(place, count)).mean(axis=0))
    places = offsets[least : count - least] - _STEP_PX / 2
    return places, np.stack(cost, axis=1)


def _unexplained(sums: list[Any]) -> np.ndarray:
    """Sum of squares left by the best straight line, from sums of 1, x, xx, y, xy and yy."""
    n, x, xx, y, xy, yy = sums
    spread_x, shared = xx - x * x / n, xy - x * y / n
    return np.maximum(yy - y * y / n - shared**2 / spread_x, 0)


def step_cost(
    profiles: Profiles, offsets: Float[np.ndarray, "samples"], sigma_px: float
) -> tuple[Float[np.ndarray, "places"], Float[np.ndarray, "spokes places"]]:
    """How badly a step at each place explains the profiles; fine."""
    places, bases = _step_models(tuple(offsets), sigma_px)
    frames, spokes, samples = profiles.shape
    flat = (profiles - profiles.mean(axis=2, keepdims=True)).reshape(-1, samples)
    energy = (flat**2).sum(axis=1)
    cost = np.empty((spokes, len(places)), np.float32)
    for i, basis in enumerate(bases):
        left = np.maximum(energy - ((flat @ basis) ** 2).sum(axis=1), 0) / samples
        cost[:, i] = np.log(left + _NOISE**2 / 4).reshape(frames, spokes).mean(axis=0)
    return places, cost


@lru_cache(maxsize=64)
def _step_models(
    offsets: tuple[float, ...], sigma_px: float
) -> tuple[np.ndarray, list[np.ndarray]]:
    """Places to try, and for each an orthonormal basis of the profiles with a step there.

    Outside: level and slope. Inside: level, slope, and the square root that the shading of any
    ball has at its rim, where the surface turns away. All seen through the camera's sharpness.
    """
    fine = 8
    x = np.array(offsets)
    step = x[1] - x[0]
    dense = np.arange(x[0] - 2, x[-1] + 2 + 1e-9, step / fine)
    kernel = np.exp(-0.5 * (np.arange(-30, 31) * step / fine / sigma_px) ** 2)
    kernel /= kernel.sum()
    reach = 0.5 * min(-x[0], x[-1])
    places = np.arange(-reach, reach + 1e-9, 0.125)
    bases = []
    for place in places:
        outside, away = dense > place, dense - place
        columns = [
            outside * 1.0,
            outside * away,
            ~outside * 1.0,
            ~outside * away,
            np.sqrt(np.maximum(-away, 0)),
        ]
        seen = [np.interp(x, dense, np.convolve(c, kernel, mode="same")) for c in columns]
        bases.append(np.linalg.qr(np.stack(seen, axis=1))[0].astype(np.float32))
    return places, bases
