"""A sphere of a frame as the ideal camera of section 3.1 sees it: aimed at it, tangent to it.

A crop's pixel covers about 6 x 6 pixels of the frame (a sphere is about 200 px wide). It is the
mean of 8 x 8 interpolated samples, taken in linear light, as a camera with 32 x 32 pixels would
integrate it, and encoded again.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float32, UInt8

from deeplight.camera import PinholeCamera
from deeplight.camera_response import decode, encode
from deeplight.capture.quality import shrunk
from deeplight.frames import turned
from deeplight.mappings import mirror_ball
from deeplight.preprocess import Framing, background
from deeplight.sphere import SPHERES, Rig, SphereView

SAMPLES = 8  # along a pixel of the crop

_WHOLE_PX = 1e-6  # how near an edge must be to that of a pixel

Channels = Sequence[UInt8[np.ndarray, "height width"]]

_LINEAR = decode(np.arange(256, dtype=np.float32) / np.float32(255))


@dataclass(frozen=True, eq=False)
class Reprojection:
    """Where the samples of one sphere's crop lie in the frame; made once for a clip.

    Attributes:
        view: the ideal camera.
        top, left, bottom, right: the part of the frame that the samples need.
        column, row: of each sample, in pixels of that part.
    """

    view: SphereView
    top: int
    left: int
    bottom: int
    right: int
    column: Float32[np.ndarray, "n n"]
    row: Float32[np.ndarray, "n n"]

    @classmethod
    def of(cls, view: SphereView, camera: PinholeCamera, samples: int = SAMPLES) -> "Reprojection":
        """Aim the ideal camera of `view` at its sphere in frames of `camera`.

        Samples outside the frame see its nearest edge.
        """
        u, v = mirror_ball.grid(view.size, samples)
        half = np.tan(view.angular_radius_rad)
        rays = np.stack([u * half, v * half, np.full_like(u, -1.0)], axis=-1)
        directions = turned(rays, view.ball_from_camera.T)
        row, column = camera.pixel_of_directions(directions)
        row, column = row.clip(0, camera.height - 1), column.clip(0, camera.width - 1)
        top, left = int(row.min()), int(column.min())
        bottom = min(int(row.max()) + 2, camera.height)
        right = min(int(column.max()) + 2, camera.width)
        within = (column - left).astype(np.float32), (row - top).astype(np.float32)
        return cls(view, top, left, bottom, right, *within)

    def crop(self, channels: Channels) -> UInt8[np.ndarray, "size size 3"]:
        """Cut the sphere out of a frame's red, green and blue; the corners show what is around."""
        box = np.s_[self.top : self.bottom, self.left : self.right]
        part = cv2.merge([np.ascontiguousarray(channel[box]) for channel in channels])
        samples = cv2.remap(
            cv2.LUT(part, _LINEAR),
            self.column,
            self.row,
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
        size = self.view.size
        linear = cv2.resize(samples, (size, size), interpolation=cv2.INTER_AREA)  # a plain mean
        levels: np.ndarray = np.floor(encode(linear) * np.float32(255) + np.float32(0.5))
        return levels.clip(0, 255).astype(np.uint8)


def reprojections(rig: Rig, camera: PinholeCamera) -> dict[str, Reprojection]:
    """Prepare the cut of every sphere of a rig."""
    return {name: Reprojection.of(rig.views[name], camera) for name in SPHERES}


def crops(
    channels: Channels, cuts: Mapping[str, Reprojection]
) -> dict[str, UInt8[np.ndarray, "size size 3"]]:
    """Cut every sphere out of a frame's red, green and blue."""
    return {name: cut.crop(channels) for name, cut in cuts.items()}


def background_of(
    channels: Channels, framing: Framing
) -> UInt8[np.ndarray, "input_height input_width 3"]:
    """`preprocess.background` of a frame's red, green and blue: the same but for rounding.

    Where the trained view is whole pixels of the frame, as it is of 9:16 frames with the default
    field of view, OpenCV takes the area average in a fifth of the time.
    """
    edges = np.array([framing.top, framing.bottom, framing.left, framing.right])
    top, bottom, left, right = whole = edges.round().astype(int)
    inside = min(top, left) >= 0 and bottom <= framing.photo_height and right <= framing.photo_width
    if not inside or np.abs(edges - whole).max() > _WHOLE_PX:
        return background(np.stack(channels, axis=-1), framing)
    size = framing.input_width, framing.input_height
    return np.stack([shrunk(c[top:bottom, left:right], size) for c in channels], axis=-1)
