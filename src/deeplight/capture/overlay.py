"""Pictures that show what was found, or why nothing was."""

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from deeplight.camera import PinholeCamera
from deeplight.capture.conic import Cone, ellipse

Picture = UInt8[np.ndarray, "height width 3"]

COLOURS = {"mirror": (0, 220, 255), "matte_silver": (255, 210, 0), "diffuse": (255, 80, 220)}
_GREY = (190, 190, 190)
_HEIGHT = 960  # of the picture, at most
_FONT = cv2.FONT_HERSHEY_SIMPLEX


def found_picture(
    frame: Picture, cones: dict[str, Cone], labels: dict[str, str], camera: PinholeCamera
) -> Picture:
    """A frame with the outline and the label of each named sphere."""
    picture, small = _fitted(frame, camera)
    for name, cone in cones.items():
        _outline(picture, cone, small, COLOURS[name])
        oval = ellipse(small, cone)
        _text(picture, labels[name], oval.x - oval.minor, oval.y - oval.minor - 8, COLOURS[name])
    return picture


def failed_picture(
    frame: Picture,
    strength: Float[np.ndarray, "h w"] | None,
    candidates: list[Cone],
    camera: PinholeCamera,
    reason: str,
) -> UInt8[np.ndarray, "shown_height shown_width 3"]:
    """A frame and its steady edges side by side, with the circles that were thought of."""
    picture, small = _fitted(frame, camera)
    panels = [picture]
    if strength is not None:
        edges = (np.clip(strength, 0, 1) * 255).astype(np.uint8)
        grey = cv2.resize(edges, (small.width, small.height))
        panels.append(np.repeat(grey[..., None], 3, axis=2))
    for panel in panels:
        for i, cone in enumerate(candidates):
            _outline(panel, cone, small, (255, 90, 60) if i < 3 else _GREY)
    both = np.concatenate(panels, axis=1)
    _text(both, reason, 8, 24, (255, 255, 255))
    return both


def _fitted(frame: Picture, camera: PinholeCamera) -> tuple[Picture, PinholeCamera]:
    """The frame at a size to look at, and the camera of that size."""
    scale = min(1.0, _HEIGHT / camera.height)
    size = (max(1, round(camera.width * scale)), max(1, round(camera.height * scale)))
    picture = cv2.resize(frame, size, interpolation=cv2.INTER_AREA)
    return picture, PinholeCamera(*size, camera.vertical_fov_rad)


def _outline(
    picture: Picture, cone: Cone, camera: PinholeCamera, colour: tuple[int, int, int]
) -> None:
    oval = ellipse(camera, cone)
    if np.isfinite(oval.major):
        box = ((oval.x, oval.y), (2 * oval.major, 2 * oval.minor), oval.angle_deg)
        cv2.ellipse(picture, box, colour, 1, cv2.LINE_AA)


def _text(picture: Picture, text: str, x: float, y: float, colour: tuple[int, int, int]) -> None:
    """Text on a dark ground, moved and shrunk until it lies inside the picture."""
    height, width = picture.shape[:2]
    size = 0.5
    (length, tall), _ = cv2.getTextSize(text, _FONT, size, 1)
    size *= min(1.0, (width - 8) / max(length, 1))
    (length, tall), below = cv2.getTextSize(text, _FONT, size, 1)
    at = (round(min(max(x, 4), width - length - 4)), round(min(max(y, tall + 4), height - 4)))
    ground = picture[
        max(at[1] - tall - 3, 0) : at[1] + below, max(at[0] - 3, 0) : at[0] + length + 3
    ]
    ground //= 3
    cv2.putText(picture, text, at, _FONT, size, colour, 1, cv2.LINE_AA)
