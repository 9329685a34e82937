"""A hand that carries a phone: where the camera is and looks, at any moment of a clip.

All numbers are our choice: a walk of 0.3 to 0.9 m/s with a bob at two steps a second, a slow
sway, and physiological tremor at 8 to 12 Hz.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from deeplight.frames import Rotation, world_from_camera

_SWAY_HZ, _STEP_HZ, _TREMOR_HZ = (0.15, 0.7), (1.7, 2.1), (8.0, 12.0)
# Deviation of yaw, pitch, roll (rad) and of right, up, back (m) in each of these bands.
_SWAY = (0.05, 0.035, 0.025, 0.03, 0.01, 0.03)
_STEP = (0.004, 0.006, 0.004, 0.012, 0.018, 0.006)
_TREMOR = (0.0010, 0.0010, 0.0008, 0.0003, 0.0003, 0.0003)
_PITCH_LOW, _PITCH_HIGH = -0.6, 0.35  # the middle of the picture; its foot looks 33 degrees lower


@dataclass(frozen=True, eq=False)
class Hand:
    """One clip's movement, as a straight walk and a steady turn under a sum of swings.

    Attributes:
        angles_rad: yaw, pitch and roll half-way through the clip.
        turn_rad: yaw and pitch a second.
        velocity_m: metres a second, world frame.
        middle_s: when the walk passes the panorama's own place.
        swings: (band, 6): amplitude, turns a second and phase of yaw, pitch, roll, x, y, z.
    """

    angles_rad: tuple[float, float, float]
    turn_rad: tuple[float, float]
    velocity_m: Float[np.ndarray, "3"]
    middle_s: float
    amplitude: Float[np.ndarray, "bands 6"]
    frequency_hz: Float[np.ndarray, "bands 6"]
    phase_rad: Float[np.ndarray, "bands 6"]

    def at(self, time_s: float) -> tuple[Rotation, Float[np.ndarray, "3"]]:
        """world_from_camera and the camera's place in metres from the panorama's."""
        swing = self.amplitude * np.sin(2 * np.pi * self.frequency_hz * time_s + self.phase_rad)
        yaw, pitch, roll, right, up, back = swing.sum(axis=0)
        since = time_s - self.middle_s
        yaw += self.angles_rad[0] + self.turn_rad[0] * since
        pitch += self.angles_rad[1] + self.turn_rad[1] * since
        pose = world_from_camera(
            yaw, float(np.clip(pitch, _PITCH_LOW, _PITCH_HIGH)), self.angles_rad[2] + roll
        )
        sway = world_from_camera(self.angles_rad[0]) @ np.array([right, up, back])
        return pose, self.velocity_m * since + sway


def draw_hand(
    seconds: float, reach_m: float, speed: float, rng: np.random.Generator, sideways: bool = False
) -> Hand:
    """The movement of one clip.

    Args:
        seconds: of the clip.
        reach_m: how far from the panorama's place the walk may lead.
        speed: 1 for a calm hand; 0 hardly moves; 3 is hectic.
        rng: decides everything.
        sideways: the phone is held in landscape.
    """
    yaw = rng.uniform(0, 2 * np.pi)
    roll = rng.normal(0, 0.03) + (np.pi / 2 if sideways else 0.0)
    pitch = float(np.clip(rng.normal(-0.15, 0.15), -0.4, 0.2))
    walk = min(rng.uniform(0.3, 0.9) * min(speed, 1.5), 2 * reach_m / seconds)
    heading = yaw + rng.normal(0, 0.6)
    # A turn of a clip's whole length stays within what one chart of the world shows.
    turn = rng.choice([-1, 1]) * min(rng.uniform(0.08, 0.35) * speed, 1.4 / seconds)
    bands = [_SWAY_HZ, _SWAY_HZ, _STEP_HZ, *[_TREMOR_HZ] * 3]
    deviations = [_SWAY, np.array(_SWAY) / 2, _STEP, *[_TREMOR] * 3]
    least = 0.02  # a phone on a tripod still feels the floor
    return Hand(
        angles_rad=(yaw, pitch, roll),
        turn_rad=(float(turn), rng.normal(0, 0.05) * speed),
        velocity_m=walk * np.array([-np.sin(heading), 0.0, -np.cos(heading)]),
        middle_s=seconds / 2,
        amplitude=np.array(deviations) * rng.normal(0, 1, (len(bands), 6)) * max(speed, least),
        frequency_hz=np.array([rng.uniform(*band, 6) for band in bands]),
        phase_rad=rng.uniform(0, 2 * np.pi, (len(bands), 6)),
    )
