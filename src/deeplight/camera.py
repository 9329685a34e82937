"""The phone's camera: a pinhole looking along -Z, its picture centred on the view axis."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from deeplight.errors import ShapeError
from deeplight.frames import normalised

# The paper's camera (section 3.1): portrait 1080 x 1920 that sees about 6 % of the sphere.
# 66 degrees is our choice of vertical field of view: it gives 40 horizontally and 6 %.
TRAINED_VERTICAL_FOV_RAD = float(np.radians(66.0))
FRAME_HEIGHT, FRAME_WIDTH = 1920, 1080
BACKGROUND_FRACTION = 0.8  # the lower 20 % holds the spheres and is cut, at inference too
BACKGROUND_HEIGHT, BACKGROUND_WIDTH = 192, 135  # the network's input
# Section 4.3: the comparison network sees the middle 1080 x 810 of the 1080 x 1536 background.
LANDSCAPE_HEIGHT, LANDSCAPE_WIDTH = 144, 192
LANDSCAPE_FRAME_ROWS = 810


@dataclass(frozen=True)
class PinholeCamera:
    """A camera without lens distortion.

    Attributes:
        width, height: picture size in pixels.
        vertical_fov_rad: angle between the middle of the top and of the bottom edge.
    """

    width: int
    height: int
    vertical_fov_rad: float

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1 or not 0 < self.vertical_fov_rad < np.pi:
            raise ShapeError(
                "a picture of at least 1 x 1 and a field of view between 0 and 180 degrees",
                f"{self.width} x {self.height}, {np.degrees(self.vertical_fov_rad):.1f} degrees",
                "give the vertical field of view of the upright picture",
            )

    @property
    def tangents(self) -> tuple[float, float]:
        """Half width and half height of the picture on the plane at distance 1."""
        half_height = float(np.tan(self.vertical_fov_rad / 2))
        return half_height * self.width / self.height, half_height

    @property
    def horizontal_fov_rad(self) -> float:
        """Angle between the middle of the left and of the right edge."""
        return float(2 * np.arctan(self.tangents[0]))

    @property
    def share_of_sphere(self) -> float:
        """Part of all directions that the picture shows, 0 to 1 (the paper says 6 %)."""
        x, y = self.tangents
        return float(np.arctan2(x * y, np.sqrt(1 + x * x + y * y)) / np.pi)

    def rays(self, rows: int | None = None) -> Float[np.ndarray, "rows width 3"]:
        """Unit direction through each pixel centre, camera frame, of the first `rows` rows."""
        half_width, half_height = self.tangents
        x = ((np.arange(self.width) + 0.5) * (2 / self.width) - 1) * half_width
        y = (1 - (np.arange(rows or self.height) + 0.5) * (2 / self.height)) * half_height
        plane = np.stack([*np.meshgrid(x, y), np.full((len(y), len(x)), -1.0)], axis=-1)
        return normalised(plane)

    def pixel_of_directions(
        self, directions: Float[np.ndarray, "*n 3"]
    ) -> tuple[Float[np.ndarray, "*n"], Float[np.ndarray, "*n"]]:
        """(row, column) of directions in front of the camera; 0.0 is the first pixel's centre."""
        half_width, half_height = self.tangents
        depth = -directions[..., 2]
        column = (directions[..., 0] / depth / half_width + 1) * (self.width / 2) - 0.5
        row = (1 - directions[..., 1] / depth / half_height) * (self.height / 2) - 0.5
        return row, column


TRAINED_CAMERA = PinholeCamera(FRAME_WIDTH, FRAME_HEIGHT, TRAINED_VERTICAL_FOV_RAD)
