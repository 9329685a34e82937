"""Rotations of frames from a pose file: what ARKit, ARCore, WebXR and DeepLight itself write.

    {"convention": "arkit", "frames": [{"time_s": 0.0, "matrix": [16 numbers]}, ...]}

Each frame has one of `rotation` (three rows of three), `matrix` (16 numbers, column after column,
as simd_float4x4, Pose.toMatrix and XRRigidTransform.matrix give them) or `quaternion` (x, y, z, w),
all of them maps from the camera to a world whose +Y is up. Frames are those of the clip in order,
or say which they are by `frame` (from 0) or `time_s`.

`convention` says which way the camera's axes point:

| convention | camera axes | is given |
|---|---|---|
| deeplight | +X right, +Y up, -Z the view, of the upright picture | world_from_camera |
| webxr | the same: `XRView.transform` follows the display | view.transform |
| arcore | +X right, +Y up in the sensor's own readout | `Camera.getPose()` |
| arcore-display | the same as webxr | `Camera.getDisplayOrientedPose()` |
| arkit | +X from the front camera to the home button, +Z out of the screen | `ARCamera.transform` |

Where the axes are the sensor's, the picture was turned clockwise by `turned_deg` to stand upright:
90 for a phone held upright, 0 for one lying with the home button on the right. Left out, it is 90
for an upright picture and 0 for a lying one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from deeplight.errors import ConfigError
from deeplight.frames import Rotation, exponential, from_quaternion, rotation
from deeplight.io.boundary import reads_as
from deeplight.io.json_text import parse_json

CONVENTIONS: Mapping[str, bool] = {
    "deeplight": False,
    "webxr": False,
    "arcore": True,
    "arcore-display": False,
    "arkit": True,
}
"""Convention -> whether its axes are the sensor's, whatever way the phone is held."""

_DO = "see deeplight/fuse/poses.py or docs/fuse.md for the format"


@dataclass(frozen=True, eq=False)
class Poses:
    """The rotations that a file holds.

    Attributes:
        rotations: world_from_camera of the upright picture.
        numbers: frame of each, or None.
        times_s: time of each, or None.
    """

    rotations: Float[np.ndarray, "poses 3 3"]
    numbers: list[int] | None
    times_s: Float[np.ndarray, " poses"] | None

    def unused(self, frames: int) -> tuple[str, ...]:
        """What to know of poses that are taken in order, if there are more than frames."""
        if self.numbers is not None or self.times_s is not None or len(self.rotations) <= frames:
            return ()
        poses = len(self.rotations)
        return (
            f"{poses} poses for {frames} frames, the first taken in order: say frame or time_s",
        )

    def at(self, number: int, time_s: float) -> Rotation | None:
        """The rotation of a frame, None where it has none; times between are interpolated."""
        if self.numbers is not None:
            found = [k for k, own in enumerate(self.numbers) if own == number]
            return self.rotations[found[0]] if found else None
        if self.times_s is None:
            return self.rotations[number] if number < len(self.rotations) else None
        after = int(np.searchsorted(self.times_s, time_s - 1e-6))
        if after >= len(self.times_s) or (after == 0 and self.times_s[0] > time_s + 0.02):
            late = time_s - float(self.times_s[-1])
            return self.rotations[-1] if 0 <= late < 0.02 else None
        if after == 0 or self.times_s[after] - time_s < 1e-6:
            return self.rotations[after]
        before = self.times_s[after - 1]
        part = (time_s - before) / (self.times_s[after] - before)
        return between(self.rotations[after - 1], self.rotations[after], float(part))


