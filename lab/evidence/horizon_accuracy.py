"""How far the tilt that a photo's upright edges say is from the true one, by its evidence.

python -m lab.evidence.horizon_accuracy data/sim [--split val] [--frames 100]

Simulated frames know how their camera was held. Prints, for frames with at least so much evidence,
their number, median and 90 % of the pitch's error, the error of the usual assumption, and roll's.
"""

import argparse
from pathlib import Path

import numpy as np

from deeplight.compose.ground import DEFAULT_PITCH_RAD
from deeplight.compose.horizon import best_tilt
from deeplight.dataset import Example, open_dataset
from lab.evidence.compose_evidence_pictures import full_frame, viewpoint

EVIDENCE = (0, 6, 8, 9, 10, 15, 20)


def main(args: argparse.Namespace) -> None:
    index = open_dataset(args.data).index(args.split)
    numbers = np.random.default_rng(1).permutation(len(index))[: args.frames]
    rows = np.array([compared(index[int(number)]) for number in numbers])
    rows = rows[np.isfinite(rows).all(1)]
    for least in EVIDENCE:
        pitch, roll, assumed = rows[rows[:, 3] >= least, :3].T
        if len(pitch):
            errors = f"pitch {np.median(pitch):.1f} (90 %: {np.percentile(pitch, 90):.0f})"
            usual = f"assumed {np.median(assumed):.1f}, roll {np.median(roll):.1f} degrees"
            print(f"evidence {least:2}: {len(pitch):3} frames, {errors}, {usual}")


def compared(example: Example) -> tuple[float, float, float, float]:
    """Errors in degrees of pitch, of roll and of the assumed pitch; the evidence."""
    photo = full_frame(example, 1).copy()
    height, width, _ = photo.shape
    kept = len(example.background)
    photo[kept:] = photo[kept - 1].mean(0)  # below it the frame was cut: no edges there
    view = viewpoint(example, height, width)
    found = best_tilt(photo, view.camera)
    if found is None:
        return (np.nan,) * 4
    off = np.array([found.pitch_rad, found.roll_rad, DEFAULT_PITCH_RAD])
    off = np.degrees(np.abs(off - [view.pitch_rad, view.roll_rad, view.pitch_rad]))
    return float(off[0]), float(off[1]), float(off[2]), found.evidence


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--split", default="val")
    parser.add_argument("--frames", type=int, default=100)
    main(parser.parse_args())
