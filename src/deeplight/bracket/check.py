"""Pictures of a measurement to check by eye."""

from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8
from PIL import Image, ImageDraw

from deeplight.bracket.probe import Probe
from deeplight.camera_response import encode
from deeplight.io.photos import write_png

_OUTLINE = (255, 64, 64)


def write_check(probe: Probe, folder: Path) -> Path:
    """Write merged.png, with the ball's outline, and environment.png, unseen parts hatched.

    Raises:
        OSError: the folder cannot be written.
    """
    merged = Image.fromarray(_shown(probe.picture))
    if probe.ball is not None:
        x, y, radius = probe.ball.x, probe.ball.y, probe.ball.radius
        box = (x - radius, y - radius, x + radius, y + radius)
        ImageDraw.Draw(merged).ellipse(box, outline=_OUTLINE, width=2)
    write_png(folder / "merged.png", np.asarray(merged))
    panorama = _shown(probe.environment.radiance)
    if probe.environment.seen is not None:
        rows, columns = np.indices(panorama.shape[:2])
        hatched = (probe.environment.seen < 0.5) & ((rows + columns) % 8 < 2)
        panorama[hatched] = _OUTLINE
    write_png(folder / "environment.png", panorama)
    return folder / "merged.png"


def _shown(radiance: Float[np.ndarray, "height width 3"]) -> UInt8[np.ndarray, "height width 3"]:
    """Exposed so that the 90th percentile is bright."""
    level = max(float(np.percentile(radiance, 90)), 1e-9)
    pixels: np.ndarray = encode(np.clip(radiance / level * 0.8, 0, 1)) * 255
    return pixels.round().astype(np.uint8)
