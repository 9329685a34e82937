"""Where rig and fingers are in the picture: which pixels, how much of each, which way they face.

The rig hangs on the phone, so none of this changes during a clip; only its light does.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from deeplight.camera import PinholeCamera
from deeplight.frames import Directions, normalised, turned
from lab.film.parts import Box, Thing, first_hits
from lab.film.reflections import CROP
from lab.film.rig import FilmRig
from lab.film.tag import tag_reflectivity

_COARSE = 4  # pixels between the rays that look for the holder
_RAYS = 3  # along a pixel: how smooth the holder's edges are
_SKIN = (0.45, 0.29, 0.22)


@dataclass(frozen=True, eq=False)
class SpherePatch:
    """One sphere in the frame, and the frame in the sphere's crop.

    Attributes:
        rows, columns: of the frame, as far as the sphere reaches.
        alpha: share of these pixels that shows it.
        taps, weights: four pixels of the crop for each, and how much each counts.
        frame_row, frame_column: the frame's pixel at each pixel of the crop.
    """

    rows: slice
    columns: slice
    alpha: Float[np.ndarray, "rows columns 1"]
    taps: Int[np.ndarray, "4 rows columns"]
    weights: Float[np.ndarray, "4 rows columns 1"]
    frame_row: Int[np.ndarray, "crop crop"]
    frame_column: Int[np.ndarray, "crop crop"]


def sphere_patch(rig: FilmRig, name: str, camera: PinholeCamera) -> SpherePatch:
    """Where a sphere of the rig is seen; its outline may reach out of the frame."""
    view = rig.view(name, CROP)
    ideal = PinholeCamera(CROP, CROP, 2 * view.angular_radius_rad)
    row, column = camera.pixel_of_directions(turned(ideal.rays(), view.ball_from_camera.T))
    rows = slice(max(0, int(row.min()) - 2), min(camera.height, int(row.max()) + 3))
    columns = slice(max(0, int(column.min()) - 2), min(camera.width, int(column.max()) + 3))
    rays = turned(_rays(camera, rows, columns), view.ball_from_camera)
    u, v = (rays[..., n] / -rays[..., 2] / np.tan(view.angular_radius_rad) for n in (0, 1))
    radius = np.hypot(u, v)
    pixel = np.hypot(*np.gradient(radius))  # of the frame, in units of the crop
    alpha = np.clip((1 - radius) / np.maximum(pixel, 1e-9) + 0.5, 0, 1)
    taps, weights = _taps(u, v, radius)
    return SpherePatch(
        rows,
        columns,
        alpha[..., None].astype(np.float32),
        taps,
        weights,
        np.clip(row.round().astype(int), 0, camera.height - 1),
        np.clip(column.round().astype(int), 0, camera.width - 1),
    )


def _taps(u: np.ndarray, v: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bilinear look-up of the crop; pixels at the edge and beyond show its rim."""
    inward = np.minimum(1, (1 - 2.5 / CROP) / np.maximum(radius, 1e-9))
    column = (u * inward + 1) * (CROP / 2) - 0.5
    row = (1 - v * inward) * (CROP / 2) - 0.5
    x, y = np.floor(column).astype(int), np.floor(row).astype(int)
    du, dv = column - x, row - y
    corner = y * CROP + x
    taps = np.stack([corner, corner + 1, corner + CROP, corner + CROP + 1])
    weights = np.stack([(1 - du) * (1 - dv), du * (1 - dv), (1 - du) * dv, du * dv])
    return taps, weights[..., None].astype(np.float32)


@dataclass(frozen=True, eq=False)
class Solid:
    """Pixels of the frame that show something lit by the place, as one flat list.

    Attributes:
        row, column: of each pixel.
        alpha: share of it that is covered.
        normal: which way it faces, camera frame.
        colour: reflectivity.
    """

    row: Int[np.ndarray, "n"]
    column: Int[np.ndarray, "n"]
    alpha: Float[np.ndarray, "n 1"]
    normal: Directions
    colour: Float[np.ndarray, "n 3"]


