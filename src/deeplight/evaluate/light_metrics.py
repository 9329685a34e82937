"""How far estimated light is from the true light: what only a simulation or a light probe knows.

Brightness errors are in stops, log2(estimated / true): +1 is twice as bright as it should be. What
cannot be computed is NaN and stays NaN: whoever averages leaves it out and counts it.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Float64

from deeplight.camera_response import LUMINANCE
from deeplight.harmonics import dominant_light
from deeplight.lighting import Lighting
from deeplight.mappings import mirror_ball

LEAST_SHARE = 0.01
"""Light that holds less of the scene's power stands out of nothing: it has no direction."""

Radiances = Float[np.ndarray, "examples light light 3"]
Images = Float[np.ndarray, "examples size size 3"]


@dataclass(frozen=True, eq=False)
class Brightest:
    """The dominant light of each lighting (`harmonics.dominant_light`); NaN where none stands out.

    Attributes:
        directions: unit, camera frame.
        irradiance: luminance on a surface that faces it.
    """

    directions: Float64[np.ndarray, "examples 3"]
    irradiance: Float64[np.ndarray, " examples"]

    def degrees_from(self, other: "Brightest") -> Float64[np.ndarray, " examples"]:
        """Angle between the dominant lights of each pair."""
        cosine = np.clip((self.directions * other.directions).sum(1), -1, 1)
        return np.asarray(np.degrees(np.arccos(cosine)))


def brightest(radiance: Radiances) -> Brightest:
    """Find the dominant light of every lighting."""
    directions, irradiance = np.full((len(radiance), 3), np.nan), np.full(len(radiance), np.nan)
    for number, ball in enumerate(radiance):
        if number and np.array_equal(ball, radiance[number - 1]):  # a constant estimate
            directions[number], irradiance[number] = directions[number - 1], irradiance[number - 1]
        elif np.isfinite(ball).all():
            light = dominant_light(Lighting(ball))
            if light.share >= LEAST_SHARE:
                directions[number] = light.direction
                irradiance[number] = light.irradiance @ LUMINANCE
    return Brightest(directions, irradiance)


def mean_radiance(radiance: Radiances) -> Float64[np.ndarray, " examples"]:
    """Luminance averaged over all directions, relative to camera white."""
    share = mirror_ball.solid_angles(radiance.shape[1]) / (4 * np.pi)
    with np.errstate(invalid="ignore"):  # NaN stays NaN
        return np.einsum("nijc,ij,c->n", radiance, share, LUMINANCE)


def light_errors(
    estimated: Radiances, true: Radiances
) -> dict[str, Float64[np.ndarray, " examples"]]:
    """Errors of whole lightings, by name.

    `energy_stops` of the power from all directions together; `direction_deg` between the dominant
    lights; `intensity_stops` of the dominant lights' irradiance. Where either has no dominant light
    the last two are not defined.
    """
    own, wanted = brightest(estimated), brightest(true)
    return {
        "energy_stops": _stops(mean_radiance(estimated), mean_radiance(true)),
        "direction_deg": own.degrees_from(wanted),
        "intensity_stops": _stops(own.irradiance, wanted.irradiance),
    }


def linear_errors(
    rendered: Mapping[str, Images],
    true: Mapping[str, Images],
    masks: Mapping[str, Bool[np.ndarray, "size size"]],
) -> dict[str, Float64[np.ndarray, " examples"]]:
    """Error of each sphere before the camera clips it, by sphere: sum |rendered - true| / sum true.

    0 is perfect; a black sphere has 1. Of the mirror it is nearly all the sun's one pixel, so it
    is never to be read without the others.
    """
    found = {}
    for name, mask in masks.items():
        a, b = rendered[name][:, mask].astype(np.float64), true[name][:, mask].astype(np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            error = np.abs(a - b).sum((1, 2)) / b.sum((1, 2))
        found[name] = np.where(np.isfinite(error), error, np.nan)
    return found


def _stops(
    estimated: Float64[np.ndarray, " examples"], true: Float64[np.ndarray, " examples"]
) -> Float64[np.ndarray, " examples"]:
    with np.errstate(divide="ignore", invalid="ignore"):
        stops = np.log2(estimated / true)
    return np.where(np.isfinite(stops), stops, np.nan)
