"""The camera's tilt from the photo alone: upright edges run towards the point above our heads.

Each edge of a photo is asked how well it points along the projected vertical of a tilt; the tilt
that most edges agree on is the camera's (after Coughlan and Yuille 1999, who ask for three
directions at once). Where no tilt stands out, as in grass or a face, none is given.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, UInt8

from deeplight.area_means import mean_over_squares
from deeplight.camera import PinholeCamera
from deeplight.camera_response import LUMINANCE
from deeplight.compose.look import blurred
from deeplight.frames import world_from_camera

_SIDE = 320  # pixels along the longer side that are looked at
_EDGES = 3000  # number of the strongest
_BLUR_PX = 0.8  # more makes real edges rarer and the tilt worse
_LEAN_DEG = 35.0  # an upright edge leans by less than this in the picture
_AGREES_DEG = 1.5  # spread of an edge's direction
_PITCHES_DEG = np.arange(-60.0, 41.0, 1.0)
_ROLLS_DEG = np.arange(-8.0, 9.0, 1.0)
_EXPECTED_DEG = (-8.0, 22.0, 2.5)  # how people hold a camera: mean and spread of pitch; of roll
LEAST_EVIDENCE = 12.0
"""How far, in standard deviations of chance, the best tilt must stand out."""


@dataclass(frozen=True)
class SeenTilt:
    """A tilt that a photo's upright edges agree on.

    Attributes:
        pitch_rad, roll_rad: as in `Viewpoint`.
        evidence: by how many standard deviations more edges agree than by chance.
    """

    pitch_rad: float
    roll_rad: float
    evidence: float


def tilt_of_photo(
    photo: UInt8[np.ndarray, "height width 3"], camera: PinholeCamera
) -> SeenTilt | None:
    """The tilt that the upright edges of a photo say, or None where they say none."""
    found = best_tilt(photo, camera)
    return found if found is not None and found.evidence >= LEAST_EVIDENCE else None


def best_tilt(photo: UInt8[np.ndarray, "height width 3"], camera: PinholeCamera) -> SeenTilt | None:
    """The likeliest tilt, however weak its evidence; None without upright edges."""
    x, y, lean, weight = _upright_edges(photo, camera)
    if len(x) < 50:
        return None
    pitch, roll = (np.radians(v) for v in (_PITCHES_DEG, _ROLLS_DEG))
    ups = np.array([[world_from_camera(0.0, p, r)[1] for r in roll] for p in pitch])
    scores = np.array([_agreement(ups_of_pitch, x, y, lean, weight) for ups_of_pitch in ups])
    chance = np.sqrt((weight**2).sum() * _AGREES_DEG / _LEAN_DEG)
    mean, spread, of_roll = _EXPECTED_DEG
    prior = -0.5 * (
        ((_PITCHES_DEG[:, None] - mean) / spread) ** 2 + (_ROLLS_DEG[None] / of_roll) ** 2
    )
    total = scores / chance + prior
    at = np.unravel_index(total.argmax(), total.shape)
    evidence = float((scores[at] - np.median(scores)) / chance)
    return SeenTilt(float(pitch[at[0]]), float(roll[at[1]]), evidence)


def _agreement(
    ups: Float[np.ndarray, "rolls 3"],
    x: Float32[np.ndarray, " edges"],
    y: Float32[np.ndarray, " edges"],
    lean: Float32[np.ndarray, " edges"],
    weight: Float32[np.ndarray, " edges"],
) -> Float[np.ndarray, " rolls"]:
    """Sum of the weights of edges that run along the vertical, for each up vector."""
    right, up, back = ups.astype(np.float32).T[:, :, None]
    # Seen at (x, y) on the plane before the camera, a step along the vertical moves by this.
    wanted = np.degrees(np.arctan2(right + x * back, up + y * back))
    off = (wanted - lean + 90) % 180 - 90
    result: np.ndarray = np.exp(-0.5 * (off / _AGREES_DEG) ** 2) @ weight
    return result


def _upright_edges(
    photo: UInt8[np.ndarray, "height width 3"], camera: PinholeCamera
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Place on the plane at distance 1, lean in degrees and weight of the edges that stand."""
    small = _small(photo)
    height, width = small.shape
    down, right = np.gradient(blurred(small[..., None], _BLUR_PX)[..., 0])
    steep = np.hypot(down, right)
    steep[[0, 1, -1, -2]] = 0
    steep[:, [0, 1, -1, -2]] = 0
    # The edge runs across its gradient; up in the picture is minus the rows.
    lean = np.degrees(np.arctan(down / np.where(right == 0, 1e-9, right)))
    steep = np.where(np.abs(lean) < _LEAN_DEG, steep, 0)
    count = min(_EDGES, int((steep > 0.02).sum()))
    rows, columns = np.unravel_index(np.argsort(-steep, axis=None)[:count], steep.shape)
    half_width, half_height = camera.tangents
    x = ((columns + 0.5) * 2 / width - 1) * half_width
    y = (1 - (rows + 0.5) * 2 / height) * half_height
    weight = np.sqrt(steep[rows, columns])  # a bright lamp's edge is no better than a door's
    found = x, y, lean[rows, columns], weight / max(float(weight.mean()), 1e-9) if count else weight
    a, b, c, d = (part.astype(np.float32) for part in found)
    return a, b, c, d


def _small(photo: UInt8[np.ndarray, "height width 3"]) -> Float32[np.ndarray, "rows columns"]:
    """Luminance of the pixel values, averaged to at most `_SIDE` pixels."""
    factor = max(max(photo.shape[:2]) / _SIDE, 1.0)
    return mean_over_squares(photo, factor) @ LUMINANCE.astype(np.float32)
