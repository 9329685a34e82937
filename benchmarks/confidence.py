"""How far off estimates are, by how much the answers to one photo spread.

    python benchmarks/confidence.py data/sim --split val

Prints, for direction, brightness and colour, the median error of photos whose spread is below and
above the limits of `deeplight.estimators.confidence`, and the rank correlation of the two.
"""

import argparse

import numpy as np

from deeplight.camera_response import LUMINANCE
from deeplight.dataset import open_dataset
from deeplight.estimators.confidence import BRIGHTNESS_STOPS, DIRECTION_DEG, confidence_of
from deeplight.estimators.estimate import load_estimator
from deeplight.estimators.network import Estimate
from deeplight.harmonics import dominant_light
from deeplight.io.photos import Photo
from deeplight.lighting import Lighting
from deeplight.preprocess import Framing, network_input

UNITS = ("direction, degrees", "brightness, stops", "colour, degrees")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data")
    parser.add_argument("--split", default="val")
    parser.add_argument("--examples", type=int, default=200)
    given = parser.parse_args()
    index = open_dataset(given.data).index(given.split)
    numbers = np.unique(np.linspace(0, len(index) - 1, given.examples).astype(int))
    rows = np.array([measured(index[int(number)]) for number in numbers])
    limits = (DIRECTION_DEG, BRIGHTNESS_STOPS, float(np.median(rows[:, 2])))
    for name, limit, spread, error in zip(UNITS, limits, rows.T[:3], rows.T[3:], strict=True):
        below = spread < limit
        correlation = np.corrcoef(ranks(spread), ranks(error))[0, 1]
        print(
            f"{name}: spread below {limit:.2f}: {below.mean():.0%} of photos, median error "
            f"{np.median(error[below]):.2f}; above: {np.median(error[~below]):.2f}; "
            f"rank correlation {correlation:.2f}"
        )


def measured(example: object) -> list[float]:
    """Spread of direction, brightness and colour of one photo, then their errors."""
    estimator, pixels = load_estimator(), example.background
    height, width, _ = pixels.shape
    framing = Framing(height, width, 0, height, 0, width, 1.0, "given", height, width)
    log_radiance = estimator.estimate_inputs(network_input(pixels, framing)[None])[0]
    lighting, true = Lighting.from_log_radiance(log_radiance), Lighting(example.true_lighting)
    estimate = Estimate(lighting, Photo(pixels), framing, (), {})
    found = confidence_of(estimator, estimate)
    powers = lighting.power(), true.power()
    lights = [dominant_light(light).direction for light in (lighting, true)]
    stops = abs(np.log2((powers[0] @ LUMINANCE) / (powers[1] @ LUMINANCE)))
    spreads = [found.direction_deg, found.brightness_stops, found.colour_deg]
    return [*spreads, angle_deg(*lights), stops, angle_deg(*powers)]


def angle_deg(one: np.ndarray, other: np.ndarray) -> float:
    cosine = one @ other / np.linalg.norm(one) / np.linalg.norm(other)
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def ranks(values: np.ndarray) -> np.ndarray:
    return values.argsort().argsort()


if __name__ == "__main__":
    main()
