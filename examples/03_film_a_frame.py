"""Film one portrait frame in an HDR panorama, with EXIF data, and estimate its light again.

python examples/03_film_a_frame.py [PANORAMA.exr [OUT.jpg [YAW_DEG [PITCH_DEG]]]]

Without a panorama, one is made up: a grey room with a window. `deeplight simulate` films whole
data sets, with phones that meter, balance white and make noise.
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

import deeplight

WIDTH, HEIGHT, FOV_DEG = 540, 960, 66.0
EXIF_FOLDER, FOCAL_LENGTH_IN_35MM = 0x8769, 0xA405
HALF_DIAGONAL_MM = 21.63  # of a 36 x 24 mm picture


def rays(yaw_deg: float, pitch_deg: float) -> np.ndarray:
    """Unit direction through each pixel of a camera that looks along -Z, then turns."""
    half = np.tan(np.radians(FOV_DEG / 2))
    x = ((np.arange(WIDTH) + 0.5) / WIDTH * 2 - 1) * half * WIDTH / HEIGHT
    y = (1 - (np.arange(HEIGHT) + 0.5) / HEIGHT * 2) * half
    plane = np.stack([*np.meshgrid(x, y), np.full((HEIGHT, WIDTH), -1.0)], axis=-1)
    yaw, pitch = np.radians((yaw_deg, pitch_deg))
    up = [[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]]
    right = [[np.cos(yaw), 0, -np.sin(yaw)], [0, 1, 0], [np.sin(yaw), 0, np.cos(yaw)]]
    plane = plane @ (np.array(right) @ np.array(up)).T
    return plane / np.linalg.norm(plane, axis=-1, keepdims=True)


def seen(radiance: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """The panorama's radiance along each direction; its centre column is -Z."""
    rows, columns = radiance.shape[:2]
    x, y, z = np.moveaxis(directions, -1, 0)
    row = (np.arccos(y.clip(-1, 1)) / np.pi * rows).astype(int).clip(0, rows - 1)
    column = ((0.5 + np.arctan2(x, -z) / (2 * np.pi)) * columns).astype(int) % columns
    return radiance[row, column]


def made_up() -> deeplight.Environment:
    """A grey room, darker below, with a window on the right."""
    room = np.full((256, 512, 3), 0.3, np.float32)
    room[128:] = 0.15
    room[96:126, 262:310] = (3, 3.3, 4)
    return deeplight.Environment(room, unit="file")


def main(
    panorama: Path | None = None,
    out: Path = Path("out/examples/filmed.jpg"),
    yaw_deg: float = 0.0,
    pitch_deg: float = -15.0,
) -> None:
    """Write a 540 x 960 JPEG of what a phone held that way sees; print the light found in it."""
    environment = made_up() if panorama is None else deeplight.read_environment(panorama)
    radiance = seen(environment.radiance, rays(yaw_deg, pitch_deg))
    stops = np.log2(0.18 / radiance.mean().clip(1e-6))  # the mean becomes mid-grey
    camera = deeplight.CameraResponse(exposure_stops=float(stops))
    pixels = np.rint(camera.pixel_from_radiance(radiance) * 255).astype(np.uint8)
    exif = Image.Exif()
    half_diagonal = np.hypot(1, WIDTH / HEIGHT) * np.tan(np.radians(FOV_DEG / 2))
    exif.get_ifd(EXIF_FOLDER)[FOCAL_LENGTH_IN_35MM] = round(HALF_DIAGONAL_MM / half_diagonal)
    out.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(pixels).save(out, "JPEG", quality=92, exif=exif)
    light = deeplight.estimate(out).main_light
    print(f"{out}: main light from {light.direction.round(2)}")


if __name__ == "__main__":
    paths = [Path(word) for word in sys.argv[1:3]]
    main(*paths, *map(float, sys.argv[3:]))
