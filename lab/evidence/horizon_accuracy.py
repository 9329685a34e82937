"""How far the pitch that the network guesses is off, and what upright edges in the photo mend.

python -m lab.evidence.horizon_accuracy data/sim [--split val] [--frames 600]

Simulated frames know how their camera was held. Prints, by how many standard deviations the edges
stand out, the number of frames, mean, median and 90 % of the pitch's error by the network's guess,
by edges without it, by both, and by what `estimate` takes (`estimators.tilt.seen_tilt`), how often
the latter is within its own scale, and its roll's error over that of no roll.
"""

import argparse
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from deeplight.contract import ModelContract
from deeplight.dataset import Example, open_dataset
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.estimators.projection import ImagePlane
from deeplight.estimators.tilt import seen_tilt
from deeplight.estimators.upright import guessed_tilt
from deeplight.estimators.upright_edges import LEAST_EVIDENCE, tilt_with_edges
from deeplight.preprocess import normalise
from deeplight.simulate.many_phones import Optics
from deeplight.simulate.many_takes import visible_pixels
from lab.evidence.compose_evidence_pictures import viewpoint

EVIDENCE = ((0.0, LEAST_EVIDENCE), (LEAST_EVIDENCE, np.inf), (0.0, np.inf))
WHOLE = ModelContract()


def main(args: argparse.Namespace) -> None:
    index = open_dataset(args.data).index(args.split)
    numbers = np.random.default_rng(1).permutation(len(index))[: args.frames]
    network = OnnxEstimator(threads=1)
    rows = np.array([compared(index[int(number)], network) for number in numbers])
    rows = rows[np.isfinite(rows).all(1)]
    print(f"{args.split}; pitch off in degrees, mean / median / 90 %: network; edges; both; taken")
    for low, high in EVIDENCE:
        chosen = rows[(rows[:, 0] >= low) & (rows[:, 0] < high)]
        if len(chosen):
            print(f"edges stand out by {low:.0f} to {high:.0f}: {in_words(chosen)}")


def in_words(rows: np.ndarray) -> str:
    """The errors of some frames."""
    parts = []
    for errors in rows[:, 1:5].T:
        parts.append(
            f"{errors.mean():.1f} / {np.median(errors):.1f} / {np.percentile(errors, 90):.0f}"
        )
    within = np.mean(rows[:, 4] <= rows[:, 5])
    roll, none = rows[:, 6:].mean(0)
    return (
        f"{len(rows)} frames, {'; '.join(parts)}; {within:.0%} within the scale; "
        f"roll {roll:.1f} of {none:.1f}"
    )


def compared(example: Example, network: OnnxEstimator) -> tuple[float, ...]:
    """Evidence; errors in degrees of pitch by the network, by edges, by both and as taken, and the
    scale of the latter; errors of its roll and of no roll."""
    photo = example.background
    view = viewpoint(example, *photo.shape[:2])
    *_, (heads,) = network.estimate_fully(normalise(photo[None]))
    shown, plane = shown_part(example)
    guess, taken = guessed_tilt(heads), seen_tilt(shown, plane, heads)
    both, evidence = tilt_with_edges(shown, plane, guess)
    if guess is None or taken is None or both is None:
        return (np.nan,) * 8
    edges, _ = tilt_with_edges(shown, plane, None)
    pitches = [tilt.pitch_rad - view.pitch_rad for tilt in (guess, edges or guess, both, taken)]
    off = np.degrees(np.abs([*pitches, taken.scale_rad, taken.roll_rad - view.roll_rad]))
    roll = float(np.degrees(abs(view.roll_rad)))
    return evidence, *(float(value) for value in off), roll


def shown_part(example: Example) -> tuple[UInt8[np.ndarray, "rows columns 3"], ImagePlane]:
    """What the photo shows of the background, and where it lies as `estimate` believes.

    The rest, where a lens of the family shows less than the network sees, repeats the photo's
    edges: lines that are no edges of the place.
    """
    known, photo = example.meta.details, example.background
    rows, columns = np.ones(photo.shape[0], bool), np.ones(photo.shape[1], bool)
    if "view_fov_rad" in known:
        optics = Optics(known["vertical_fov_rad"], known["aspect"], known["fov_known"])
        pixels = visible_pixels(optics)
        rows, columns = _own(pixels.rows), _own(pixels.columns)
    high, wide = np.flatnonzero(rows), np.flatnonzero(columns)
    across = np.linspace(-WHOLE.right, WHOLE.right, len(columns) + 1)
    down = np.linspace(WHOLE.top, WHOLE.bottom, len(rows) + 1)
    plane = ImagePlane(across[wide[0]], across[wide[-1] + 1], down[high[-1] + 1], down[high[0]])
    return np.ascontiguousarray(photo[rows][:, columns]), plane


def _own(repeated: np.ndarray) -> np.ndarray:
    """Which rows, or columns, are the photo's: of those that repeat one, the inner one."""
    before, after = np.diff(repeated, prepend=-1) > 0, np.diff(repeated, append=np.inf) > 0
    middle = np.arange(len(repeated)) < len(repeated) / 2
    return np.where(middle, after, before)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--split", default="val")
    parser.add_argument("--frames", type=int, default=600)
    main(parser.parse_args())
