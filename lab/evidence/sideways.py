"""How well the network notices photos that lie on their side, and how often it is wrong.

python -m lab.evidence.sideways data/sim HDRI_FOLDER [--yaws 5]

Films upright and lying 4:3 photos in the panoramas of the validation and test places, turns each by
quarters, and prints for limits of the chances that it should be turned so and that it lies on
either side, the shipped ones last: the part of the upright ones
that would be noted, of the turned ones, of how many of these a note says which way (the others lie
on their side, left or right), and how often that is the right one.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from deeplight.camera import PinholeCamera
from deeplight.dataset import open_dataset
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.estimators.upright import LYING_CHANCE, SURE_CHANCE, likeliest_turn, lying
from deeplight.frames import turned, world_from_camera
from deeplight.io.photos import Photo
from deeplight.mappings.resample import sample_latlong
from deeplight.simulate.panorama import Place, load
from deeplight.simulate.phone import PHONES, develop, draw_automatics, metered

FOV_RAD = {(256, 192): float(np.radians(67)), (192, 256): float(np.radians(53))}  # 26 mm
LIMITS = (*((limit, limit) for limit in (0.5, 0.6, 0.7, 0.8, 0.9)), (SURE_CHANCE, LYING_CHANCE))


def main(args: argparse.Namespace) -> None:
    model = OnnxEstimator(threads=1)
    places = open_dataset(args.data).manifest.recipe["panoramas"]
    for split in ("val", "test"):
        rows = []
        for file, (place, its_split, _) in places.items():
            if its_split == split and (args.hdri / file).is_file():
                for photo in filmed(args.hdri / file, place, args.yaws):
                    rows += [said(model, photo, quarters) for quarters in range(4)]
        report(split, np.array(rows))


def filmed(file: Path, place: str, yaws: int) -> Iterator[np.ndarray]:
    """Upright pictures of both shapes, looking around and a little up and down."""
    radiance = load(Place(file, place, "indoor", "val"))
    rng = np.random.default_rng(0)
    for number in range(yaws):
        for (height, width), fov in FOV_RAD.items():
            camera = PinholeCamera(width, height, fov)
            angles = 2 * np.pi * (number + rng.random()) / yaws, rng.uniform(-0.5, 0.2)
            pose = world_from_camera(*angles, rng.normal(0, 0.03))
            seen = sample_latlong(radiance, turned(camera.rays().astype(np.float32), pose))
            automatics = draw_automatics(PHONES["paper"], rng)
            setting = metered(seen[::8, ::8].reshape(-1, 3), radiance.mean((0, 1)), automatics)
            yield develop(seen, setting.gain, automatics, 4, rng)


def said(model: OnnxEstimator, upright: np.ndarray, quarters: int) -> tuple[int, int, float, float]:
    """By how many quarters clockwise it should be turned, in truth and as said, the chance of that,
    and the chance that it lies on its side."""
    pixels = np.ascontiguousarray(np.rot90(upright, quarters))  # counter-clockwise
    fov = np.degrees(FOV_RAD[pixels.shape[0], pixels.shape[1]])
    heads = model.explain(Photo(pixels), float(fov)).heads
    turn, chance = likeliest_turn(heads)
    return quarters, turn // 90, chance if turn else 0.0, lying(heads)


def report(split: str, rows: np.ndarray) -> None:
    true, found, chance, on_side = rows.T
    upright = true == 0
    print(f"{split}: {upright.sum()} photos, each in four turns")
    for limit, of_side in LIMITS:
        which = (chance >= limit) & ~upright
        noted = (chance >= limit) | (on_side >= of_side)
        right = (found == true)[which]
        print(
            f"  from {limit:.2f} and {of_side:.2f}: upright noted {noted[upright].mean():6.1%}, "
            f"turned noted {noted[~upright].mean():6.1%}, which way {which[~upright].mean():6.1%}, "
            f"of these right {right.mean() if len(right) else np.nan:6.1%}"
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("hdri", type=Path)
    parser.add_argument("--yaws", type=int, default=5)
    main(parser.parse_args())
