"""Surfaces for the virtual light stage: what a sphere reflects of one distant light.

Each gives reflected radiance per unit of irradiance across the light's direction, the cosine
included, from the cosines between normal n, light l and view v.
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from deeplight import brdf
from deeplight.mappings import mirror_ball

Cosines = Float[np.ndarray, "*#cosines"]
Surface = Callable[[Cosines, Cosines, Cosines], Cosines]


def diffuse(n_l: Cosines, n_v: Cosines, l_v: Cosines) -> Cosines:
    """The paper's diffuse grey."""
    return brdf.lambertian(n_l) * brdf.REFLECTIVITY["diffuse"] + 0 * (n_v + l_v)


def matte_silver(n_l: Cosines, n_v: Cosines, l_v: Cosines) -> Cosines:
    """GGX that gives back the paper's reflectivity at every view, as `analytic_basis` has it."""
    cosine, albedo = _silver_albedo()
    scale = brdf.REFLECTIVITY["matte_silver"] / np.interp(n_v, cosine, albedo)
    return brdf.rough_specular(n_l, n_v, l_v) * scale


def plastic(n_l: Cosines, n_v: Cosines, l_v: Cosines) -> Cosines:
    """A coloured-in-grey body under a gloss: neither of the paper's materials."""
    return 0.3 * brdf.lambertian(n_l) + 0.15 * brdf.rough_specular(n_l, n_v, l_v, 0.2)


def phong(n_l: Cosines, n_v: Cosines, l_v: Cosines) -> Cosines:
    """Phong's lobe of exponent 20 about the mirror direction, times the cosine."""
    r_l = 2 * n_v * n_l - l_v
    return 0.5 * 22 / (2 * np.pi) * np.maximum(r_l, 0) ** 20 * np.maximum(n_l, 0)


SURFACES: dict[str, Surface] = {
    "diffuse": diffuse,
    "matte_silver": matte_silver,
    "phong": phong,
    "plastic": plastic,
}
"""All but the mirror, which `stage_photograph` draws from the lights' images."""


@lru_cache(maxsize=1)
def _silver_albedo() -> tuple[np.ndarray, np.ndarray]:
    """What GGX gives back of white light, against the cosine of the view."""
    cosine = np.linspace(0, 1, 65)
    lights, solid_angle = mirror_ball.pixel_directions(256), mirror_ball.solid_angles(256)
    albedo = [
        (brdf.rough_specular(lights[..., 2], np.array(c), lights @ [np.sqrt(1 - c * c), 0, c])
         * solid_angle).sum()
        for c in cosine
    ]  # fmt: skip
    return cosine, np.array(albedo)
