"""Film two turns of a phone in a place, fuse them, and draw docs/pictures/fuse.jpg of that.

python docs/pictures/make_fuse.py HDRI_FOLDER

The folder needs outdoor_umbrellas.exr. The frames do not say where they look.
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from deeplight.estimators.open import open_model
from deeplight.fuse.frame import SourceFrame
from deeplight.fuse.fuse import FuseSettings, fuse_frames
from deeplight.fuse.results import preview
from deeplight.simulate.panorama import load, places_in

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))
from lab.pans import Sweep, Troubles, film_pan  # noqa: E402

OUT = Path(__file__).parent / "fuse.jpg"
PLACE = "outdoor_umbrellas"
SWEEP = Sweep(27, (-15.0, 30.0))
SIZE = (960, 540)


def main(folder: Path) -> None:
    (place,) = (place for place in places_in(folder) if place.path.stem == PLACE)
    pan = film_pan(load(place), SWEEP, Troubles(), np.random.default_rng(3), SIZE)
    fov = pan.camera.vertical_fov_rad
    frames = [
        SourceFrame(f"frame {number}", frame.pixels, number, number / 3, fov)
        for number, frame in enumerate(pan.frames)
    ]
    fused = fuse_frames(frames, open_model(), FuseSettings(height=1024, level=True))
    Image.fromarray(preview(fused, PLACE)).save(OUT, quality=85, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
