"""Objects that stand still while the camera turns: rendered once, then seen from each frame.

A camera that turns about one point sees the same light in each direction. So one rendering, wider
than the frame, serves all frames that look nearly the same way, and its grain stands still as well.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from deeplight.camera import PinholeCamera
from deeplight.compose.ground import Viewpoint
from deeplight.compose.trace import Layers
from deeplight.frames import turned

MARGIN = 0.5  # of the frame's longer side, on every side of a rendering
FARTHEST_RAD = float(np.radians(15))
"""A frame that looks farther aside than this needs a rendering of its own."""


def widened(viewpoint: Viewpoint) -> Viewpoint:
    """The same camera with a larger picture, its pixels as large as before."""
    camera = viewpoint.camera
    more = round(MARGIN * max(camera.width, camera.height))
    height = camera.height + 2 * more
    tangent = camera.tangents[1] * height / camera.height
    wide = PinholeCamera(camera.width + 2 * more, height, 2 * float(np.arctan(tangent)))
    return replace(viewpoint, camera=wide)


def is_near(one: Viewpoint, other: Viewpoint) -> bool:
    """Whether a rendering from one of them serves the other."""
    cosine = one.world_from_camera[:, 2] @ other.world_from_camera[:, 2]
    return bool(cosine > np.cos(FARTHEST_RAD))


def seen_from(layers: Layers, rendered: Viewpoint, now: Viewpoint) -> Layers:
    """Layers of one viewpoint as the camera sees them that has turned, about the same point.

    Bilinear; what was not rendered is unchanged photo.

    Args:
        layers: in pixels of `rendered`.
        rendered, now: cameras at the same place, `now` of any picture size.
    """
    left, top, right, bottom = layers.crop
    now_from_rendered = now.world_from_camera.T @ rendered.world_from_camera
    edge = _edge_rays(rendered.camera, layers.crop)
    crop = _crop(now.camera, turned(edge, now_from_rendered))
    height, width = crop[3] - crop[1], crop[2] - crop[0]
    if min(height, width) < 1 or min(right - left, bottom - top) < 1:
        nothing = np.zeros((0, 0, 3), np.float32)
        return Layers((0, 0, 0, 0), nothing, nothing[..., 0], nothing)
    rays = _rays(now.camera, crop).astype(np.float32)
    rays = turned(rays, now_from_rendered.T.astype(np.float32))
    rays[rays[..., 2] > -1e-3] = [-1e6, 0, -1]  # behind that camera: nowhere in its picture
    row, column = rendered.camera.pixel_of_directions(rays)
    values = [layers.radiance, layers.cover[..., None], layers.shadow - 1]
    found = _looked_up(np.concatenate(values, -1), row - top, column - left)
    return Layers(crop, found[..., :3], found[..., 3], found[..., 4:] + 1)


def _rays(camera: PinholeCamera, crop: tuple[int, int, int, int]) -> Float[np.ndarray, "h w 3"]:
    """Through the pixels of a crop; not of unit length."""
    left, top, right, bottom = crop
    x = ((np.arange(left, right) + 0.5) * (2 / camera.width) - 1) * camera.tangents[0]
    y = (1 - (np.arange(top, bottom) + 0.5) * (2 / camera.height)) * camera.tangents[1]
    return np.stack([*np.meshgrid(x, y), np.full((len(y), len(x)), -1.0)], axis=-1)


def _edge_rays(camera: PinholeCamera, crop: tuple[int, int, int, int]) -> Float[np.ndarray, "n 3"]:
    rays = _rays(camera, crop)
    return np.concatenate([rays[0], rays[-1], rays[:, 0], rays[:, -1]])


def _crop(camera: PinholeCamera, edge: Float[np.ndarray, "n 3"]) -> tuple[int, int, int, int]:
    """The part of the picture within an outline; all of it where that reaches behind the camera."""
    if edge[:, 2].max() > -1e-3:
        return 0, 0, camera.width, camera.height
    row, column = camera.pixel_of_directions(edge)
    limits = ((column, camera.width), (row, camera.height))
    low = [int(np.clip(np.floor(at.min()), 0, size)) for at, size in limits]
    high = [int(np.clip(np.ceil(at.max()) + 1, 0, size)) for at, size in limits]
    return low[0], low[1], high[0], high[1]


def _looked_up(
    values: Float[np.ndarray, "rows columns n"],
    row: Float[np.ndarray, "h w"],
    column: Float[np.ndarray, "h w"],
) -> Float[np.ndarray, "h w n"]:
    """Bilinear between pixel centres; 0 outside."""
    padded = np.pad(values, [(1, 1), (1, 1), (0, 0)])
    row = np.clip(row + 1, 0, padded.shape[0] - 1)
    column = np.clip(column + 1, 0, padded.shape[1] - 1)
    top = np.minimum(row.astype(np.int32), padded.shape[0] - 2)
    left = np.minimum(column.astype(np.int32), padded.shape[1] - 2)
    down, right = (row - top)[..., None], (column - left)[..., None]
    width = padded.shape[1]
    flat, first = padded.reshape(-1, padded.shape[2]), top * width + left
    upper = flat[first] * (1 - right) + flat[first + 1] * right
    lower = flat[first + width] * (1 - right) + flat[first + width + 1] * right
    found: np.ndarray = upper * (1 - down) + lower * down
    return found.astype(np.float32)
