"""How the three reference spheres reflect light (section 3.1).

Each function gives reflected radiance per unit of incoming radiance and solid angle, the
cosine included: the weight of one direction of light in a rendering. Directions are unit
vectors pointing away from the surface.
"""

import numpy as np
from jaxtyping import Float

# Share of white light each sphere reflects, as measured for the paper.
REFLECTIVITY = {"mirror": 0.827, "matte_silver": 0.644, "diffuse": 0.345}

# Roughness (GGX alpha) of the matte silver finish: our choice, the paper photographs it.
MATTE_SILVER_ROUGHNESS = 0.3

Cosines = Float[np.ndarray, "*#cosines"]


def lambertian(n_l: Cosines) -> Cosines:
    """A perfect diffuser with reflectivity 1: max(0, n.l) / pi."""
    return np.maximum(n_l, 0) / np.pi


def rough_specular(
    n_l: Cosines, n_v: Cosines, l_v: Cosines, roughness: float = MATTE_SILVER_ROUGHNESS
) -> Cosines:
    """GGX microfacets that absorb nothing: D G / (4 n.v), after Walter et al. 2007.

    Light that a real surface would scatter more than once is missing, so white light gives
    less than 1 at grazing views; `reflectance` scales it to the measured reflectivity.

    Args:
        n_l, n_v, l_v: cosines between normal, light and view, broadcast against each other.
        roughness: GGX alpha.
    """
    a2 = roughness**2
    n_h_squared = (n_l + n_v) ** 2 / np.maximum(2 + 2 * l_v, 1e-9)  # h = (l + v) / |l + v|
    density = a2 / (np.pi * (n_h_squared * (a2 - 1) + 1) ** 2)
    shadowed = _smith(n_l, a2) * _smith(n_v, a2)
    lit = (n_l > 0) & (n_v > -1e-6)  # the rim, seen edge on, reflects too
    return np.where(lit, density * shadowed / (4 * np.maximum(n_v, 1e-4)), 0.0)


def _smith(cosine: np.ndarray, a2: float) -> np.ndarray:
    """Share of microfacets that a direction sees (Smith's G1 for GGX)."""
    cosine = np.clip(cosine, 1e-4, 1.0)
    return np.asarray(2 / (1 + np.sqrt(1 + a2 * (1 / (cosine * cosine) - 1))))
