"""The compact lights of an estimate: one the network means, and those the photo shows clipped.

A network answers a doubt about direction with a blurred light. Real lamps are small, so what stands
out around the main direction is one small light (measured: docs/estimate.md). Where the photo shows
a clipped spot near it, that is the lamp, and its place and size are known.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations

import numpy as np
from jaxtyping import Bool, Float, Float32, Int

from deeplight.camera_response import LUMINANCE
from deeplight.estimators.projection import ProjectedPhoto, brightest, smoothstep
from deeplight.frames import normalised
from deeplight.harmonics import dominant_light
from deeplight.lamp import Lamp, draw_lamps, in_their_middle
from deeplight.lighting import Lighting
from deeplight.lobe import lobe_on_ball
from deeplight.mappings import latlong, mirror_ball

CONE_RAD = float(np.radians(70))
"""The main light is what the estimate has above its median within this angle of its direction."""
_CONE_EDGE_RAD = float(np.radians(20))  # over which it fades out inside that angle
LAMP_RADIUS_RAD = float(np.radians(6))
"""Of a lamp whose size nothing shows."""
OWN_RADIUS_RAD = float(np.radians(3.5))
"""A network's lamp is drawn no wider: its lobe's width is its doubt, not the lamp's size. Chosen
between 3 and 5 degrees on validation places: narrower lowers the mirror's error, raises peaks."""
OWN_COLOUR = 0.25
"""How much of their own colour a network's lamps keep; the rest is the whole estimate's. Against
the true main light they err by 8.1 degrees as given, 6.7 with their mean colour, 6.3 with this and
6.2 with the estimate's alone, on validation places (test: 12.8, 11.1, 10.5, 10.4)."""
LARGEST_LAMP_RAD = float(np.radians(6))
"""A clipped area larger than this disc is a window or the sky: it keeps its shape and its power."""
ROUND = 0.6
"""And so does one that covers less than this of the disc of its own size."""
CATCH_RAD = float(np.radians(30))
"""A clipped area takes the estimate's power from so far around: the ball is no sharper."""
LARGEST_OWN_RAD = float(np.radians(15))
"""A network's lamp wider than this is no compact light and stays in the map."""
_BRIGHT = (0.95, 1.03)  # radiance between which a clipped area's power fades in around it
_LEAST_LEFT = 0.01  # of a channel's power, without the lamps: less cannot be recoloured
_LOBE_END = 1e-3  # of a lobe's peak: less is not worth a pixel
TOGETHER_RAD = float(np.radians(15))
"""Lamps nearer to each other than this are one: what parts them is the network's doubt. Up to
here the validation places' diffuse and silver spheres stay as they are and the mirror gains 0.4 %;
wider costs the first two and gains more of the third."""
MOST_LAMPS = 3
LEAST_SHARE = 0.03
"""A light with less of the scene's luminous power stays in the map."""
_UNSEEN = 0.02  # where less than this of a texel is seen, the photo does not look


@dataclass(frozen=True, eq=False)
class Excess:
    """Light that stands out of an estimate, pixel by pixel of the ball, and what is left.

    Attributes:
        rest: the estimate without it.
        pixels: indices of the ball's pixels that have some.
        directions: of these.
        flux: RGB of each, radiance times sr; they sum to the power of the whole less the rest.
        radius_rad: of the lamp that it becomes where nothing shows a size.
    """

    rest: Lighting
    pixels: Int[np.ndarray, " pixels"]
    directions: Float32[np.ndarray, "pixels 3"]
    flux: Float32[np.ndarray, "pixels 3"]
    radius_rad: float


def excess_of(lighting: Lighting) -> Excess:
    """Take out of an estimate what exceeds its own median around its main direction."""
    directions = mirror_ball.pixel_directions(lighting.size).reshape(-1, 3)
    lit = mirror_ball.solid_angles(lighting.size).ravel() > 0
    radiance = lighting.radiance.reshape(-1, 3)
    away = np.arccos((directions @ dominant_light(lighting).direction).clip(-1, 1))
    near = (away < CONE_RAD) & lit
    # A hard end of the cone would show as an edge in the map.
    fade = smoothstep((CONE_RAD - away) / _CONE_EDGE_RAD)[:, None] * near[:, None]
    above = np.maximum(radiance - np.median(radiance[near], 0), 0) * fade
    return _taken_out(lighting, above, LAMP_RADIUS_RAD)


