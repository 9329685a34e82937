"""Whether the ground can say how wrong an estimate's brightness and colour are: it cannot.

python -m lab.evidence.ground_albedo data/sim [--split val]

The ground's pixels over the light that an estimate lets fall on it are an implied albedo, and one
of 80 % in brown looks as if the estimate were too dim. In frames that look down on ground, with the
true light known, prints how what is missing (ln of what really falls there over what the estimate
says) goes with ln of the implied albedo: slope and correlation, for the mean of the channels and
for red over blue, and the mean for each range of albedos.
"""

import argparse
from itertools import pairwise
from pathlib import Path

import numpy as np

from deeplight.compose.compose import Item, placed
from deeplight.compose.scene import irradiance_on_plane
from deeplight.compose.surface import surface_of
from deeplight.dataset import Example, open_dataset
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.lighting import Lighting
from lab.evidence.compose_evidence import as_users_get_it, chosen
from lab.evidence.compose_evidence_pictures import STANDS, full_frame, viewpoint

ROWS = 64
RED_BLUE = np.array([1.0, 0.0, -1.0])
RANGES = (0.0, 0.05, 0.15, 0.35, 0.6, np.inf)


def main(args: argparse.Namespace) -> None:
    index, model = open_dataset(args.data).index(args.split), OnnxEstimator(threads=1)
    pairs = [compared(example, model) for example in chosen(index, args.cases)]
    implied, missing = (np.log(np.array(side)) for side in zip(*pairs, strict=True))
    for name, axis in (("mean of channels", np.ones(3) / 3), ("red over blue", RED_BLUE)):
        x, y = implied @ axis, missing @ axis
        slope, correlation = np.polyfit(x, y, 1)[0], np.corrcoef(x, y)[0, 1]
        spread = f"sd of the albedo's {x.std():.2f}, of what is missing {y.std():.2f}"
        print(f"{name}: slope {slope:+.2f}, correlation {correlation:+.2f}; {spread}")
    mean = implied.mean(1)
    for low, high in pairwise(RANGES):
        use = (np.exp(mean) > low) & (np.exp(mean) <= high)
        if use.any():
            found = missing[use].mean()
            print(f"albedo {low:.2f} to {high:.2f}: {use.sum()} frames, missing {found:+.2f}")


def compared(example: Example, model: OnnxEstimator) -> tuple[np.ndarray, np.ndarray]:
    """The implied albedo, and what really falls on the ground over what the estimate says."""
    photo = full_frame(example, 1)
    light = as_users_get_it(model, example.background)
    height, width, _ = photo.shape
    view = viewpoint(example, height, width)
    at = (STANDS[0] * width, STANDS[1] * len(example.background))
    solids, _ = placed(view, [Item("sphere", at=at)])
    surface = surface_of(photo, light.radiance, view, solids)
    true = irradiance_on_plane(Lighting(example.known_lighting).latlong(ROWS), view)
    return surface.measured, true / irradiance_on_plane(light.radiance, view)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--split", default="val")
    parser.add_argument("--cases", type=int, default=150)
    main(parser.parse_args())
