"""Spherical harmonics of lighting, the irradiance they give, and the dominant light.

Order 00, 1-1, 10, 11, 2-2, 2-1, 20, 21, 22 = 1, y, z, x, xy, yz, 3z^2-1, xz, x^2-y^2 in the
camera frame, all constants positive (three.js, Ramamoorthi and Hanrahan 2001). ARCore's sign
negates coefficients 1, 3, 5 and 7. Higher orders go on the same way, without the
Condon-Shortley sign. Coefficients are of radiance.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import factorial

import numpy as np
from jaxtyping import Float

from deeplight.camera_response import LUMINANCE
from deeplight.frames import Rotation, turned
from deeplight.lighting import HasLighting, Lighting
from deeplight.mappings import latlong, mirror_ball

CONDON_SHORTLEY = np.array([1, -1, 1, -1, 1, -1, 1, -1, 1], np.float32)
Coefficients = Float[np.ndarray, "9 3"]


def basis(
    directions: Float[np.ndarray, "*batch 3"], order: int = 2
) -> Float[np.ndarray, "*batch coefficients"]:
    """The (order + 1)^2 real harmonics up to `order` in unit directions.

    Harmonic l, m stands at l (l + 1) + m: the associated Legendre function without the
    Condon-Shortley sign, times cos(m phi) at m > 0 and sin(-m phi) at m < 0, phi from +X to +Y.
    """
    x, y, z = directions[..., 0], directions[..., 1], directions[..., 2]
    result = np.empty((*x.shape, (order + 1) ** 2), directions.dtype)
    cosine, sine = np.ones_like(x), np.zeros_like(x)  # of m phi, times sin(theta)^m
    for m in range(order + 1):
        below, here = np.zeros_like(x), np.full_like(x, _odd_factorial(m))  # Legendre / sin^m
        for degree in range(m, order + 1):
            scaled = here * x.dtype.type(_norm(degree, m))
            result[..., degree * (degree + 1) + m] = scaled * cosine
            if m:
                result[..., degree * (degree + 1) - m] = scaled * sine
            above = ((2 * degree + 1) * z * here - (degree + m) * below) / (degree + 1 - m)
            below, here = here, above
        cosine, sine = cosine * x - sine * y, cosine * y + sine * x
    return result


def turning(new_from_old: Rotation, order: int) -> Float[np.ndarray, "n n"]:
    """The matrix that takes coefficients of light to those of the same light in a turned frame."""
    directions, weights = quadrature(order)
    old = basis(directions, order)
    return basis(turned(directions, new_from_old), order).T @ (weights[:, None] * old)


def spherical_harmonics(light: HasLighting, order: int = 2) -> Float[np.ndarray, "coefficients 3"]:
    """Radiance coefficients of a `Lighting` or an `Environment`: its integral with each harmonic.

    Orthonormal real harmonics, order 00, 1-1, 10, 11, 2-2 ..., all positive (three.js, Ramamoorthi
    and Hanrahan 2001).

    Examples:
        >>> white = deeplight.Lighting(np.ones((32, 32, 3), np.float32))
        >>> round(float(deeplight.spherical_harmonics(white)[0, 0]), 3)  # 2 sqrt(pi)
        3.545
    """
    lighting = light.lighting
    directions, inside = mirror_ball.subpixels(lighting.size)
    values = (basis(directions, order) * inside[..., None]).sum(1)
    values /= inside.sum(1, keepdims=True).clip(1)
    weighted = values * mirror_ball.solid_angles(lighting.size).reshape(-1, 1)
    return (weighted.T @ lighting.radiance.reshape(-1, 3)).astype(np.float32)


def _odd_factorial(m: int) -> float:
    """1 x 3 x 5 ... (2 m - 1)."""
    return float(np.prod(np.arange(1, 2 * m, 2, dtype=float)))


def _norm(degree: int, m: int) -> float:
    ratio = factorial(degree - m) / factorial(degree + m)
    return float(np.sqrt((2 * degree + 1) / (4 * np.pi) * ratio * (2 if m else 1)))


@lru_cache(maxsize=8)
def quadrature(
    order: int,
) -> tuple[Float[np.ndarray, "directions 3"], Float[np.ndarray, "directions"]]:
    """Directions and weights that integrate products of two harmonics up to `order` exactly."""
    heights, weights = np.polynomial.legendre.leggauss(order + 1)
    angles = np.arange(2 * order + 1) * (2 * np.pi / (2 * order + 1))
    z, angle = (grid.ravel() for grid in np.meshgrid(heights, angles, indexing="ij"))
    ring = np.sqrt(1 - z * z)
    directions = np.stack([ring * np.cos(angle), ring * np.sin(angle), z], -1)
    return directions, np.repeat(weights, len(angles)) * (2 * np.pi / len(angles))


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
    kernel = cosine_kernel(2)
    return (kernel[:, None] * coefficients).astype(np.float32)


@lru_cache(maxsize=8)
def cosine_kernel(order: int) -> Float[np.ndarray, "coefficients"]:
    """What a clamped cosine multiplies each coefficient by: pi, 2 pi / 3, pi / 4, 0, - pi / 24."""
    kernel = [np.pi, 2 * np.pi / 3]
    for degree in range(2, order + 1):
        half = degree // 2
        ratio = factorial(degree) / (2**degree * factorial(half) ** 2)
        sign = -1 if half % 2 == 0 else 1
        even = 2 * np.pi * sign * ratio / ((degree + 2) * (degree - 1))
        kernel.append(0.0 if degree % 2 else even)
    result = np.repeat(kernel[: order + 1], 2 * np.arange(order + 1) + 1)
    result.setflags(write=False)
    return result


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


def dominant_light(light: HasLighting, cone_rad: float = 0.35) -> DominantLight:
    """Find the brightest spot of `cone_rad` radius and what it adds over its surroundings.

    The spot is where the light, blurred to the cone, peaks; it counts as light above the
    scene's mean outside the cone. Its direction is the power-weighted mean.

    Args:
        light: a `Lighting`, or an `Environment`, whose `main_light` is as fine as it is.
        cone_rad: radius of the spot.

    Examples:
        >>> room = np.full((64, 128, 3), 0.1, np.float32)
        >>> room[10, 96] = 200.0  # a lamp, right of the view and up
        >>> light = deeplight.dominant_light(deeplight.Environment(room))
        >>> light.direction.round(1), round(float(light.share), 2)
        (array([0.5, 0.9, 0.1], dtype=float32), 0.16)
    """
    lighting = light.lighting
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

    Where it is, a 32 x 32 ball shows; what it adds is taken from the panorama itself, so that a
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
