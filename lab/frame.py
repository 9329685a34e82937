"""Film one portrait frame in an HDR panorama, as the simulated phone would, with EXIF data.

python -m lab.frame PANORAMA.exr OUT.jpg [YAW_DEG [PITCH_DEG]]

Three of the example photos were made by it; their LICENSES.md says from what. Needs no
network and no model, only a panorama.
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from deeplight.camera import TRAINED_VERTICAL_FOV_RAD, PinholeCamera
from deeplight.frames import turned, world_from_camera
from deeplight.io.atomic import replacing
from deeplight.io.exif import CAMERA, DIAGONAL_35MM_MM
from deeplight.mappings.resample import sample_latlong
from deeplight.simulate.panorama import Place, load
from deeplight.simulate.phone import PHONES, develop, draw_automatics, metered

FOCAL_LENGTH_IN_35MM = 0xA405  # EXIF's tag


def main(panorama: Path, out: Path, yaw_deg: float = 0.0, pitch_deg: float = -15.0) -> None:
    """Write a 540 x 960 JPEG of what a phone held that way sees."""
    radiance = load(Place(panorama, panorama.stem, "indoor", "val"))
    camera = PinholeCamera(540, 960, TRAINED_VERTICAL_FOV_RAD)
    pose = world_from_camera(np.radians(yaw_deg), np.radians(pitch_deg))
    seen = sample_latlong(radiance, turned(camera.rays().astype(np.float32), pose))
    rng = np.random.default_rng(0)
    automatics = draw_automatics(PHONES["paper"], rng)
    places = seen[::40, ::40].reshape(-1, 3)
    setting = metered(places, radiance.mean(axis=(0, 1)), automatics)
    photo = develop(seen, setting.gain, automatics, 4, rng)

    exif = Image.Exif()
    diagonal = 2 * np.hypot(*camera.tangents)
    exif.get_ifd(CAMERA)[FOCAL_LENGTH_IN_35MM] = round(DIAGONAL_35MM_MM / diagonal)
    with replacing(out) as temporary:
        Image.fromarray(photo).save(temporary, "JPEG", quality=92, exif=exif)


if __name__ == "__main__":
    if len(sys.argv) < 3:
        sys.exit(__doc__)
    main(Path(sys.argv[1]), Path(sys.argv[2]), *map(float, sys.argv[3:]))
