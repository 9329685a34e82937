"""How a surface turns light into what it sends out: the two finishes that transfer is made for.

A finish is a linear map from light over a surface to what leaves it. For the diffuse one that is
a single number, the radiance sent everywhere. For the glossy one it is radiance by direction, and
held as spherical harmonics of the direction in which a mirror would see: the mirror direction of
the eye about the normal. Both are per unit of reflectivity: white light of 1 gives 1.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Float32

from deeplight import brdf, harmonics
from deeplight.transfer.rays import hemisphere

_VIEWS = 300
_FINE = 5_000  # directions to integrate over once
_RIDGE = 1e-5  # keeps harmonics that only the unseen half would need from growing


@dataclass(frozen=True, eq=False)
class FinishCoefficients:
    """One finish at one number of samples.

    Attributes:
        weights: of light from each of `hemisphere(samples)`: what leaves = weights @ light.
        bare: what leaves in light of each harmonic where nothing blocks it, normal +Z.
    """

    weights: Float32[np.ndarray, "leaving samples"]
    bare: Float[np.ndarray, "leaving coefficients"]


@lru_cache(maxsize=4)
def diffuse(samples: int, order: int) -> FinishCoefficients:
    """A perfect diffuser."""
    over = hemisphere(samples)
    weights = over.directions[:, 2] * over.solid_angles / np.pi
    up = harmonics.basis(np.array([[0.0, 0.0, 1.0]]), order)
    return FinishCoefficients(weights[None], up * harmonics.cosine_kernel(order) / np.pi)


@lru_cache(maxsize=4)
def glossy(samples: int, order: int, roughness: float) -> FinishCoefficients:
    """Rough metal, GGX, each view scaled to give back all of white light.

    So `reflectance.rig_bases` scales it, too: what microfacets would scatter again is not lost.
    """
    over, fine = hemisphere(samples), hemisphere(_FINE)
    light = harmonics.basis(fine.directions.astype(float), order)
    fitted = _fitted(order)
    bare = fitted @ (_lobes(fine.directions, roughness) * fine.solid_angles) @ light
    weights = fitted @ (_lobes(over.directions, roughness) * over.solid_angles)
    return FinishCoefficients(weights.astype(np.float32), bare)


def _views() -> Float32[np.ndarray, "views 3"]:
    return hemisphere(_VIEWS).directions


@lru_cache(maxsize=4)
def _scale(roughness: float) -> Float[np.ndarray, "views 1"]:
    """What brings each view's white light to 1."""
    fine = hemisphere(_FINE)
    rows = _unscaled(fine.directions, roughness) @ fine.solid_angles.astype(float)
    return 1 / rows[:, None]


def _lobes(toward: np.ndarray, roughness: float) -> Float[np.ndarray, "views directions"]:
    """Radiance in each view per unit of radiance and solid angle from each direction."""
    return _unscaled(toward, roughness) * _scale(roughness)


def _unscaled(toward: np.ndarray, roughness: float) -> Float[np.ndarray, "views directions"]:
    views, toward = _views().astype(float), toward.astype(float)
    n_l, n_v = toward[None, :, 2], views[:, 2:]
    return brdf.rough_specular(n_l, n_v, views @ toward.T, roughness)


@lru_cache(maxsize=4)
def _fitted(order: int) -> Float[np.ndarray, "coefficients views"]:
    """Harmonics of the mirror direction fitted to values in the views, which count by their area.

    The rim counts a little more. Mirror directions below the surface are never seen; the ridge
    keeps them tame.
    """
    over = hemisphere(_VIEWS)
    mirrored = over.directions.astype(float) * [-1, -1, 1]
    basis = harmonics.basis(mirrored, order)
    weight = (over.directions[:, 2:] + 0.1) * over.solid_angles[:, None]
    gram = basis.T @ (weight * basis)
    ridge = _RIDGE * np.eye(len(gram))
    result: np.ndarray = np.linalg.solve(gram + ridge, (weight * basis).T)
    return result
