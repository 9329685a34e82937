"""Spherical harmonics of lighting, the irradiance they give, and the dominant light.

Order 00, 1-1, 10, 11, 2-2, 2-1, 20, 21, 22 = 1, y, z, x, xy, yz, 3z^2-1, xz, x^2-y^2 in the
camera frame, all constants positive (three.js, Ramamoorthi and Hanrahan 2001). ARCore's sign
negates coefficients 1, 3, 5 and 7. Coefficients are of radiance.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from deeplight import mirror_ball
from deeplight.camera_response import LUMINANCE
from deeplight.lighting import Lighting

CONDON_SHORTLEY = np.array([1, -1, 1, -1, 1, -1, 1, -1, 1], np.float32)
_LAMBERT = np.pi * np.array([1.0] + [2 / 3] * 3 + [1 / 4] * 5)  # the cosine kernel per order

Coefficients = Float[np.ndarray, "9 3"]


def basis(directions: Float[np.ndarray, "*batch 3"]) -> Float[np.ndarray, "*batch 9"]:
    """The nine real harmonics up to order 2 in unit directions."""
    x, y, z = directions[..., 0], directions[..., 1], directions[..., 2]
    return np.stack(
        [
            np.full_like(x, 0.28209479),
            0.48860251 * y,
            0.48860251 * z,
            0.48860251 * x,
            1.09254843 * x * y,
            1.09254843 * y * z,
            0.31539157 * (3 * z * z - 1),
            1.09254843 * x * z,
            0.54627422 * (x * x - y * y),
        ],
        axis=-1,
    )


def project(lighting: Lighting) -> Coefficients:
    """Radiance coefficients of lighting: its integral against each harmonic."""
    directions, inside = mirror_ball.subpixels(lighting.size)
    values = (basis(directions) * inside[..., None]).sum(1) / inside.sum(1, keepdims=True).clip(1)
    weighted = values * mirror_ball.solid_angles(lighting.size).reshape(-1, 1)
    return (weighted.T @ lighting.radiance.reshape(-1, 3)).astype(np.float32)


def irradiance(
    coefficients: Coefficients, normals: Float[np.ndarray, "*batch 3"]
) -> Float[np.ndarray, "*batch 3"]:
    """Irradiance on surfaces facing `normals`; white light of 1 gives pi.

    For any lighting off by at most 3/32 of its power, which a lone strong light reaches where it
    grazes a surface; by some 1 % where light is spread out (Ramamoorthi and Hanrahan 2001).
    It can fall below 0 opposite a lone strong light.
    """
    return basis(normals) @ (_LAMBERT[:, None] * coefficients)


@dataclass(frozen=True, eq=False)
class DominantLight:
    """The one light that stands out, as a directional light would replace it.

    Attributes:
        direction: unit vector towards the light, camera frame.
        irradiance: RGB on a surface that faces it, in units of radiance relative to camera
            white times sr; zero in perfectly even light. Read-only like `direction`.
        share: part of the scene's power that it holds, 0 to 1, by luminance.
        remainder: the lighting without it; the two together are the whole.
    """

    direction: Float[np.ndarray, "3"]
    irradiance: Float[np.ndarray, "3"]
    share: float
    remainder: Lighting

    def __post_init__(self) -> None:
        for name in ("direction", "irradiance"):
            own = getattr(self, name).copy()  # the caller's stays writable
            own.setflags(write=False)
            object.__setattr__(self, name, own)


def dominant_light(lighting: Lighting, cone_rad: float = 0.35) -> DominantLight:
    """Find the brightest spot of `cone_rad` radius and what it adds over its surroundings.

    The spot is where the light, blurred to the cone, peaks; it counts as light above the
    scene's mean outside the cone. Its direction is the power-weighted mean.
    """
    directions = mirror_ball.pixel_directions(lighting.size).reshape(-1, 3)
    solid_angle = mirror_ball.solid_angles(lighting.size).reshape(-1, 1)
    radiance = lighting.radiance.reshape(-1, 3)
    luminance = radiance @ LUMINANCE
    near = directions @ directions.T > np.cos(cone_rad)
    peak = int((near @ (luminance * solid_angle[:, 0])).argmax())
    cone = near[peak]
    outside = solid_angle * ~cone[:, None]
    ambient = (radiance * outside).sum(0) / outside.sum()
    excess = np.where(cone[:, None], np.maximum(radiance - ambient, 0), 0)
    power = (excess @ LUMINANCE) * solid_angle[:, 0]
    total = power.sum()
    toward = power @ directions if total > 0 else directions[peak]
    toward = toward / np.linalg.norm(toward)
    facing = np.maximum(directions @ toward, 0)[:, None] * solid_angle
    return DominantLight(
        toward.astype(np.float32),
        (excess * facing).sum(0).astype(np.float32),
        float(total / max((luminance * solid_angle[:, 0]).sum(), 1e-30)),
        Lighting((radiance - excess).reshape(lighting.radiance.shape)),
    )
