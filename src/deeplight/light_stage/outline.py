"""Where a sphere is in a photograph, to a fraction of a pixel.

A sphere's outline is a cone of rays, and a cone about the axis a with half angle r holds the
directions d with d . a = cos r. With m = a / cos r that is d . m = 1, linear in m: the points of
the edge give axis and angular radius at once, the perspective's ellipse included.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from deeplight.camera import PinholeCamera
from deeplight.errors import ImageFileError
from deeplight.frames import looking_at, normalised
from deeplight.sphere import CROP_SIZE, SphereView

_RAYS = 360
_STEP_PX = 0.25
_WEAKEST_EDGE = 0.2  # of the median contrast: less is a side that no light reaches


@dataclass(frozen=True, eq=False)
class Outline:
    """A sphere in a photograph.

    Attributes:
        view: the ideal camera aimed at it.
        centre_px: (x, y) of the ellipse's centre; 0.0 is the first pixel's centre.
        axes_px: its half axes, the longer first.
        rms_px: how far the points of the edge lie from it; nan where it was given.
        edge_share: share of the circumference whose edge was seen.
    """

    view: SphereView
    centre_px: tuple[float, float]
    axes_px: tuple[float, float]
    rms_px: float
    edge_share: float


def find_sphere(picture: Float[np.ndarray, "height width"], camera: PinholeCamera) -> Outline:
    """The one bright sphere before a darker background.

    Args:
        picture: the sum of all photographs, or one in a lit room; linear.

    Raises:
        ImageFileError: no round thing stands out.
    """
    x, y, radius = _coarse(picture)
    for _ in range(3):
        points, share = _edge_points(picture, x, y, radius)
        if share < 0.3:
            raise _no_sphere(f"edges on {share:.0%} of the way around")
        points = _without_outliers(points)
        outline = _fitted(points, camera, share)
        (x, y), radius = outline.centre_px, float(np.mean(outline.axes_px))
    if outline.rms_px > max(0.5, 0.03 * radius):
        raise _no_sphere(f"edges {outline.rms_px:.1f} px off a circle")
    return outline


def sphere_at(x: float, y: float, radius: float, camera: PinholeCamera) -> Outline:
    """The sphere whose outline is the given circle, in pixels."""
    if radius < 4:
        raise ImageFileError("a circle of at least 4 px", f"radius {radius}", "correct --circle")
    angle = np.arange(_RAYS) * (2 * np.pi / _RAYS)
    points = np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle)], -1)
    return _fitted(points, camera, 1.0, given=True)


def rays_through(
    points: Float[np.ndarray, "points 2"], camera: PinholeCamera
) -> Float[np.ndarray, "points 3"]:
    """Unit directions through pixel positions (x, y)."""
    half_width, half_height = camera.tangents
    x = (2 * (points[:, 0] + 0.5) / camera.width - 1) * half_width
    y = (1 - 2 * (points[:, 1] + 0.5) / camera.height) * half_height
    plane = np.stack([x, y, np.full(len(points), -1.0)], -1)
    return normalised(plane)


def _coarse(picture: np.ndarray) -> tuple[float, float, float]:
    """Centre and radius from the pixels above the level that parts bright from dark best."""
    low, high = np.percentile(picture, (1, 99))
    if not high > low:
        raise _no_sphere("an even picture")
    counts, edges = np.histogram(np.clip(picture, low, high), 128)
    middles = (edges[1:] + edges[:-1]) / 2
    below, sum_below = np.cumsum(counts), np.cumsum(counts * middles)
    above, sum_above = below[-1] - below, sum_below[-1] - sum_below
    means = sum_below / np.maximum(below, 1) - sum_above / np.maximum(above, 1)
    level = edges[1:][np.argmax(below * above * means**2)]  # Otsu 1979
    rows, columns = np.nonzero(picture > level)
    if len(rows) < 50:
        raise _no_sphere(f"{len(rows)} bright pixels")
    return float(columns.mean()), float(rows.mean()), float(np.sqrt(len(rows) / np.pi))


def _edge_points(
    picture: np.ndarray, x: float, y: float, radius: float
) -> tuple[np.ndarray, float]:
    """Where rays from the centre cross half-way between inside and outside; the share found."""
    angle = np.arange(_RAYS) * (2 * np.pi / _RAYS)
    along = np.arange(0.75 * radius, 1.22 * radius, _STEP_PX)
    columns = x + np.cos(angle)[:, None] * along
    rows = y + np.sin(angle)[:, None] * along
    profile = _bilinear(picture, rows, columns)
    height, width = picture.shape
    framed = ((rows > 0) & (rows < height - 1) & (columns > 0) & (columns < width - 1)).all(axis=1)
    inside = np.median(profile[:, along < 0.88 * radius], axis=1)
    outside = np.median(profile[:, along > 1.1 * radius], axis=1)
    contrast = inside - outside
    strong = framed & (contrast > _WEAKEST_EDGE * max(float(np.median(contrast)), 1e-12))
    level = ((inside + outside) / 2)[:, None]
    falls = (profile[:, :-1] >= level) & (profile[:, 1:] < level)
    strong &= falls.any(axis=1)
    last = falls.shape[1] - 1 - np.argmax(falls[:, ::-1], axis=1)  # the outermost crossing
    number = np.arange(_RAYS)
    first, second = profile[number, last], profile[number, last + 1]
    part = (first - level[:, 0]) / np.maximum(first - second, 1e-12)
    at = along[last] + part * _STEP_PX
    points = np.stack([x + np.cos(angle) * at, y + np.sin(angle) * at], -1)
    return points[strong], float(strong.mean())


def _without_outliers(points: np.ndarray) -> np.ndarray:
    """The points near one circle: a stand or a cable crosses the edge somewhere."""
    for _ in range(5):
        design = np.c_[points, np.ones(len(points))]
        a, b, c = np.linalg.lstsq(design, (points**2).sum(axis=1), rcond=None)[0]
        radius = np.sqrt(max(c + (a * a + b * b) / 4, 0))
        off = np.hypot(points[:, 0] - a / 2, points[:, 1] - b / 2) - radius
        spread = 1.4826 * np.median(np.abs(off - np.median(off)))
        kept = np.abs(off - np.median(off)) < max(3.5 * spread, 0.1)
        if kept.all():
            break
        points = points[kept]
    return points


def _fitted(
    points: np.ndarray, camera: PinholeCamera, share: float, given: bool = False
) -> Outline:
    directions = rays_through(points, camera)
    middle = directions.mean(axis=0)
    # Around the middle ray the three unknowns are of one size, whatever the field of view.
    frame = looking_at(middle)
    plane = directions @ frame.T
    scale = np.abs(plane[:, :2]).max()
    design = np.c_[plane[:, :2] / scale, plane[:, 2]]
    a, b, c = np.linalg.lstsq(design, np.ones(len(points)), rcond=None)[0]
    cone = np.array([a / scale, b / scale, c])
    length = float(np.linalg.norm(cone))
    if not (np.isfinite(length) and length > 1):
        raise _no_sphere("edges that no cone holds")
    axis, angular = frame.T @ (cone / length), float(np.arccos(1 / length))
    focal = camera.height / 2 / camera.tangents[1]
    off_cone = np.arccos(np.clip(directions @ axis, -1, 1)) - angular
    rms = float("nan") if given else float(np.sqrt((off_cone**2).mean()) * focal)
    view = SphereView(looking_at(axis), angular, CROP_SIZE)
    return Outline(view, *_ellipse(axis, angular, camera, focal), rms, share)


def _ellipse(
    axis: np.ndarray, angular: float, camera: PinholeCamera, focal: float
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Centre and half axes in pixels of a cone's cut through the picture."""
    off = float(np.arctan2(np.hypot(axis[0], axis[1]), -axis[2]))
    far, near = np.tan(off + angular), np.tan(off - angular)
    minor = np.sin(angular) / np.sqrt(np.cos(off + angular) * np.cos(off - angular))
    across = max(float(np.hypot(axis[0], axis[1])), 1e-12)
    reach = focal * (far + near) / 2
    x = camera.width / 2 - 0.5 + reach * axis[0] / across
    y = camera.height / 2 - 0.5 - reach * axis[1] / across
    return (float(x), float(y)), (float(focal * (far - near) / 2), float(focal * minor))


def _bilinear(picture: np.ndarray, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Values between pixel centres; beyond the edge the edge's."""
    height, width = picture.shape
    rows, columns = np.clip(rows, 0, height - 1), np.clip(columns, 0, width - 1)
    top = np.minimum(rows.astype(int), height - 2)
    left = np.minimum(columns.astype(int), width - 2)
    down, right = rows - top, columns - left
    upper = picture[top, left] * (1 - right) + picture[top, left + 1] * right
    lower = picture[top + 1, left] * (1 - right) + picture[top + 1, left + 1] * right
    mixed: np.ndarray = upper * (1 - down) + lower * down
    return mixed


def _no_sphere(got: str) -> ImageFileError:
    return ImageFileError("one bright sphere on a darker background", got, "give --circle x y r")
