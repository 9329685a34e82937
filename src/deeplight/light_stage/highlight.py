"""Lights found in a mirror ball: where each one stands and how bright it is."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from deeplight import brdf
from deeplight.camera import PinholeCamera
from deeplight.frames import normalised, turned
from deeplight.light_stage.outline import rays_through
from deeplight.sphere import SphereView

_HALF_WINDOW = 0.05  # of the sphere's radius in pixels, at least 4
_ABOVE = 0.003  # of the peak: less is noise
_RIM = 0.94  # of the radius: lights 140 degrees from the camera's side


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
) -> Highlight | None:
    """The one light that a photograph of the mirror ball shows.

    Args:
        photograph: linear, dark frame subtracted, of exposure 1.
        place_m: the sphere's radius and the lights' distance; None: far away.

    Returns:
        None where no light stands out.
    """
    grey = photograph.mean(axis=2)
    radius_px = np.tan(view.angular_radius_rad) * camera.height / 2 / camera.tangents[1]
    window = _window(grey, camera, view, radius_px)
    if window is None:
        return None
    rows, columns = window
    patch = photograph[rows, columns] - np.median(photograph[rows, columns], axis=(0, 1))
    spot = patch.mean(axis=2)
    spot = np.where(spot > _ABOVE * spot.max(), spot, 0)
    y, x = np.mgrid[rows, columns]
    centroid = np.array([[(x * spot).sum(), (y * spot).sum()]]) / spot.sum()
    direction, edge = _shown(centroid, camera, view, place_m)
    pixels = np.stack([x.ravel(), y.ravel()], -1).astype(float)
    solid_angle = _solid_angles(pixels, camera, view, place_m)
    flux = (patch.reshape(-1, 3) * solid_angle[:, None]).sum(axis=0)
    irradiance = np.maximum(flux, 1e-12) / brdf.REFLECTIVITY["mirror"]
    return Highlight(direction[0], irradiance, bool(edge[0] > _RIM))


def _window(
    grey: np.ndarray, camera: PinholeCamera, view: SphereView, radius_px: float
) -> tuple[slice, slice] | None:
    """About the brightest pixel on the sphere; None if it is noise."""
    height, width = grey.shape
    (row,), (column,) = camera.pixel_of_directions(-view.ball_from_camera[2:])
    y, x = np.ogrid[:height, :width]
    on_sphere = (x - column) ** 2 + (y - row) ** 2 <= (radius_px + 1) ** 2
    lit = np.where(on_sphere, grey, -np.inf)
    peak_row, peak_column = np.unravel_index(int(lit.argmax()), lit.shape)
    noise = np.median(np.abs(grey[on_sphere]))
    if not grey[peak_row, peak_column] > 8 * noise + 1e-9:
        return None
    half = max(4, round(_HALF_WINDOW * radius_px))
    return (
        slice(max(0, int(peak_row) - half), min(height, int(peak_row) + half + 1)),
        slice(max(0, int(peak_column) - half), min(width, int(peak_column) + half + 1)),
    )


def _shown(
    points: np.ndarray,
    camera: PinholeCamera,
    view: SphereView,
    place_m: tuple[float, float] | None,
) -> tuple[np.ndarray, np.ndarray]:
    """What pixel positions show: directions from the centre; how far out they lie (1 = rim).

    A light at a finite distance is met by the mirrored ray from the sphere's surface.
    """
    rays = turned(rays_through(points, camera), view.ball_from_camera)
    u, v = (rays[:, i] / -rays[:, 2] / np.tan(view.angular_radius_rad) for i in (0, 1))
    normals, views = view.surface(u, v)
    directions = 2 * (normals * views).sum(axis=1, keepdims=True) * normals - views
    if place_m is not None:
        places = normals * (place_m[0] / place_m[1])
        along = (directions * places).sum(axis=1, keepdims=True)
        reach = np.sqrt(1 - (places**2).sum(axis=1, keepdims=True) + along**2) - along
        directions = normalised(places + directions * reach)
    return directions, np.hypot(u, v)


def _solid_angles(
    pixels: np.ndarray,
    camera: PinholeCamera,
    view: SphereView,
    place_m: tuple[float, float] | None,
) -> np.ndarray:
    """Solid angle of the world that each pixel of the mirror ball shows; 0 off the ball."""
    half = 0.5
    left, right, above, below = (
        _shown(pixels + step, camera, view, place_m)[0]
        for step in ([-half, 0], [half, 0], [0, -half], [0, half])
    )
    inside = _shown(pixels, camera, view, place_m)[1] < 1
    return np.linalg.norm(np.cross(right - left, below - above), axis=1) * inside