def holder_in_picture(rig: FilmRig, camera: PinholeCamera) -> Solid:
    """Bar, stalks, arm and tag as the phone sees them."""
    things = [*rig.holder, *([rig.plate] if rig.plate else [])]
    row, column = _near_things(things, camera)
    shape = (len(row), _RAYS * _RAYS)
    steps = (np.arange(_RAYS) + 0.5) / _RAYS - 0.5
    down, right = (a.ravel() for a in np.meshgrid(steps, steps, indexing="ij"))
    rays = _rays_at(camera, row[:, None] + down, column[:, None] + right).reshape(-1, 3)
    index, distance = first_hits(things, np.zeros_like(rays), rays)
    normal, colour = np.zeros_like(rays), np.zeros_like(rays)
    for number, thing in enumerate(things):
        some = index == number
        points = distance[some, None] * rays[some]
        normal[some] = thing.shape.normals(points)
        colour[some] = _colours(thing, rig, points)
    hits = (index >= 0).reshape(shape).sum(axis=1)
    seen = hits > 0
    colour = colour.reshape(*shape, 3).sum(axis=1)[seen] / hits[seen, None]
    normal = normalised(normal.reshape(*shape, 3).sum(axis=1)[seen])
    alpha = hits[seen, None] / shape[1]
    return Solid(
        row[seen],
        column[seen],
        alpha.astype(np.float32),
        normal.astype(np.float32),
        colour.astype(np.float32),
    )


def finger_in_picture(
    camera: PinholeCamera,
    tip_px: tuple[float, float],
    root_px: tuple[float, float],
    radius_px: float,
) -> Solid:
    """A finger in front of everything, from beyond the frame's edge to its tip (row, column)."""
    tip, root = np.array(tip_px), np.array(root_px)
    low = np.floor(np.minimum(tip, root) - radius_px - 2).astype(int)
    high = np.ceil(np.maximum(tip, root) + radius_px + 3).astype(int)
    low = np.maximum(low, 0)  # a finger beyond the edge covers nothing
    high = np.maximum(low, np.minimum(high, [camera.height, camera.width]))
    row, column = (a.ravel() for a in np.mgrid[low[0] : high[0], low[1] : high[1]])
    at = np.stack([row, column], axis=-1) - root
    axis = tip - root
    share = np.clip(at @ axis / max(float(axis @ axis), 1e-9), 0, 1)
    off = at - share[:, None] * axis
    distance = np.linalg.norm(off, axis=-1)
    alpha = np.clip((radius_px - distance) / 3 + 0.5, 0, 1)  # near things are a little blurred
    seen = alpha > 0
    across = off[seen] / radius_px
    towards = np.sqrt(np.clip(1 - (across**2).sum(-1), 0.01, 1))
    normal = normalised(np.stack([across[:, 1], -across[:, 0], towards], axis=-1))
    return Solid(
        row[seen],
        column[seen],
        alpha[seen, None].astype(np.float32),
        normal.astype(np.float32),
        np.tile(np.array(_SKIN, np.float32), (int(seen.sum()), 1)),
    )


def _colours(thing: Thing, rig: FilmRig, points: Float[np.ndarray, "n 3"]) -> np.ndarray:
    if thing is rig.plate and rig.tag_id is not None and isinstance(thing.shape, Box):
        box = thing.shape
        own = (points - box.centre_m) @ box.box_from_camera.T / box.half_size_m
        grey = tag_reflectivity(rig.tag_id, own[:, 0], own[:, 1])
        return grey[:, None].repeat(3, axis=1)
    return np.broadcast_to(np.array(thing.colour), points.shape)


def _near_things(things: list[Thing], camera: PinholeCamera) -> tuple[np.ndarray, np.ndarray]:
    """(row, column) of all pixels near a coarse ray that meets something."""
    row, column = np.mgrid[0 : camera.height : _COARSE, 0 : camera.width : _COARSE]
    rays = _rays_at(camera, row + 1.5, column + 1.5)
    hit = first_hits(things, np.zeros((row.size, 3)), rays.reshape(-1, 3))[0] >= 0
    near = np.pad(hit.reshape(row.shape), 1)
    height, width = row.shape
    shifts = [(i, j) for i in range(3) for j in range(3)]
    near = np.any([near[i : i + height, j : j + width] for i, j in shifts], axis=0)
    fine = near.repeat(_COARSE, axis=0).repeat(_COARSE, axis=1)
    found = np.nonzero(fine[: camera.height, : camera.width])
    return found[0], found[1]


def _rays(camera: PinholeCamera, rows: slice, columns: slice) -> np.ndarray:
    row, column = np.mgrid[rows, columns]
    return _rays_at(camera, row, column)


def _rays_at(camera: PinholeCamera, row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Directions through places of the picture; whole numbers are middles of pixels."""
    half_width, half_height = camera.tangents
    x = ((column + 0.5) * (2 / camera.width) - 1) * half_width
    y = (1 - (row + 0.5) * (2 / camera.height)) * half_height
    return normalised(np.stack([x, y, np.full(x.shape, -1.0)], axis=-1))
