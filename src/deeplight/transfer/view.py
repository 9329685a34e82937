"""A picture of an object shaded by its transfer, by one ray through each pixel: for checks."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from deeplight import frames
from deeplight.transfer.mesh import TransferSurface
from deeplight.transfer.precompute import Transfer
from deeplight.transfer.rays import Blockers


@dataclass(frozen=True)
class Eye:
    """A camera in the object's frame that looks at a point.

    Attributes:
        place, target: positions.
        fov_rad: vertical field of view.
        height, width: of the picture.
    """

    place: tuple[float, float, float]
    target: tuple[float, float, float]
    fov_rad: float
    height: int
    width: int

    @property
    def directions(self) -> Float[np.ndarray, "pixels 3"]:
        """Unit directions through the pixels' centres, row after row."""
        half = np.tan(self.fov_rad / 2)
        x = (2 * (np.arange(self.width) + 0.5) / self.width - 1) * half * self.width / self.height
        y = (1 - 2 * (np.arange(self.height) + 0.5) / self.height) * half
        right, up = (grid.ravel() for grid in np.meshgrid(x, y))
        seen = frames.normalised(np.stack([right, up, -np.ones_like(right)], -1))
        eye_from_world = frames.looking_at(np.subtract(self.target, self.place))
        return frames.turned(seen, eye_from_world.T)


@dataclass(frozen=True, eq=False)
class RenderedView:
    """What an eye sees.

    Attributes:
        radiance: of the object; 0 where it is not.
        cover: whether the pixel's centre shows the object.
        shadow: light on the ground over that without the object; 1 off the ground's map.
    """

    radiance: Float[np.ndarray, "height width 3"]
    cover: Bool[np.ndarray, "height width"]
    shadow: Float[np.ndarray, "height width 3"]


def view(
    transfer: Transfer, light: Float[np.ndarray, "given 3"], finish: str, eye: Eye
) -> RenderedView:
    """Shade the vertices in `light`, in the object's frame, and look at them.

    Args:
        transfer: of the object.
        light: harmonics of radiance.
        finish: "diffuse" or "glossy".
        eye: from where.
    """
    place = np.array(eye.place)
    if finish == "diffuse":
        values = transfer.diffuse_radiance(light)
    else:
        values = transfer.glossy_radiance(light, frames.normalised(place - transfer.vertices))
    surface = TransferSurface(
        transfer.vertices, transfer.normals, transfer.triangles, np.zeros_like(transfer.vertices)
    )
    directions = eye.directions
    triangle, u, v = Blockers(surface).met(np.tile(place, (len(directions), 1)), directions)
    cover = triangle >= 0
    corners = values[transfer.triangles[triangle[cover]]]
    shares = np.stack([1 - u - v, u, v], -1)[cover]
    radiance = np.zeros_like(directions)
    radiance[cover] = (shares[..., None] * corners).sum(1)
    shadow = np.ones_like(directions)
    ground = ~cover & (directions[:, 1] < 0)
    if transfer.shadowed is not None:
        at = place - directions[ground] * (place[1] / directions[ground, 1:2])
        shadow[ground] = _looked_up(transfer, light, at)
    shape = eye.height, eye.width, 3
    return RenderedView(radiance.reshape(shape), cover.reshape(shape[:2]), shadow.reshape(shape))


def _looked_up(transfer: Transfer, light: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The shadow at positions on the ground, bilinear between its points."""
    assert transfer.shadowed is not None  # the caller has asked
    ground, values = transfer.shadowed.ground, transfer.shadow(light)
    along = np.arange(ground.size)
    column, row = (np.interp(at[:, axis], ground.coordinates, along) for axis in (0, 2))
    left, top = (np.minimum(part.astype(int), ground.size - 2) for part in (column, row))
    right, down = (column - left)[:, None], (row - top)[:, None]
    above = values[top, left] * (1 - right) + values[top, left + 1] * right
    below = values[top + 1, left] * (1 - right) + values[top + 1, left + 1] * right
    off = np.abs(at[:, [0, 2]]).max(1) > ground.half
    result: np.ndarray = np.where(off[:, None], 1.0, above * (1 - down) + below * down)
    return result
