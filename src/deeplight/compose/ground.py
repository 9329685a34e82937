"""The camera above the plane that stands for the real surface.

World frame of this folder: +Y is up, the plane is y = 0, the camera stands at (0, height, 0) and
its view, but for pitch, is along -Z. Metres; only ratios of lengths change the picture.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from deeplight.camera import PinholeCamera
from deeplight.errors import ConfigError
from deeplight.frames import Rotation, turned, world_from_camera

DEFAULT_HEIGHT_M = 1.4  # a phone in the hand of somebody who stands
DEFAULT_PITCH_RAD = float(np.radians(-15.0))  # a surface in the lower half of the picture
SURE_DOUBTS = 1.2
"""What is farther below the horizon than this many times the pitch's doubt is taken to be below it
(chosen on validation places: `lab/evidence/floor_accuracy.py`)."""
FARTHEST_HEIGHTS = 60.0  # a place farther away than this many camera heights is the horizon


@dataclass(frozen=True)
class Viewpoint:
    """Where the photo was taken from.

    Attributes:
        camera: of the upright photo.
        height_m: of the camera above the plane.
        pitch_rad: positive looks up.
        roll_rad: positive turns the camera counter-clockwise as its holder sees it.
        yaw_rad: positive turns the view to the left; 0 but in videos.
        doubt_rad: two of three such pitches are less off; 0 where the pitch is known.
    """

    camera: PinholeCamera
    height_m: float = DEFAULT_HEIGHT_M
    pitch_rad: float = DEFAULT_PITCH_RAD
    roll_rad: float = 0.0
    yaw_rad: float = 0.0
    doubt_rad: float = 0.0

    def __post_init__(self) -> None:
        if not 0 < self.height_m < 1e4:
            raise ConfigError("a camera height in metres above 0", f"{self.height_m}", "correct it")
        if not max(abs(self.pitch_rad), abs(self.roll_rad)) < np.pi / 2:
            got = f"{np.degrees(self.pitch_rad):g} and {np.degrees(self.roll_rad):g}"
            raise ConfigError("pitch and roll within 90 degrees", got, "correct them")

    @property
    def world_from_camera(self) -> Rotation:
        """The camera's pose; its place is (0, height, 0)."""
        return world_from_camera(self.yaw_rad, self.pitch_rad, self.roll_rad)

    @property
    def horizon_row(self) -> float:
        """Row of the photo, in pixels, where the horizon crosses its middle column."""
        _, half_height = self.camera.tangents
        up = self.world_from_camera[1]  # the world's up in the camera's axes
        above_axis = float(up[2] / up[1]) / half_height
        return (1 - above_axis) / 2 * self.camera.height

    def ray(self, x: float, y: float) -> Float[np.ndarray, "3"]:
        """Unit direction, world frame, through place (x, y) of the photo; (0, 0) is its corner."""
        half_width, half_height = self.camera.tangents
        across = (2 * x / self.camera.width - 1) * half_width
        up = (1 - 2 * y / self.camera.height) * half_height
        ray: np.ndarray = self.world_from_camera @ np.array([across, up, -1.0])
        return ray / np.linalg.norm(ray)

    def depression(self, x: float, y: float) -> float:
        """Angle in radians of a pixel below the horizon."""
        return float(-np.arcsin(np.clip(self.ray(x, y)[1], -1, 1)))

    def may_be_above(self, x: float, y: float) -> bool:
        """Whether a pixel may well be above the true horizon, for all that is known of pitch."""
        return self.depression(x, y) < SURE_DOUBTS * self.doubt_rad

    def point(self, x: float, y: float) -> Float[np.ndarray, "3"]:
        """The point of the plane seen at (x, y).

        Raises:
            ConfigError: it is outside the photo, or on or above the horizon.
        """
        width, height = self.camera.width, self.camera.height
        if not (0 <= x <= width and 0 <= y <= height):
            got = f"({x:g}, {y:g}) in a photo of {width} x {height}"
            raise ConfigError("a place inside the photo", got, "give another --at")
        ray = self.ray(x, y)
        if -ray[1] * FARTHEST_HEIGHTS < 1:
            pitch = f"a camera pitched {np.degrees(self.pitch_rad):.0f} degrees"
            row = f"which lies at row {self.horizon_row:.0f} there"
            got = f"({x:g}, {y:g}), on or above the horizon of {pitch}, {row}"
            raise ConfigError("a place on the ground", got, "give a lower --at or a lower --pitch")
        return np.array([0, self.height_m, 0]) - ray * (self.height_m / ray[1])

    def pixels(self, points: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 2"]:
        """(x, y) in the photo of points in front of the camera; nan behind it."""
        seen = turned(points - [0, self.height_m, 0], self.world_from_camera.T)
        seen = np.where(seen[:, 2:] < -1e-6, seen, np.nan)
        row, column = self.camera.pixel_of_directions(seen)
        return np.stack([column + 0.5, row + 0.5], axis=-1)


def viewpoint_turned(viewpoint: Viewpoint, world_from_camera: Rotation) -> Viewpoint:
    """The camera at its place, turned so: `Viewpoint.world_from_camera` inverted.

    Raises:
        ConfigError: that camera would lie on its side or upside down.
    """
    turn = world_from_camera
    return replace(
        viewpoint,
        yaw_rad=float(np.arctan2(turn[0, 2], turn[2, 2])),
        pitch_rad=float(-np.arcsin(np.clip(turn[1, 2], -1, 1))),
        roll_rad=float(np.arctan2(turn[1, 0], turn[1, 1])),
    )
