"""Render the three reference spheres in a photo's light: `out/examples/<photo>.<sphere>.png`.

python examples/02_relight_spheres.py [PHOTO] [OUT]
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

import deeplight

PHOTO = Path(__file__).parent / "photos" / "coffee.jpg"


def main(photo: Path = PHOTO, out: Path = Path("out/examples")) -> None:
    """Render as the camera that took the photo would have seen them, and two stops darker."""
    environment = deeplight.estimate(photo)
    out.mkdir(parents=True, exist_ok=True)
    for name, radiance in deeplight.relight_rig(deeplight.PAPER_RIG, environment).items():
        exposures = [deeplight.CameraResponse(exposure_stops=stops) for stops in (0.0, -2.0)]
        pixels = np.hstack([camera.pixel_from_radiance(radiance) for camera in exposures])
        path = out / f"{photo.stem}.{name}.png"
        large = pixels.repeat(6, axis=0).repeat(6, axis=1)
        Image.fromarray((large * 255).astype(np.uint8)).save(path)
        print(path)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