def lobe_of(lighting: Lighting, lamp: Lamp) -> Excess:
    """Take out of an estimate one of the network's own lamps, which the estimate holds."""
    lobe = lobe_on_ball(lamp, lighting.size).reshape(-1, 3)
    lobe = np.minimum(lobe, lighting.radiance.reshape(-1, 3))
    lobe[brightest(lobe) < _LOBE_END * lobe.max()] = 0
    return _taken_out(lighting, lobe, min(lamp.angular_radius_rad, OWN_RADIUS_RAD))


def _taken_out(
    lighting: Lighting, radiance: Float[np.ndarray, "pixels 3"], radius_rad: float
) -> Excess:
    rest = Lighting(lighting.radiance - radiance.reshape(lighting.radiance.shape))
    pixels = np.flatnonzero(brightest(radiance) > 0)
    directions = mirror_ball.pixel_directions(lighting.size).reshape(-1, 3)[pixels]
    solid_angle = mirror_ball.solid_angles(lighting.size).reshape(-1, 1)[pixels]
    flux = (radiance[pixels] * solid_angle).astype(np.float32)
    return Excess(rest, pixels, directions.astype(np.float32), flux, radius_rad)


def _put_back(
    lighting: Lighting, pixels: Int[np.ndarray, " pixels"], flux: Float32[np.ndarray, "pixels 3"]
) -> Lighting:
    solid_angle = mirror_ball.solid_angles(lighting.size).reshape(-1, 1)[pixels]
    radiance = lighting.radiance.reshape(-1, 3).copy()
    radiance[pixels] += (flux / solid_angle).astype(np.float32)
    return Lighting(radiance.reshape(lighting.radiance.shape))


