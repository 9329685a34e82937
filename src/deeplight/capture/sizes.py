"""The spheres' sizes, helped by each other: a mirror's rim shows the world right behind it.

A mirror ball's rim is nearly as bright as what lies behind, and its reflections bunch up into
rings just inside. The two other balls have clear outlines and the same size, so where the mirror's
outline is doubtful they say how large it is seen.
"""

from itertools import permutations

import numpy as np
from jaxtyping import UInt8

from deeplight.camera import PinholeCamera
from deeplight.capture.candidates import on_bar, separation_rad
from deeplight.capture.conic import Cone
from deeplight.capture.refine import SURE, SphereOutline, refine_by_sides, refine_place

_STIFFNESS = 0.01  # see `refine_by_sides`
_HIGHLIGHT_STIFFNESS = 0.08
_UNLIKE = 1.05  # ratio of two rough spheres' sizes from which on one may be a highlight
_RING = 0.02  # of the radius: outlines farther apart are not one
_RIM = 0.8  # how clear a rim must be next to the ring inside of it
_NEAR = 0.3  # of its radius, within which the mirror may be where an even bar has it
_UNEVEN = 0.01  # a difference of sizes that is not a matter of measuring


def alike_sizes(
    named: dict[str, SphereOutline],
    frames: list[UInt8[np.ndarray, "height width"]],
    camera: PinholeCamera,
) -> dict[str, SphereOutline]:
    """The outlines, the smaller rough sphere's looked for again at the other's size if they differ.

    The edge of a highlight in a dim silver sphere is a circle, too, clearer at first than its rim.
    What is found so is taken where more of its outline is seen.
    """
    radius = {name: named[name].cone.angular_radius_rad for name in ("matte_silver", "diffuse")}
    small, large = sorted(radius, key=radius.__getitem__)
    if radius[large] < _UNLIKE * radius[small]:
        return named
    start = Cone(named[small].cone.direction, radius[large])
    coarse = refine_by_sides(start, frames, camera, _HIGHLIGHT_STIFFNESS)
    again = refine_place(coarse.cone, frames, camera, _HIGHLIGHT_STIFFNESS)
    return named | {small: again} if again.support > named[small].support else named


def even_sizes(
    named: dict[str, SphereOutline],
    start: Cone,
    frames: list[UInt8[np.ndarray, "height width"]],
    camera: PinholeCamera,
) -> tuple[SphereOutline, tuple[str, ...]]:
    """The mirror's outline, of about the size that the two others expect.

    Looked for by what is inside and outside of it, from where it was found and from `start`, where
    it was thought to be at first. Its own edge is taken instead where it is clear and agrees.
    """
    own = named["mirror"]
    expected = expected_radius(named)
    places = [own.cone, start]
    if own.support < SURE:
        bar = on_bar(named["matte_silver"].cone, named["diffuse"].cone)
        places += [at for at in bar if separation_rad(at, start) < _NEAR * expected]
    found = mirror_of_size(places, expected, frames, camera)
    gap = np.log(found.cone.angular_radius_rad / expected)
    warning = ("the mirror seems to be of another size than the others",) if abs(gap) > 0.04 else ()
    return found, warning


def mirror_of_size(
    places: list[Cone],
    expected_rad: float,
    frames: list[UInt8[np.ndarray, "height width"]],
    camera: PinholeCamera,
) -> SphereOutline:
    """The mirror's outline of about that angular radius, near the best of some places."""
    options = [_by_sides(Cone(at.direction, expected_rad), frames, camera) for at in places]
    found = max(options, key=lambda outline: outline.support)
    fine = refine_place(found.cone, frames, camera)
    return fine if fine.support > SURE else found


def _by_sides(
    start: Cone, frames: list[UInt8[np.ndarray, "height width"]], camera: PinholeCamera
) -> SphereOutline:
    """The mirror by its two sides; where a ring inside of it was taken for its rim, by the way that
    knows of rings. Where there is none the two agree within 1 % of the radius."""
    found = refine_by_sides(start, frames, camera, _STIFFNESS)
    ringed = refine_by_sides(start, frames, camera, _STIFFNESS, ringed=True)
    apart = separation_rad(found.cone, ringed.cone)
    grown = abs(found.cone.angular_radius_rad - ringed.cone.angular_radius_rad)
    differ = max(apart, grown) > _RING * start.angular_radius_rad
    # A ring is part of an outline, too: the rim need not be as clear to be believed.
    return ringed if differ and ringed.support > _RIM * found.support else found


def expected_radius(named: dict[str, SphereOutline]) -> float:
    """The angular radius that the two others expect of the mirror.

    As far away as they are; or, where they or the mirror show that distances differ, as far as it
    is when all three stand evenly on a straight line.
    """
    mirror, silver, diffuse = (named[n].cone for n in ("mirror", "matte_silver", "diffuse"))
    radii = silver.angular_radius_rad, diffuse.angular_radius_rad
    same = float(np.sqrt(radii[0] * radii[1]))
    differ = abs(float(np.log(radii[0] / radii[1])))
    found = _in_a_row(mirror, silver, diffuse)
    if found is not None:
        row, between = found
        # Its rings make a mirror look too small, never too large.
        larger = np.log(mirror.angular_radius_rad / same) > 0.5 * np.log(row / same) > 0.5 * _UNEVEN
        if differ > _UNEVEN or (between and larger):
            return row
    return same


def _in_a_row(mirror: Cone, silver: Cone, diffuse: Cone) -> tuple[float, bool] | None:
    """The mirror's angular radius if the centres stand evenly on a line, and whether it is between
    the others; None if they do not."""
    cones = {"mirror": mirror, "matte_silver": silver, "diffuse": diffuse}
    # Centres in units of the radius, which is one for all three.
    at = {n: c.direction / np.sin(c.angular_radius_rad) for n, c in cones.items()}
    for left, middle, right in permutations(cones):
        if left > right:
            continue
        if middle == "mirror":
            expected = (at[left] + at[right]) / 2
        else:
            other = left if right == "mirror" else right
            expected = 2 * at[middle] - at[other]
        along = expected / np.linalg.norm(expected)
        if np.arccos(np.clip(along @ mirror.direction, -1, 1)) < 0.15 * mirror.angular_radius_rad:
            return float(np.arcsin(1 / np.linalg.norm(expected))), middle == "mirror"
    return None