@reads_as(ConfigError)
def read_poses(path: Path, upright: bool) -> Poses:
    """Read a pose file.

    Args:
        path: JSON; see the top of this file.
        upright: whether the pictures are taller than wide.

    Raises:
        OSError: the file cannot be read.
        ConfigError: it is no pose file, or a pose is no rotation.
    """
    try:
        content = parse_json(path.read_bytes(), finite=False)
    except (ValueError, RecursionError) as error:
        raise ConfigError("a pose file in JSON", f"{path}: {error}", _DO) from error
    if isinstance(content, list):
        content = {"frames": content}
    frames = content.get("frames") if isinstance(content, dict) else None
    if not isinstance(frames, list) or not all(isinstance(f, dict) for f in frames) or not frames:
        raise ConfigError("a list of frames in a pose file", f"{path} without it", _DO)
    convention = content.get("convention", "deeplight")
    if convention not in CONVENTIONS:
        got = f"{convention!r} in {path}"
        raise ConfigError(f"a convention of {', '.join(CONVENTIONS)}", got, _DO)
    turned = content.get("turned_deg", 90 if upright else 0)
    if turned not in (0, 90, 180, 270):
        raise ConfigError("turned_deg of 0, 90, 180 or 270", f"{turned!r} in {path}", _DO)
    camera_from_upright = rotation("z", np.radians(turned if CONVENTIONS[convention] else 0))
    rotations = [_rotation(f, k, path) @ camera_from_upright for k, f in enumerate(frames)]
    return Poses(np.stack(rotations), *_placed(frames, path))


def _placed(
    frames: Sequence[Mapping[str, Any]], path: Path
) -> tuple[list[int] | None, Float[np.ndarray, " n"] | None]:
    try:
        if all("frame" in f for f in frames):
            numbers = [float(f["frame"]) for f in frames]
            if len(set(numbers)) == len(numbers) and all(n >= 0 and n % 1 == 0 for n in numbers):
                return [int(number) for number in numbers], None
            raise ConfigError("a whole number from 0 as frame, each once", f"others in {path}", _DO)
        if all("time_s" in f for f in frames):
            times = np.array([float(f["time_s"]) for f in frames])
            if np.isfinite(times).all() and (np.diff(times) > 0).all():
                return None, times
            raise ConfigError("times that grow", f"others in {path}", _DO)
    except (TypeError, ValueError) as error:
        raise ConfigError("numbers as frame or time_s", f"{path}: {error}", _DO) from error
    if any("frame" in f or "time_s" in f for f in frames):
        raise ConfigError("frame or time_s in all poses, or in none", f"some of {path}", _DO)
    return None, None


def _rotation(frame: Mapping[str, Any], number: int, path: Path) -> Rotation:
    try:
        if "quaternion" in frame:
            return from_quaternion(np.array(frame["quaternion"], float).reshape(4))
        if "matrix" in frame:
            matrix = np.array(frame["matrix"], float).reshape(4, 4).T[:3, :3]
        else:
            matrix = np.array(frame["rotation"], float).reshape(3, 3)
    except (KeyError, TypeError, ValueError) as error:
        expected = "a rotation (3 x 3), matrix (16 numbers) or quaternion (x, y, z, w)"
        raise ConfigError(expected, f"frame {number} of {path}", _DO) from error
    close = np.isfinite(matrix).all() and np.allclose(matrix @ matrix.T, np.eye(3), atol=1e-2)
    if not close or np.linalg.det(matrix) < 0:
        got = f"frame {number} of {path}, which is none"
        raise ConfigError("a rotation without mirroring or scale", got, _DO)
    return nearest_rotation(matrix)


def nearest_rotation(matrix: Float[np.ndarray, "3 3"]) -> Rotation:
    """The rotation nearest to a matrix (least squares)."""
    u, _, v = np.linalg.svd(matrix)
    sign = np.diag([1.0, 1.0, np.linalg.det(u @ v)])
    result: np.ndarray = u @ sign @ v
    return result


def logarithm(matrix: Rotation) -> Float[np.ndarray, "3"]:
    """The vector whose `exponential` is this rotation; not for half turns."""
    angle = angle_between(np.eye(3), matrix)
    axis = np.array(
        [matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]
    )
    return axis * (0.5 if angle < 1e-6 else angle / (2 * np.sin(angle)))


def angle_between(one: Rotation, other: Rotation) -> float:
    """The angle between two rotations, radians."""
    return float(np.arccos(np.clip((np.sum(one * other) - 1) / 2, -1, 1)))


def between(one: Rotation, other: Rotation, part: float) -> Rotation:
    """The rotation a part of the way from one to another."""
    result: np.ndarray = one @ exponential(part * logarithm(one.T @ other))
    return result
