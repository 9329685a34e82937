"""Render the three reference spheres in a photo's light: `out/examples/<photo>.<sphere>.png`.

python examples/02_relight_spheres.py [PHOTO] [OUT]
"""

import sys
from pathlib import Path

import numpy as np

import deeplight
from deeplight.camera_response import CameraResponse
from deeplight.io.photos import write_png
from deeplight.relight import relight_rig
from deeplight.sphere import PAPER_RIG

PHOTO = Path(__file__).parent / "photos" / "coffee.jpg"


def main(photo: Path = PHOTO, out: Path = Path("out/examples")) -> None:
    """Render as the camera that took the photo would have seen them, and two stops darker."""
    lighting = deeplight.estimate(photo)
    for name, radiance in relight_rig(PAPER_RIG, lighting).items():
        exposures = [CameraResponse(exposure_stops=stops) for stops in (0.0, -2.0)]
        pixels = np.hstack([camera.pixel_from_radiance(radiance) for camera in exposures])
        path = out / f"{photo.stem}.{name}.png"
        write_png(path, (pixels.repeat(6, axis=0).repeat(6, axis=1) * 255).astype(np.uint8))
        print(path)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
