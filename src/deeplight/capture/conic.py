"""The outline of a sphere: a circular cone of directions, an ellipse in the picture.

Seen from the camera a sphere of radius R at distance d fills the cone of half angle asin(R / d)
around its centre. A pinhole projects the cone to a conic, exactly; nothing here is approximate.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from deeplight.camera import PinholeCamera
from deeplight.frames import normalised


@dataclass(frozen=True)
class Cone:
    """Where a sphere is seen.

    Attributes:
        direction: unit vector to the sphere's centre, camera frame.
        angular_radius_rad: asin(radius / distance).
    """

    direction: Float[np.ndarray, "3"]
    angular_radius_rad: float


@dataclass(frozen=True)
class Ellipse:
    """An ellipse in a picture, in pixels; 0.0 is the first pixel's centre, y runs down.

    Attributes:
        x, y: its centre, which is not the projection of the sphere's centre.
        major, minor: half axes.
        angle_deg: from +x towards +y to the major axis, 0 to 180.
    """

    x: float
    y: float
    major: float
    minor: float
    angle_deg: float

    @property
    def centre(self) -> tuple[float, float]:
        """(x, y)."""
        return self.x, self.y

    @property
    def axes(self) -> tuple[float, float]:
        """The half axes, the larger first."""
        return self.major, self.minor


def across(
    direction: Float[np.ndarray, "3"],
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Two unit vectors that make a right-handed frame with `direction`.

    They turn smoothly with it as long as its z keeps its sign (Duff et al., JCGT 2017).
    """
    x, y, z = (float(value) for value in direction)
    sign = 1.0 if z >= 0 else -1.0
    a = -1 / (sign + z)
    b = x * y * a
    first = np.array([1 + sign * x * x * a, sign * b, -sign * x])
    return first, np.array([b, sign + y * y * a, -y])


def rays_around(
    cone: Cone,
    angles_rad: Float[np.ndarray, "angles"],
    offsets_rad: Float[np.ndarray, "offsets"],
) -> Float[np.ndarray, "angles offsets 3"]:
    """Unit directions at each angle around the cone, `offsets_rad` outside its outline."""
    first, second = across(cone.direction)
    spokes = np.cos(angles_rad)[:, None] * first + np.sin(angles_rad)[:, None] * second
    opening = cone.angular_radius_rad + offsets_rad
    along = np.cos(opening)[None, :, None] * cone.direction
    return along + np.sin(opening)[None, :, None] * spokes[:, None]


def moved(cone: Cone, shift_rad: Float[np.ndarray, "2"], growth_rad: float) -> Cone:
    """The cone with its axis moved along the vectors of `across` and another half angle."""
    first, second = across(cone.direction)
    axis = normalised(cone.direction + shift_rad[0] * first + shift_rad[1] * second)
    return Cone(axis, cone.angular_radius_rad + growth_rad)


def pixel_scale(camera: PinholeCamera) -> float:
    """Pixels per radian in the middle of the picture."""
    return camera.height / 2 / camera.tangents[1]


def ellipse(camera: PinholeCamera, cone: Cone) -> Ellipse:
    """The outline in the picture.

    The rays of the cone are those with (d . a)^2 = cos^2(rho) d . d; with d linear in the
    homogeneous pixel that is a conic's 3 x 3 matrix.
    """
    f = pixel_scale(camera)
    middle_x, middle_y = (camera.width - 1) / 2, (camera.height - 1) / 2
    ray_from_pixel = np.array([[1, 0, -middle_x], [0, -1, middle_y], [0, 0, -f]]) / f
    axis = cone.direction
    matrix = np.outer(axis, axis) - np.cos(cone.angular_radius_rad) ** 2 * np.eye(3)
    conic = ray_from_pixel.T @ matrix @ ray_from_pixel
    centre = np.linalg.solve(conic[:2, :2], -conic[:2, 2])
    value = conic[2, 2] + conic[:2, 2] @ centre
    curvature, axes = np.linalg.eigh(-conic[:2, :2] / value)  # ascending: the major axis first
    if curvature[0] * np.sign(curvature[1]) <= 0:
        nan = float("nan")  # the cone reaches behind the picture plane: no ellipse
        return Ellipse(nan, nan, nan, nan, nan)
    order = np.argsort(np.abs(curvature))
    half = 1 / np.sqrt(np.abs(curvature[order]))
    x, y = axes[:, order[0]]
    return Ellipse(
        float(centre[0]),
        float(centre[1]),
        float(half[0]),
        float(half[1]),
        float(np.degrees(np.arctan2(y, x)) % 180),
    )
