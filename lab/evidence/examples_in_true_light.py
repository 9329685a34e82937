"""The example photos that were filmed in panoramas: their bunnies in the estimate and in the truth.

    python -m lab.evidence.examples_in_true_light HDRI_FOLDER [--picture FILE.jpg]

Prints how bright surfaces are under the estimate, next to the light in which the photo was filmed,
by where they face, in stops. Draws the diffuse and the silver bunny under the estimate and under
that light, photo by photo: whether an object is dark because the estimate is, or because the room
is. The exposure is what brings the panorama to the photo's pixels that do not clip.
"""

import argparse
from pathlib import Path

import numpy as np
from jaxtyping import Float, Float32
from PIL import Image, ImageDraw

from deeplight.camera import PinholeCamera
from deeplight.camera_response import LUMINANCE, CameraResponse
from deeplight.compose.compose import ComposeSettings, Item
from deeplight.compose.gravity import CameraPlacement
from deeplight.compose.photo import compose_photo
from deeplight.environment import Environment
from deeplight.estimators.environment import scene_light
from deeplight.estimators.estimate import load_estimator
from deeplight.estimators.network import Estimate
from deeplight.estimators.sureness import glow_rad
from deeplight.frames import Rotation, turned, world_from_camera
from deeplight.io.atomic import replacing
from deeplight.io.photos import encode_jpeg
from deeplight.mappings import latlong
from deeplight.mappings.resample import sample_latlong
from deeplight.simulate.panorama import Place, load
from lab.evidence.facing_light import FACING, irradiance, upright_normals

PHOTOS = Path(__file__).resolve().parents[2] / "examples" / "photos"
FILMED = {  # photo: panorama, yaw in degrees; see LICENSES.md there
    "meadow.jpg": ("resting_place.exr", 180.0),
    "canteen.jpg": ("abandoned_factory_canteen_01.exr", 0.0),
    "hall.jpg": ("st_fagans_interior.exr", 60.0),
}
PITCH_DEG = -12.0
ROWS, WIDTH = 512, 300
HEADS = ("diffuse, estimate", "diffuse, true light", "silver, estimate", "silver, true light")
MID = (0.2, 0.85)  # pixel values between which a pixel says how the photo was exposed


def true_light(file: Path, yaw_deg: float, estimate: Estimate) -> tuple[Environment, Rotation]:
    """The panorama in the photo's camera frame and exposure, and how the camera stood."""
    radiance = load(Place(file, file.stem, "indoor", "val"))
    pose = world_from_camera(np.radians(yaw_deg), np.radians(PITCH_DEG), 0.0)
    pixels = estimate.photo.pixels[::8, ::8].astype(np.float32) / 255
    height, width, _ = estimate.photo.pixels.shape
    rays = PinholeCamera(width, height, estimate.framing.vertical_fov_rad).rays()[::8, ::8]
    seen = sample_latlong(radiance, turned(rays.astype(np.float32), pose))
    mid = (pixels.min(-1) > MID[0]) & (pixels.max(-1) < MID[1])
    ratio = CameraResponse().radiance_from_pixel(pixels)[mid] / np.maximum(seen[mid], 1e-6)
    directions = latlong.directions(ROWS, 2 * ROWS).astype(np.float32)
    around: Float32[np.ndarray, "rows columns 3"] = sample_latlong(
        radiance, turned(directions, pose)
    )
    return Environment((around * np.median(ratio, 0)).astype(np.float32)), pose


def stops(estimate: Estimate, truth: Environment, pose: Rotation) -> Float[np.ndarray, " facing"]:
    """How much brighter surfaces are under the estimate, as composites draw it."""
    normals = upright_normals(pose)
    scene, glow = scene_light(estimate), glow_rad(estimate.heads)
    light = scene.environment if glow is None else scene.softened(glow).environment
    ours, true = (irradiance(some.radiance, normals) @ LUMINANCE for some in (light, truth))
    return np.log2(ours / true)


def pictures(photo: Path, truth: Environment) -> list[np.ndarray]:
    """A bunny of each material under the estimate and under the truth, cut out around it."""
    placement, found = CameraPlacement(pitch_deg=PITCH_DEG, roll_deg=0.0), []
    for material in ("diffuse", "silver"):
        for light in (None, truth):
            settings = ComposeSettings(engine="scalar")
            item = [Item("bunny", material)]
            made = compose_photo(photo, item, light, placement=placement, settings=settings)
            pixels = made.composite.pixels
            part = pixels[int(0.22 * len(pixels)) : int(0.78 * len(pixels))]
            size = WIDTH, WIDTH * len(part) // part.shape[1]
            found.append(np.asarray(Image.fromarray(part).resize(size)))
    return found


def main(args: argparse.Namespace) -> None:
    network, rows = load_estimator(), []
    print(f"{'stops over the truth, facing':30}" + "".join(f"{name:>9}" for name in FACING))
    for name, (file, yaw) in FILMED.items():
        estimate = network.explain(PHOTOS / name)
        truth, pose = true_light(args.hdri / file, yaw, estimate)
        print(f"{name:30}" + "".join(f"{value:+9.2f}" for value in stops(estimate, truth, pose)))
        if args.picture:
            rows.append(np.concatenate(pictures(PHOTOS / name, truth), axis=1))
    if args.picture:
        sheet = Image.fromarray(np.concatenate(rows))
        for number, head in enumerate(HEADS):
            ImageDraw.Draw(sheet).text((number * WIDTH + 8, 6), head, "black")
        with replacing(args.picture) as temporary:
            temporary.write_bytes(encode_jpeg(np.asarray(sheet), 85))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("hdri", type=Path)
    parser.add_argument("--picture", type=Path)
    main(parser.parse_args())
