"""Small made-up clips for tests of capture: a sliding texture behind three still discs."""

from collections.abc import Iterable
from pathlib import Path

import cv2
import numpy as np

from deeplight.camera import PinholeCamera
from deeplight.capture.conic import Cone, Ellipse, ellipse
from deeplight.capture.located import Located, LocateSettings, cones_of
from deeplight.io.video import VideoFrame
from deeplight.io.video_writer import VideoWriter
from deeplight.sphere import PAPER_RIG, SPHERES

WIDTH, HEIGHT = 180, 320
GREYS = {"mirror": 220, "matte_silver": 150, "diffuse": 90}


def picture(shift_px: int, blur_px: int = 0, gain: float = 1.0) -> np.ndarray:
    """A frame whose world has moved by `shift_px`."""
    noise = np.random.default_rng(5).integers(20, 235, (HEIGHT // 4, WIDTH // 4 + 200, 3), np.uint8)
    world = cv2.resize(noise[:, shift_px : shift_px + WIDTH // 4], (WIDTH, HEIGHT))
    if blur_px:
        world = cv2.blur(world, (blur_px, blur_px))
    frame = np.clip(world * gain, 0, 255).astype(np.uint8)
    camera = PinholeCamera(WIDTH, HEIGHT, np.radians(66.0))
    for name, cone in cones_of(PAPER_RIG).items():
        oval = ellipse(camera, cone)
        box = ((oval.x, oval.y), (2 * oval.major, 2 * oval.minor), oval.angle_deg)
        cv2.ellipse(frame, box, (GREYS[name],) * 3, -1)
    return frame


def write_clip(
    path: Path,
    frames: Iterable[np.ndarray] | None = None,
    rotation_deg: int = 0,
    stretch: float = 1.0,
) -> Path:
    """Write pictures as a clip of 30 frames a second; left out, ten of a sliding world.

    Each pause between frames is `stretch` times as long as the one before.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    if frames is None:
        frames = [picture(4 * n) for n in range(10)]
    time_s, pause_s = 0.0, 1 / 30
    with VideoWriter(path, WIDTH, HEIGHT, 30, rotation_deg=rotation_deg) as video:
        for frame in frames:
            video.write(frame, time_s)
            time_s, pause_s = time_s + pause_s, pause_s * stretch
    return path


def paper_located(
    stills: Iterable[VideoFrame], camera: PinholeCamera, how: LocateSettings | None = None
) -> Located:
    """Stands in for `locate`: reads the clip and answers with the rig that was drawn."""
    first = [still.rgb() for still in stills if still.number == 0]
    cones: dict[str, Cone] = cones_of(PAPER_RIG)
    ovals: dict[str, Ellipse] = {name: ellipse(camera, cone) for name, cone in cones.items()}
    sure = dict.fromkeys(SPHERES, 1.0)
    return Located(PAPER_RIG, dict.fromkeys(SPHERES, 0.6), sure, ovals, (), "flow", first[0])
