"""Lights found in a mirror ball: where each one stands and how bright it is."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from deeplight import brdf
from deeplight.camera import PinholeCamera
from deeplight.errors import ImageFileError
from deeplight.frames import turned
from deeplight.light_stage.outline import rays_through
from deeplight.sphere import SphereView

_HALF_WINDOW = 0.06  # of the sphere's radius in pixels, at least 4
_ABOVE = 0.02  # of the peak: less is noise and glow


@dataclass(frozen=True, eq=False)
class Highlight:
    """One light in the mirror.

    Attributes:
        direction: unit, camera frame, from the sphere's centre.
        irradiance: what it gives at the sphere's centre, in pixel values: red, green, blue.
        behind: it stands so far behind the sphere that its image lies at the very rim, where a
            pixel spans many degrees; direction and irradiance are uncertain.
    """

    direction: Float[np.ndarray, "3"]
    irradiance: Float[np.ndarray, "3"]
    behind: bool


def find_highlight(
    photograph: Float[np.ndarray, "height width 3"],
    camera: PinholeCamera,
    view: SphereView,
    place_m: tuple[float, float] | None,
) -> Highlight:
    """The one light that a photograph of the mirror ball shows.

    Args:
        photograph: linear, dark frame subtracted, of exposure 1.
        place_m: the sphere's radius and the lights' distance; None: far away.

    Raises:
        ImageFileError: no light stands out.
    """
    grey = photograph.mean(axis=2)
    radius_px = np.tan(view.angular_radius_rad) * camera.height / 2 / camera.tangents[1]
    rows, columns = _window(grey, camera, view, radius_px)
    patch = grey[rows, columns]
    patch = np.where(patch > _ABOVE * patch.max(), patch, 0)
    y, x = np.mgrid[rows, columns]
    centroid = np.array([[(x * patch).sum(), (y * patch).sum()]]) / patch.sum()
    reflected, normal, edge = _reflected(centroid, camera, view)
    direction, gain = _from_centre(reflected[0], normal[0], place_m)
    pixels = np.stack([x.ravel(), y.ravel()], -1).astype(float)
    flux = photograph[rows, columns].reshape(-1, 3) * _solid_angles(pixels, camera, view)[:, None]
    flux *= (patch > 0).reshape(-1, 1)
    irradiance = flux.sum(axis=0) / brdf.REFLECTIVITY["mirror"] / gain
    return Highlight(direction, irradiance, bool(edge[0] > 0.96))


def _window(
    grey: np.ndarray, camera: PinholeCamera, view: SphereView, radius_px: float
) -> tuple[slice, slice]:
    """About the brightest pixel on the sphere."""
    height, width = grey.shape
    towards = -view.ball_from_camera[2]
    row, column = (float(v) for v in camera.pixel_of_directions(towards))
    y, x = np.ogrid[:height, :width]
    on_sphere = (x - column) ** 2 + (y - row) ** 2 <= (radius_px + 1) ** 2
    lit = np.where(on_sphere, grey, -np.inf)
    peak_row, peak_column = np.unravel_index(int(lit.argmax()), lit.shape)
    noise = np.median(np.abs(grey[on_sphere]))
    if not grey[peak_row, peak_column] > 8 * noise + 1e-9:
        got = "none that stands out"
        raise ImageFileError("the image of one light in the mirror ball", got, "expose it longer")
    half = max(4, round(_HALF_WINDOW * radius_px))
    return (
        slice(max(0, int(peak_row) - half), min(height, int(peak_row) + half + 1)),
        slice(max(0, int(peak_column) - half), min(width, int(peak_column) + half + 1)),
    )


def _reflected(
    points: np.ndarray, camera: PinholeCamera, view: SphereView
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mirrored direction and normal at pixel positions, and how far out they lie (1 = rim)."""
    rays = turned(rays_through(points, camera), view.ball_from_camera)
    u, v = (rays[:, i] / -rays[:, 2] / np.tan(view.angular_radius_rad) for i in (0, 1))
    normals, views = view.surface(u, v)
    reflected = 2 * (normals * views).sum(axis=1, keepdims=True) * normals - views
    return reflected, normals, np.hypot(u, v)


def _from_centre(
    reflected: np.ndarray, normal: np.ndarray, place_m: tuple[float, float] | None
) -> tuple[np.ndarray, float]:
    """Direction from the sphere's centre, and the irradiance at its surface against there."""
    if place_m is None:
        return reflected, 1.0
    radius, distance = place_m
    place = normal * (radius / distance)
    along = float(reflected @ place)
    reach = np.sqrt(1 - place @ place + along * along) - along
    direction = place + reflected * reach
    return direction / np.linalg.norm(direction), float(1 / reach**2)


def _solid_angles(pixels: np.ndarray, camera: PinholeCamera, view: SphereView) -> np.ndarray:
    """Solid angle of the world that each pixel of the mirror ball shows; 0 off the ball."""
    half = 0.5
    left, right, above, below = (
        _reflected(pixels + step, camera, view)[0]
        for step in ([-half, 0], [half, 0], [0, -half], [0, half])
    )
    inside = _reflected(pixels, camera, view)[2] < 1
    return np.linalg.norm(np.cross(right - left, below - above), axis=1) * inside
