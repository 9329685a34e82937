"""A reference sphere as the ideal camera sees it, and the rig that holds three of them.

Section 3.1: each sphere is re-sampled with a camera oriented at its centre whose frustum
touches it on four sides. Crop coordinates run like the mirror ball's: u right, v up,
the sphere fills the disc. Directions come out in the frame of the phone's camera.
"""

from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np
from jaxtyping import Bool, Float

from deeplight.camera import TRAINED_CAMERA
from deeplight.errors import ShapeError
from deeplight.frames import (
    MIRROR_X,
    Rotation,
    looking_at,
    normalised,
    require_rotation,
    turned,
)
from deeplight.mappings import mirror_ball

SPHERES = ("mirror", "matte_silver", "diffuse")
CROP_SIZE = 32

# lambda_b of equation 4: how much each sphere counts in the loss (Implementation Details).
LOSS_WEIGHTS = {"mirror": 0.2, "matte_silver": 0.2, "diffuse": 0.6}


@dataclass(frozen=True, eq=False)
class SphereView:
    """The ideal camera oriented at one sphere.

    Attributes:
        ball_from_camera: turns directions of the phone's camera into the sphere's frame,
            whose -Z points at the sphere's centre.
        angular_radius_rad: asin(radius / distance); 0 is a sphere seen from infinitely far.
        size: pixels along the crop.
    """

    ball_from_camera: Rotation = field(default_factory=lambda: np.eye(3))
    angular_radius_rad: float = 0.0
    size: int = CROP_SIZE

    def __post_init__(self) -> None:
        require_rotation(self.ball_from_camera, "ball_from_camera")
        if not 0 <= self.angular_radius_rad < np.pi / 3 or self.size < 1:
            raise ShapeError(
                "an angular radius of 0 to 60 degrees",
                f"{np.degrees(self.angular_radius_rad):.1f} degrees",
                "give asin(radius / distance) in radians",
            )
        own = self.ball_from_camera.copy()  # the caller's stays writable
        own.setflags(write=False)
        object.__setattr__(self, "ball_from_camera", own)

    def alpha(self) -> Float[np.ndarray, "size size"]:
        """Share of each pixel that shows the sphere, 0 to 1."""
        return mirror_ball.coverage(self.size)

    def mask(self) -> Bool[np.ndarray, "size size"]:
        """Pixels that show nothing but sphere: what losses and metrics look at."""
        return mirror_ball.coverage(self.size) > 1 - 1e-3

    def normals(self, supersample: int = 1) -> Float[np.ndarray, "n n 3"]:
        """Surface normal seen at each position, camera frame."""
        return self._surface(supersample)[0]

    def views(self, supersample: int = 1) -> Float[np.ndarray, "n n 3"]:
        """Direction from the surface back to the camera, camera frame."""
        return self._surface(supersample)[1]

    def reflected(self, supersample: int = 1) -> Float[np.ndarray, "n n 3"]:
        """Direction the mirror shows at each position, camera frame."""
        normals, views = self._surface(supersample)
        return 2 * (normals * views).sum(-1, keepdims=True) * normals - views

    def mirrored(self) -> Self:
        """The view of the same sphere in a horizontally flipped photo."""
        flipped = MIRROR_X @ self.ball_from_camera @ MIRROR_X
        return type(self)(flipped, self.angular_radius_rad, self.size)

    def surface(
        self, u: Float[np.ndarray, "*n"], v: Float[np.ndarray, "*n"]
    ) -> tuple[Float[np.ndarray, "*n 3"], Float[np.ndarray, "*n 3"]]:
        """Normal, and direction back to the camera, at crop positions; off the disc the rim's."""
        radius = np.maximum(np.hypot(u, v), 1.0)
        normals, views = _hit(u / radius, v / radius, self.angular_radius_rad)
        camera_from_ball = self.ball_from_camera.T
        return turned(normals, camera_from_ball), turned(views, camera_from_ball)

    def _surface(self, supersample: int) -> tuple[np.ndarray, np.ndarray]:
        return self.surface(*mirror_ball.grid(self.size, supersample))


@dataclass(frozen=True, eq=False)
class Rig:
    """The holder that keeps three spheres in front of a phone.

    Attributes:
        name: what examples call it.
        views: one view for each name in `SPHERES`.
    """

    name: str
    views: dict[str, SphereView]

    def __post_init__(self) -> None:
        if set(self.views) != set(SPHERES):
            raise ShapeError(f"the spheres {SPHERES}", f"{tuple(self.views)}", "name all three")

    def mirrored(self) -> Self:
        """The rig in a horizontally flipped photo: its spheres change sides with their light."""
        return type(self)(f"{self.name}-mirrored", {n: v.mirrored() for n, v in self.views.items()})

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        spheres = {
            name: {
                "ball_from_camera": view.ball_from_camera.tolist(),
                "angular_radius_rad": view.angular_radius_rad,
                "size": view.size,
            }
            for name, view in self.views.items()
        }
        return {"name": self.name, "spheres": spheres}

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Self:
        """The rig that `to_dict` wrote."""
        views = {
            name: SphereView(
                np.array(view["ball_from_camera"], float), view["angular_radius_rad"], view["size"]
            )
            for name, view in values["spheres"].items()
        }
        return cls(values["name"], views)


def rig_in_frame(
    name: str, centres: dict[str, tuple[float, float]], radius_m: float, distance_m: float
) -> Rig:
    """A rig from where its spheres' centres appear in the trained frame.

    Args:
        name: what examples call it.
        centres: for each sphere its place (x, y) in the frame, each -1 to 1, right and up.
        radius_m: radius of the spheres.
        distance_m: from the camera to each sphere's centre.
    """
    half_width, half_height = TRAINED_CAMERA.tangents
    angular_radius = float(np.arcsin(radius_m / distance_m))
    views = {
        sphere: SphereView(
            looking_at(np.array([x * half_width, y * half_height, -1.0])), angular_radius
        )
        for sphere, (x, y) in centres.items()
    }
    return Rig(name, views)


# 60 cm is the paper's; 8 cm ornaments side by side in the lower 20 % are our choice.
PAPER_RIG = rig_in_frame(
    "paper",
    {"mirror": (-0.6, -0.8), "matte_silver": (0.0, -0.8), "diffuse": (0.6, -0.8)},
    radius_m=0.04,
    distance_m=0.60,
)


def _hit(u: np.ndarray, v: np.ndarray, angular_radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Normal and direction to the camera where the ray through (u, v) meets the sphere.

    In the sphere's frame, sphere radius 1 at distance 1 / sin(angular_radius) along -Z.
    """
    if angular_radius == 0:
        z = np.sqrt(np.maximum(1 - u * u - v * v, 0))
        return np.stack([u, v, z], -1), np.broadcast_to([0.0, 0.0, 1.0], (*u.shape, 3))
    t = np.tan(angular_radius)
    ray = normalised(np.stack([u * t, v * t, np.full_like(u, -1.0)], -1))
    distance = 1 / np.sin(angular_radius)
    along = -ray[..., 2] * distance  # to the point of the ray nearest the centre
    depth = along - np.sqrt(np.maximum(along**2 - (distance**2 - 1), 0))
    normal = ray * depth[..., None] + [0.0, 0.0, distance]
    return normalised(normal), -ray
