"""Spherical harmonics of lighting, the irradiance they give, and the dominant light.

Order 00, 1-1, 10, 11, 2-2, 2-1, 20, 21, 22 = 1, y, z, x, xy, yz, 3z^2-1, xz, x^2-y^2 in the
camera frame, all constants positive (three.js, Ramamoorthi and Hanrahan 2001). ARCore's sign
negates coefficients 1, 3, 5 and 7. Coefficients are of radiance.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from deeplight import latlong, mirror_ball
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
    return basis(normals) @ irradiance_coefficients(coefficients)


def irradiance_coefficients(coefficients: Coefficients) -> Coefficients:
    """Coefficients of irradiance, as glTF stores them, from those of radiance."""
    return (_LAMBERT[:, None] * coefficients).astype(np.float32)


@dataclass(frozen=True, eq=False)
class DominantLight:
    """The one light that stands out, as a directional light would replace it.

    Attributes:
        direction: unit vector towards the light, camera frame.
        irradiance: RGB on a surface that faces it, in units of radiance relative to camera
            white times sr; zero in perfectly even light. Read-only like `direction`.
        share: part of the scene's power that it holds, 0 to 1, by luminance.
        remainder: the lighting without it; the two together are the whole.
        angular_radius_rad: of the even disc that holds the same power as brightly; never
            less than the lighting's own pixels show.
    """

    direction: Float[np.ndarray, "3"]
    irradiance: Float[np.ndarray, "3"]
    share: float
    remainder: Lighting
    angular_radius_rad: float = 0.0

    def __post_init__(self) -> None:
        for name in ("direction", "irradiance"):
            own = getattr(self, name).copy()  # the caller's stays writable
            own.setflags(write=False)
            object.__setattr__(self, name, own)

    @property
    def colour(self) -> Float[np.ndarray, "3"]:
        """Its irradiance with the largest channel at 1; white where there is no light."""
        largest = self.irradiance.max()
        return self.irradiance / largest if largest > 0 else np.ones(3, np.float32)


def dominant_light(lighting: Lighting, cone_rad: float = 0.35) -> DominantLight:
    """Find the brightest spot of `cone_rad` radius and what it adds over its surroundings.

    The spot is where the light, blurred to the cone, peaks; it counts as light above the
    scene's mean outside the cone. Its direction is the power-weighted mean.
    """
    directions = mirror_ball.pixel_directions(lighting.size).reshape(-1, 3)
    solid_angle = mirror_ball.solid_angles(lighting.size).reshape(-1, 1)
    radiance = lighting.radiance.reshape(-1, 3)
    cone = _brightest_cone(lighting, cone_rad)
    excess = _excess(radiance, solid_angle, cone)
    remainder = Lighting((radiance - excess).reshape(lighting.radiance.shape))
    whole = ((radiance @ LUMINANCE) * solid_angle[:, 0]).sum()
    return _as_light(excess, directions, solid_angle, whole, remainder)


def dominant_light_of_latlong(
    radiance: Float[np.ndarray, "height width 3"], cone_rad: float = 0.35
) -> tuple[DominantLight, Float[np.ndarray, "height width 3"]]:
    """The dominant light of a panorama at the panorama's own resolution, and its own radiance.

    Where it is, a 32 x 32 ball tells; what it adds is taken from the panorama itself, so that a
    sun's size and direction are as fine as its pixels. The panorama less the second result is what
    `remainder` holds on a ball.
    """
    height, width, _ = radiance.shape
    lighting = Lighting.from_latlong(radiance)
    ball = mirror_ball.pixel_directions(lighting.size).reshape(-1, 3)
    centre = ball[_brightest_cone(lighting, cone_rad)].mean(axis=0)
    directions = latlong.directions(height, width).reshape(-1, 3)
    toward = (centre / np.linalg.norm(centre)).astype(np.float32)
    cone = directions @ toward > np.cos(cone_rad)
    flat = radiance.reshape(-1, 3)
    solid_angle = latlong.solid_angles(height, width).reshape(-1, 1)
    excess = _excess(flat, solid_angle, cone).astype(np.float32)
    left = (flat - excess).reshape(radiance.shape)
    whole = ((flat @ LUMINANCE) * solid_angle[:, 0]).sum()
    light = _as_light(excess, directions, solid_angle, whole, Lighting.from_latlong(left))
    return light, excess.reshape(radiance.shape)


def _brightest_cone(lighting: Lighting, cone_rad: float) -> np.ndarray:
    """Which pixels of the ball lie in the cone that catches the most luminous power."""
    near = _cones(lighting.size, cone_rad)
    luminance = lighting.radiance.reshape(-1, 3) @ LUMINANCE
    peak = int((near @ (luminance * mirror_ball.solid_angles(lighting.size).ravel())).argmax())
    return near[peak] > 0


def _excess(radiance: np.ndarray, solid_angle: np.ndarray, cone: np.ndarray) -> np.ndarray:
    """What pixels in the cone add over the mean radiance outside it."""
    outside = solid_angle * ~cone[:, None]
    ambient = (radiance * outside).sum(0) / outside.sum()
    return np.where(cone[:, None], np.maximum(radiance - ambient, 0), 0)


def _as_light(
    excess: np.ndarray,
    directions: np.ndarray,
    solid_angle: np.ndarray,
    whole: float,
    remainder: Lighting,
) -> DominantLight:
    power = (excess @ LUMINANCE) * solid_angle[:, 0]
    total = power.sum()
    toward = power @ directions if total > 0 else directions[0].astype(float)
    toward = toward / np.linalg.norm(toward)
    facing = np.maximum(directions @ toward, 0)[:, None] * solid_angle
    # An even disc's power squared over its radiance squared, summed, is its solid angle.
    squared = ((excess @ LUMINANCE) * power).sum()
    disc = total**2 / squared if total > 0 else 0.0
    return DominantLight(
        toward.astype(np.float32),
        (excess * facing).sum(0).astype(np.float32),
        float(total / max(whole, 1e-30)),
        remainder,
        float(np.arccos(np.clip(1 - disc / (2 * np.pi), -1, 1))),
    )


@lru_cache(maxsize=4)
def _cones(size: int, cone_rad: float) -> Float[np.ndarray, "pixels pixels"]:
    """1 where two pixels of the ball lie within `cone_rad` of each other, else 0."""
    directions = mirror_ball.pixel_directions(size).reshape(-1, 3)
    return (directions @ directions.T > np.cos(cone_rad)).astype(float)
