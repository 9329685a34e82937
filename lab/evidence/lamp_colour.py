"""How far the colour of the estimate's lamps is off the true main light's.

    python -m lab.evidence.lamp_colour data/sim [--split val test] [--examples 288]

Mean and median angle between the colour of the true main light, where there is one, and that of the
strongest lamp: as the network gives it, with the mean colour of its lamps, with the share of that
which is used (`lamps.OWN_COLOUR`, the rest the whole estimate's), and with the whole estimate's.
"""

import argparse
from pathlib import Path

import numpy as np
from jaxtyping import Float

from deeplight.camera_response import LUMINANCE
from deeplight.dataset import open_dataset
from deeplight.dataset.reading import SplitIndex
from deeplight.estimators.lamps import LARGEST_OWN_RAD, MOST_LAMPS, OWN_COLOUR
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.harmonics import dominant_light
from deeplight.lighting import Lighting
from deeplight.preprocess import normalise

LEAST_SHARE = 0.05  # of the power: less is no main light


def colours(
    model: OnnxEstimator, background: np.ndarray
) -> dict[str, Float[np.ndarray, "3"]] | None:
    """RGB of the strongest lamp by each way to colour it; None where the network has no lamp."""
    log_radiance, (lamps,), _ = model.estimate_fully(normalise(background[None]))
    compact = [lamp for lamp in lamps if lamp.angular_radius_rad <= LARGEST_OWN_RAD][:MOST_LAMPS]
    if not compact:
        return None
    power = Lighting.from_log_radiance(log_radiance[0]).power()
    own = max(compact, key=lambda lamp: lamp.luminous_flux).flux
    together = np.sum([lamp.flux for lamp in compact], axis=0)
    mean, whole = together / (together @ LUMINANCE), power / (power @ LUMINANCE)
    mixed = OWN_COLOUR * mean + (1 - OWN_COLOUR) * whole
    return {"as given": own, "mean of lamps": mean, f"{OWN_COLOUR} own": mixed, "whole": whole}


def angle_deg(a: Float[np.ndarray, "3"], b: Float[np.ndarray, "3"]) -> float:
    """Between two colours, whatever their brightness."""
    cosine = a @ b / (np.linalg.norm(a) * np.linalg.norm(b))
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def measured(model: OnnxEstimator, index: SplitIndex, most: int) -> dict[str, list[float]]:
    """Angles by way to colour the lamps."""
    found: dict[str, list[float]] = {}
    for number in np.unique(np.linspace(0, len(index) - 1, most).astype(int)):
        example = index[int(number)]
        true = dominant_light(Lighting(example.known_lighting))
        ways = colours(model, example.background)
        if ways is None or true.share < LEAST_SHARE:
            continue
        for name, colour in ways.items():
            found.setdefault(name, []).append(angle_deg(colour, true.irradiance))
    return found


def main(args: argparse.Namespace) -> None:
    model, data = OnnxEstimator(threads=1), open_dataset(args.data)
    for split in args.split:
        angles = measured(model, data.index(split), args.examples)
        count = max(map(len, angles.values()), default=0)
        print(f"{split}: degrees off the true main light's colour, mean (median), {count} examples")
        for name, values in angles.items():
            print(f"  {name:14}{np.mean(values):6.1f} ({np.median(values):.1f})")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--split", nargs="+", default=["val", "test"])
    parser.add_argument("--examples", type=int, default=288)
    main(parser.parse_args())
