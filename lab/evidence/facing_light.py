"""How bright surfaces are under the estimate, by where they face, next to the true light.

    python -m lab.evidence.facing_light data/sim [--split val] [--factor 1.1] [--ahead 1]

Irradiance of a level surface and of upright ones that face the camera, left, right and away, by
luminance: the estimate's over the true one's in stops, with the photo in it and its lamps as wide
as composites draw them. Printed apart for indoor and outdoor examples: the median (the bias), half
the distance between the 16th and 84th percentiles (the spread), and the L1 of what a grey surface
of 34.5 % looks like, in pixel values; and that of a mirror ball that shows the light. `--factor`
and `--ahead` try what would mend a bias: the estimate's light outside of the photo times a factor,
and times e^(AHEAD cos) of the angle to the view.
"""

import argparse
from pathlib import Path

import numpy as np
from jaxtyping import Float

from deeplight.brdf import REFLECTIVITY
from deeplight.camera_response import LUMINANCE, CameraResponse
from deeplight.dataset import open_dataset
from deeplight.environment import Environment
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.frames import Rotation, normalised
from deeplight.lighting import Lighting
from deeplight.mappings import latlong, mirror_ball
from lab.evidence.compose_evidence import as_users_get_it

FACING = {
    "up": (0.0, 1.0, 0.0),
    "camera": (0.0, 0.0, 1.0),
    "left": (-1.0, 0.0, 0.0),
    "right": (1.0, 0.0, 0.0),
    "away": (0.0, 0.0, -1.0),
}
ROWS = 64
GREY = 0.345


def irradiance(
    radiance: Float[np.ndarray, "rows columns 3"], normals: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n 3"]:
    """RGB on surfaces that face `normals`, in the frame of the panorama."""
    size = radiance.shape[:2]
    power = radiance * latlong.solid_angles(*size)[..., None]
    cosine = np.maximum(latlong.directions(*size) @ normals.T, 0)
    found: np.ndarray = np.einsum("hwc,hwn->nc", power, cosine)
    return found


def upright_normals(world_from_camera: Rotation) -> Float[np.ndarray, "facing 3"]:
    """Level and upright directions in the frame of a camera that is pitched and rolled."""
    level, *upright = np.array(list(FACING.values()))
    up = world_from_camera.T @ level
    return np.stack([up, *(normalised(to - up * (to @ up)) for to in upright)])


def main(args: argparse.Namespace) -> None:
    model, index = OnnxEstimator(threads=1), open_dataset(args.data).index(args.split)
    true: list[np.ndarray] = []
    found: list[np.ndarray] = []
    indoor: list[bool] = []
    mirror: list[float] = []
    for number in np.unique(np.linspace(0, len(index) - 1, args.examples).astype(int)):
        example = index[int(number)]
        normals = upright_normals(np.array(example.meta.details["world_from_camera"]))
        truth = Lighting(example.known_lighting)
        light = changed(as_users_get_it(model, example.background), args.factor, args.ahead)
        true.append(irradiance(truth.latlong(ROWS), normals))
        found.append(irradiance(light.radiance, normals))
        indoor.append(example.meta.scene == "indoor")
        mirror.append(mirror_error(light.lighting, truth))
    report(np.array(true), np.array(found), np.array(indoor))
    print(f"L1 of a mirror ball {np.mean(mirror):.4f}")


def changed(light: Environment, factor: float, ahead: float) -> Environment:
    """Brighter where the photo does not look, all over and towards where it looks."""
    towards = np.maximum(-latlong.directions(*light.radiance.shape[:2])[..., 2], 0)
    unseen = 1.0 if light.seen is None else 1 - light.seen
    gain = 1 + unseen * (factor * np.exp(ahead * towards) - 1)
    return Environment((light.radiance * gain[..., None]).astype(np.float32), light.seen)


def mirror_error(ours: Lighting, true: Lighting) -> float:
    """Mean difference of pixel values over a mirror ball that shows the light itself."""
    encode = CameraResponse().pixel_from_radiance
    pixels = [encode(REFLECTIVITY["mirror"] * light.radiance) for light in (ours, true)]
    apart = np.abs(pixels[0] - pixels[1]).mean(-1)
    return float(np.average(apart, weights=mirror_ball.solid_angles(ours.size)))


def report(true: np.ndarray, found: np.ndarray, indoor: np.ndarray) -> None:
    """Print a row for each kind of scene and each way to face."""
    stops = np.log2(found @ LUMINANCE / (true @ LUMINANCE))
    encode = CameraResponse().pixel_from_radiance
    apart = np.abs(encode(GREY / np.pi * found) - encode(GREY / np.pi * true)).mean(-1)
    for name, chosen in (("indoor", indoor), ("outdoor", ~indoor), ("all", indoor | True)):
        for number, facing in enumerate(FACING):
            low, middle, high = np.percentile(stops[chosen, number], [16, 50, 84])
            print(
                f"{name:8}{chosen.sum():4} examples, facing {facing:7} {middle:+.2f} stops, "
                f"spread {(high - low) / 2:.2f}, L1 of grey {apart[chosen, number].mean():.4f}"
            )
    print(f"L1 of grey, facing anywhere but away: {apart[:, :-1].mean():.4f}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--split", default="val")
    parser.add_argument("--examples", type=int, default=192)
    parser.add_argument("--factor", type=float, default=1.0)
    parser.add_argument("--ahead", type=float, default=0.0)
    main(parser.parse_args())