@dataclass(frozen=True, eq=False)
class ClippedArea:
    """One connected clipped part of the photo, on a latlong.

    Attributes:
        direction: its middle.
        solid_angle: in sr.
        mask: its texels.
    """

    direction: Float[np.ndarray, "3"]
    solid_angle: float
    mask: Bool[np.ndarray, "height width"]

    @cached_property
    def outline(self) -> Float32[np.ndarray, "texels 3"]:
        """Directions of a few dozen of its texels: they show its shape well enough."""
        rows, columns = np.divmod(np.flatnonzero(self.mask), self.mask.shape[1])
        step = max(1, len(rows) // 64)
        return latlong.directions(*self.mask.shape)[rows[::step], columns[::step]]

    @property
    def radius_rad(self) -> float:
        """Of the disc of the same solid angle."""
        return float(2 * np.arcsin(np.sqrt(min(self.solid_angle / (4 * np.pi), 1))))

    def lamp(self, flux: Float32[np.ndarray, "3"]) -> Lamp | None:
        """The lamp that this area is, with that flux; None where it is no small round spot."""
        if self.radius_rad > LARGEST_LAMP_RAD:
            return None
        lamp = Lamp(self.direction, flux, max(self.radius_rad, np.pi / len(self.mask) / 2))
        disc = draw_lamps([lamp], len(self.mask))
        return lamp if disc[self.mask].sum() > ROUND * disc.sum() else None


def clipped_areas(clipped: Float32[np.ndarray, "height width"], most: int = 8) -> list[ClippedArea]:
    """The connected clipped parts of the photo, the largest first; 8 neighbours connect."""
    height, width = clipped.shape
    on = clipped > 0.5
    rows, columns = np.flatnonzero(on.any(1)), np.flatnonzero(on.any(0))
    if not len(rows):
        return []
    box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    labels = _connected(on[box])
    solid_angle = latlong.solid_angles(height, width)[box]
    areas = np.bincount(labels[on[box]], solid_angle[on[box]])
    directions = latlong.directions(height, width)[box]
    found = []
    for label in np.argsort(-areas)[:most]:
        if areas[label] <= 0:
            break
        inside = labels == label
        middle = (directions[inside] * solid_angle[inside][:, None]).sum(0)
        mask = np.zeros((height, width), bool)
        mask[box] = inside
        found.append(ClippedArea(normalised(middle.astype(float)), float(areas[label]), mask))
    return found


def _connected(mask: Bool[np.ndarray, "height width"]) -> Int[np.ndarray, "height width"]:
    """Number the connected parts of a mask by the first pixel of each; -1 outside.

    A row's runs are few. Those that touch take the smaller of their numbers, and each then its
    number's own, so a few rounds do.
    """
    height, width = mask.shape
    edge = np.diff(np.pad(mask.astype(np.int8), ((0, 0), (1, 1))), axis=1)
    row, start = np.nonzero(edge > 0)
    end = np.nonzero(edge < 0)[1]
    one, other = _touching(row * (width + 2) + start, row * (width + 2) + end, width + 2)
    label = np.arange(len(row))
    while True:
        before = label.copy()
        least = np.minimum(label[one], label[other])
        np.minimum.at(label, one, least)
        np.minimum.at(label, other, least)
        label = label[label]
        if np.array_equal(label, before):
            break
    first, length = row * width + start, end - start
    result = np.full(mask.size, -1)
    result[_counted(first, length)] = first[label].repeat(length)
    return result.reshape(height, width)


def _touching(
    start: Int[np.ndarray, " runs"], end: Int[np.ndarray, " runs"], row: int
) -> tuple[Int[np.ndarray, " pairs"], Int[np.ndarray, " pairs"]]:
    """Pairs of runs, by number, in a row and the next one, that touch; corners do, too.

    Args:
        start: first pixel of each, counted through all rows.
        end: one behind the last.
        row: pixels of one, with at least one of none at its end.
    """
    first = np.searchsorted(end, start + row)
    count = np.searchsorted(start, end + row, "right") - first
    return np.arange(len(start)).repeat(count), _counted(first, count)


def _counted(
    first: Int[np.ndarray, " runs"], count: Int[np.ndarray, " runs"]
) -> Int[np.ndarray, " all"]:
    """Whole numbers from each first one on, one run after the other."""
    ends = count.cumsum()
    return np.arange(ends[-1] if len(ends) else 0) + (first - ends + count).repeat(count)


@dataclass(frozen=True, eq=False)
class FoundLamps:
    """Where an estimate's excess went; lamps, areas and rest together hold the estimate's power.

    Attributes:
        lamps: compact lights, the strongest first.
        areas: radiance of clipped areas beyond the map, that are no lamps.
        rest: the estimate without these.
    """

    lamps: tuple[Lamp, ...]
    areas: Float32[np.ndarray, "height width 3"]
    rest: Lighting


def find_lamps(lighting: Lighting, photo: ProjectedPhoto, own: Sequence[Lamp] = ()) -> FoundLamps:
    """Place what stands out of an estimate: on what the photo shows clipped near it, and elsewhere.

    Elsewhere it is a lamp outside the photo, if it holds a fair share of the power.

    Args:
        lighting: the estimate.
        photo: projected.
        own: the network's lamps, which the estimate holds; those wider than `LARGEST_OWN_RAD` stay
            in the map. A network without lamps has one taken out of its estimate.
    """
    parts = _parts(lighting, own)
    rest = parts[-1].rest if parts else lighting
    least = LEAST_SHARE * float(lighting.power() @ LUMINANCE)
    clipped = np.zeros_like(photo.seen)
    clipped[photo.box] = brightest(photo.clipped[photo.box]) * (photo.seen[photo.box] > 0.5)
    shown = clipped_areas(clipped)
    lamps: list[Lamp] = []
    fluxes = np.zeros((len(shown), 3))
    for part in parts:
        nearest = _nearest_area(part, shown)
        for number in range(len(shown)):
            fluxes[number] += part.flux[nearest == number].sum(0)
        free = np.where(nearest[:, None] < 0, part.flux, 0).astype(np.float32)
        if float(free.sum(0) @ LUMINANCE) > least:
            lamps.append(Lamp(_unseen_direction(part, free, photo), free.sum(0), part.radius_rad))
        else:
            rest = _put_back(rest, part.pixels, free)
    lamps = _together(lamps, photo.seen_in_64_rows)
    areas = np.zeros_like(photo.radiance)
    for number in np.argsort(-(fluxes @ LUMINANCE)):
        area, flux = shown[number], fluxes[number].astype(np.float32)
        strong = float(flux @ LUMINANCE) > least and len(lamps) < MOST_LAMPS
        lamp = area.lamp(flux) if strong else None
        if lamp is not None:
            lamps.append(lamp)
        else:
            areas[photo.box] += _raised(area, flux, photo)
    lamps.sort(key=lambda lamp: -lamp.luminous_flux)
    return FoundLamps(tuple(lamps), areas, rest)


def _together(lamps: list[Lamp], seen: Float32[np.ndarray, "64 128"]) -> list[Lamp]:
    """Lamps near each other as one in their middle, the nearest two first; none in the photo."""
    pairs = sorted(
        combinations(lamps, 2), key=lambda pair: -(pair[0].direction @ pair[1].direction)
    )
    for one, other in pairs:
        if one.direction @ other.direction < np.cos(TOGETHER_RAD):
            break
        both = in_their_middle((one, other))
        if latlong.nearest(seen, both.direction[None])[0] < _UNSEEN:
            others = [lamp for lamp in lamps if lamp is not one and lamp is not other]
            return _together([*others, both], seen)
    return lamps


def _raised(
    area: ClippedArea, flux: Float32[np.ndarray, "3"], photo: ProjectedPhoto
) -> Float32[np.ndarray, "rows columns 3"]:
    """A flux spread over a clipped area, fading into what is bright around it: no hard outline.

    Within the photo's box.
    """
    height, width = area.mask.shape
    near: np.ndarray = area.mask[photo.box].astype(np.float32)
    for shift in (1, 2, 4):
        step = max(1, round(shift * height / 256))
        for axis in (0, 1):
            near = _spread_along(near, step, axis)
    low, high = _BRIGHT
    bright = smoothstep((brightest(photo.radiance[photo.box]) - low) / (high - low))
    weight = near * bright * photo.seen[photo.box]
    total = float((weight * latlong.solid_angles(height, width)[photo.box]).sum())
    if total <= 0:
        weight, total = area.mask[photo.box].astype(np.float32), area.solid_angle
    result: np.ndarray = weight[..., None] * (flux / np.float32(total))
    return result


def _spread_along(
    values: Float32[np.ndarray, "rows columns"], step: int, axis: int
) -> Float32[np.ndarray, "rows columns"]:
    """Weights 1 2 1 at a distance of `step`; beyond the end there is nothing."""
    result = values * np.float32(0.5)
    along, own = result.swapaxes(0, axis), values.swapaxes(0, axis)
    along[step:] += own[:-step] * np.float32(0.25)
    along[:-step] += own[step:] * np.float32(0.25)
    return result


def _parts(lighting: Lighting, own: Sequence[Lamp]) -> list[Excess]:
    """What stands out, one after the other; the last one's rest is without them all."""
    if not own:
        return [excess_of(lighting)]
    parts: list[Excess] = []
    for lamp in own:
        if lamp.angular_radius_rad <= LARGEST_OWN_RAD and len(parts) < MOST_LAMPS:
            parts.append(lobe_of(parts[-1].rest if parts else lighting, lamp))
    return _recoloured(parts, lighting)


def _recoloured(parts: list[Excess], lighting: Lighting) -> list[Excess]:
    """Lamps of one colour, near the whole estimate's: near each other a network tints one green
    and the next violet. What a channel loses the rest gains, by one factor, so power is kept.
    """
    flux = np.sum([part.flux.sum(0) for part in parts], axis=0)
    luminous, power = float(flux @ LUMINANCE), lighting.power()
    left = power - flux
    if luminous <= 0 or (left < _LEAST_LEFT * power).any():
        return parts
    whole = power / float(power @ LUMINANCE)
    colour = OWN_COLOUR * flux / luminous + (1 - OWN_COLOUR) * whole
    factor = ((power - luminous * colour) / left).astype(np.float32)
    rest = Lighting(parts[-1].rest.radiance * factor)
    fluxes = [(part.flux @ LUMINANCE)[:, None] * colour for part in parts]
    return [
        replace(part, rest=rest, flux=own.astype(np.float32))
        for part, own in zip(parts, fluxes, strict=True)
    ]


def _nearest_area(excess: Excess, areas: Sequence[ClippedArea]) -> Int[np.ndarray, " pixels"]:
    """Which area each pixel of the excess is nearest to; -1 where none is near."""
    nearest = np.full(len(excess.directions), -1)
    best = np.full(len(excess.directions), np.cos(CATCH_RAD), np.float32)
    for number, area in enumerate(areas):
        closeness = (excess.directions @ area.outline.T).max(1)
        nearer = closeness > best
        nearest[nearer], best[nearer] = number, closeness[nearer]
    return nearest


def _unseen_direction(
    excess: Excess, flux: Float32[np.ndarray, "pixels 3"], photo: ProjectedPhoto
) -> Float[np.ndarray, "3"]:
    """Mean direction of the excess where the photo does not look, or the nearest one there.

    What the photo shows and does not show clipped is no lamp.
    """
    seen = photo.seen_in_64_rows
    directions = latlong.directions(64, 128)
    outside = 1 - latlong.nearest(seen, excess.directions)
    luminous = flux @ LUMINANCE
    weight = luminous * outside if (luminous * outside).any() else luminous
    direction = normalised((weight @ excess.directions).astype(np.float64))
    if latlong.nearest(seen, direction[None])[0] < _UNSEEN or not (seen < _UNSEEN).any():
        return direction
    cosine = np.where(seen < _UNSEEN, directions @ direction.astype(np.float32), -2)
    return normalised(directions[np.unravel_index(cosine.argmax(), seen.shape)].astype(np.float64))
