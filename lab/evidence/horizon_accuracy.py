"""How far the tilt that a photo's upright edges say is from the true one, by its evidence.

python -m lab.evidence.horizon_accuracy data/sim [--split val] [--frames 100]

Simulated frames know how their camera was held. Prints, for frames with at least and with less than
so much evidence, their number, median and 90 % of the pitch's error, the errors of the network's
guess and of the usual assumption, and roll's.
"""

import argparse
from pathlib import Path

import numpy as np

from deeplight.compose.ground import DEFAULT_PITCH_RAD
from deeplight.compose.horizon import best_tilt
from deeplight.dataset import Example, open_dataset
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.preprocess import normalise
from lab.evidence.compose_evidence_pictures import full_frame, viewpoint

EVIDENCE = (9, 12, 15, 20)


def main(args: argparse.Namespace) -> None:
    index = open_dataset(args.data).index(args.split)
    numbers = np.random.default_rng(1).permutation(len(index))[: args.frames]
    network = OnnxEstimator()
    rows = np.array([compared(index[int(number)], network) for number in numbers])
    rows = rows[np.isfinite(rows).all(1)]
    for least in EVIDENCE:
        enough = rows[:, 4] >= least
        for words, chosen in (("at least", enough), ("less than", ~enough)):
            pitch, roll, guessed, assumed = (np.median(c) for c in rows[chosen, :4].T)
            most = np.percentile(rows[chosen, 0], 90) if chosen.any() else np.nan
            print(
                f"evidence {words:9} {least:2}: {chosen.sum():3} frames, pitch {pitch:4.1f} "
                f"(90 %: {most:.0f}), guessed {guessed:4.1f}, assumed {assumed:4.1f}, "
                f"roll {roll:.1f} degrees"
            )


def compared(example: Example, network: OnnxEstimator) -> tuple[float, ...]:
    """Errors in degrees of pitch, of roll, of the network's and of the assumed pitch; evidence."""
    photo = full_frame(example, 1).copy()
    height, width, _ = photo.shape
    kept = len(example.background)
    photo[kept:] = photo[kept - 1].mean(0)  # below it the frame was cut: no edges there
    view = viewpoint(example, height, width)
    found = best_tilt(photo, view.camera)
    if found is None:
        return (np.nan,) * 5
    *_, (heads,) = network.estimate_fully(normalise(example.background[None]))
    off = np.array([found.pitch_rad, found.roll_rad, heads["pitch_rad"], DEFAULT_PITCH_RAD])
    pitch = view.pitch_rad
    off = np.degrees(np.abs(off - [pitch, view.roll_rad, pitch, pitch]))
    return *(float(value) for value in off), found.evidence


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--split", default="val")
    parser.add_argument("--frames", type=int, default=100)
    main(parser.parse_args())
