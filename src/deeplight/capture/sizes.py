"""The mirror's size, helped by the two others: its rim shows the world right behind it.

A mirror ball's rim is nearly as bright as what lies behind, and its reflections bunch up into
rings just inside. The two other balls have clear outlines and the same size, so where the mirror's
outline is doubtful they say how large it is seen.
"""

from dataclasses import replace
from itertools import permutations

import numpy as np
from jaxtyping import UInt8

from deeplight.camera import PinholeCamera
from deeplight.capture.conic import Cone
from deeplight.capture.refine import SURE, Outline, refine_place

_USUAL_LOSS = 0.006  # how much too small the mirror is found as a rule: rings, not the rim
_OWN_SPREAD = 0.015  # of the logarithm of the size of the mirror as found by itself
_LEAST_SPREAD = 0.003  # of the sizes of spheres that are meant to be equally far away
_INWARD, _OUTWARD = 0.07, 0.025  # how far off the mirror's own outline may be
_UNEVEN = 0.01  # a difference of sizes that is not a matter of measuring


def even_sizes(
    named: dict[str, Outline],
    start: Cone,
    frames: list[UInt8[np.ndarray, "height width"]],
    camera: PinholeCamera,
) -> tuple[Outline, tuple[str, ...]]:
    """The mirror's outline with a size between its own and the one that the others expect.

    The less the two others differ, the more they count. A mirror of quite another size than
    expected, or with little of an outline, is looked for again at `start`, where it was thought to
    be at first; one that cannot be what the others say loses its support.
    """
    own = named["mirror"]
    expected, spread = expected_radius(named)
    gap = float(np.log(expected / own.cone.angular_radius_rad))
    if not -_OUTWARD < gap - _USUAL_LOSS < _INWARD:
        again = refine_place(Cone(start.direction, expected), frames, camera)
        better = again if again.support > own.support else own
        if spread < _UNEVEN and better.support < SURE:
            better = replace(better, support=0.0)  # the others are sure of another size
        return better, ("the mirror seems to be of another size than the others",)
    doubt = _OWN_SPREAD if own.support < SURE else _LEAST_SPREAD
    share = doubt**2 / (doubt**2 + spread**2)
    radius = float(own.cone.angular_radius_rad * np.exp(share * gap))
    places = [own.cone] if own.support > SURE else [own.cone, start]
    options = [refine_place(Cone(at.direction, radius), frames, camera) for at in places]
    return max(options, key=lambda outline: outline.support), ()


def expected_radius(named: dict[str, Outline]) -> tuple[float, float]:
    """The angular radius that the two others expect of the mirror, and the spread of its logarithm.

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
            return row, float(np.hypot(_LEAST_SPREAD, 0.5 * differ))
    return same, float(np.hypot(_LEAST_SPREAD, differ))


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
