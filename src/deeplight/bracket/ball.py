"""A mirror ball in a picture: find it, and unwrap what it shows to all directions."""

from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float, Float32

from deeplight.errors import ConfigError
from deeplight.frames import dot, looking_at, normalised, turned
from deeplight.mappings import latlong, mirror_ball, resample
from deeplight.sphere import SphereView

BLIND_RADIUS = 0.985
"""From here to the rim the ball shows 20 degrees straight behind itself, too thin to be used."""
_SEARCH_PX = 640
_STEPS = 8

Radiance = Float32[np.ndarray, "height width 3"]
Crop = Float32[np.ndarray, "size size 3"]
Latlong = Float32[np.ndarray, "rows columns 3"]


@dataclass(frozen=True)
class Circle:
    """The ball's outline in pixels of the upright picture: centre from the top left, radius."""

    x: float
    y: float
    radius: float


def find_circle(picture: Radiance) -> Circle:
    """The most distinct large circle in a picture with values 0 to 1 (Hough, by OpenCV).

    Raises:
        ConfigError: there is none.
    """
    height, width, _ = picture.shape
    scale = min(1.0, _SEARCH_PX / max(height, width))
    grey = (np.clip(picture.mean(-1), 0, 1) * 255).astype(np.uint8)
    small = cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    side = min(small.shape)
    found = cv2.HoughCircles(
        cv2.medianBlur(small, 5),
        cv2.HOUGH_GRADIENT_ALT,
        dp=1.5,
        minDist=side,
        param1=200,
        param2=0.6,
        minRadius=side // 12,
        maxRadius=side // 2 + 2,
    )
    if found is None:
        raise ConfigError("a mirror ball in the picture", "none found", "give --ball X Y RADIUS")
    x, y, radius = found.reshape(-1, found.shape[-1])[0][:3]
    return Circle(float(x + 0.5) / scale, float(y + 0.5) / scale, float(radius) / scale)


def unwrapped(
    picture: Radiance, circle: Circle, focal_px: float | None = None
) -> tuple[Latlong, Float32[np.ndarray, "rows columns"]]:
    """What the ball shows, as a latlong in the camera's frame, and how much of it was seen.

    Light is taken to come from far away. Straight behind the ball its rim's light is repeated
    and `seen` is 0.

    Args:
        focal_px: focal length in pixels; left out, the ball is taken to be far away and the
            camera to look at its middle.

    Raises:
        ConfigError: the circle does not lie within the picture.
    """
    height, width, _ = picture.shape
    inside = 0 < circle.x < width and 0 < circle.y < height and circle.radius >= 8
    if not inside or circle.radius > max(height, width):
        got = f"{circle.x:.0f} {circle.y:.0f} {circle.radius:.0f} in {width} x {height}"
        raise ConfigError(
            "a ball within the picture, 8 pixels or more in radius", got, "correct it"
        )
    size = 2 * round(circle.radius)
    view = _view(picture.shape[:2], circle, focal_px, size)
    crop = _crop(picture, circle, focal_px, view)
    rows = max(32, 2 * (size // 4))
    directions = latlong.directions(2 * rows, 4 * rows).astype(np.float64)
    u, v = uv_showing(directions, view)
    fine = _sampled(crop, u, v)
    seen = np.clip((BLIND_RADIUS - np.hypot(u, v)) / 0.01 + 0.5, 0, 1)[..., None]
    shrunk = (resample.shrink_latlong(part, rows) for part in (fine, seen.astype(np.float32)))
    radiance, known = shrunk
    return radiance.astype(np.float32), known[..., 0].clip(0, 1).astype(np.float32)


def uv_showing(
    directions: Float[np.ndarray, "*n 3"], view: SphereView
) -> tuple[Float[np.ndarray, "*n"], Float[np.ndarray, "*n"]]:
    """Ball position in which each direction is seen, also from near by (a fixed-point search)."""
    wanted = turned(directions, view.ball_from_camera)
    asked = wanted
    for _ in range(_STEPS if view.angular_radius_rad else 0):
        u, v = mirror_ball.uv_from_directions(asked)
        normals, views = view.surface(u, v)
        shown = 2 * dot(normals, views)[..., None] * normals - views
        asked = normalised(asked + wanted - turned(shown, view.ball_from_camera))
    return mirror_ball.uv_from_directions(asked)


def _view(shape: tuple[int, int], circle: Circle, focal_px: float | None, size: int) -> SphereView:
    if focal_px is None:
        return SphereView(size=size)
    height, width = shape
    towards = np.array([circle.x - width / 2, height / 2 - circle.y, -focal_px])
    cosine = focal_px / float(np.linalg.norm(towards))
    # Off the axis an outline is longer by 1 / cos and 1 / cos^2: the mean radius by their mean.
    angular = np.arctan(circle.radius / focal_px * cosine**1.5)
    return SphereView(looking_at(towards), float(angular), size)


def _crop(picture: Radiance, circle: Circle, focal_px: float | None, view: SphereView) -> Crop:
    """The ball as the camera that is oriented at it would see it."""
    u, v = mirror_ball.grid(view.size)
    if focal_px is None:
        column, row = circle.x + u * circle.radius, circle.y - v * circle.radius
    else:
        t = np.tan(view.angular_radius_rad)
        rays = np.stack([u * t, v * t, np.full_like(u, -1.0)], axis=-1)
        rays = turned(rays, view.ball_from_camera.T)
        height, width, _ = picture.shape
        column = width / 2 - rays[..., 0] / rays[..., 2] * focal_px
        row = height / 2 + rays[..., 1] / rays[..., 2] * focal_px
    x, y = (column - 0.5).astype(np.float32), (row - 0.5).astype(np.float32)
    found: Crop = cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return found


def _sampled(crop: Crop, u: np.ndarray, v: np.ndarray) -> Latlong:
    """Bilinear look-up at ball positions, kept off the outline, where the background mixes in."""
    size = len(crop)
    radius = np.hypot(u, v)
    inward = np.minimum(1.0, (1 - 2 / size) / np.maximum(radius, 1e-9))
    x = ((u * inward + 1) * (size / 2) - 0.5).astype(np.float32)
    y = ((1 - v * inward) * (size / 2) - 0.5).astype(np.float32)
    found: Latlong = cv2.remap(crop, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return found
