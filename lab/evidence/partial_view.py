"""What it costs when a photo shows only part of the view the network was trained on.

python -m lab.evidence.partial_view DATA [--split val] [--landscape LANDSCAPE.onnx]

Every background of the split is cut down to what each kind of photo would show of it
and filled from its edges, as `preprocess` fills a real photo. Prints a Markdown table. The
landscape network looks at the middle, which every phone photo shows whole.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

from deeplight.dataset import open_dataset
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.evaluate.models import NamedModel
from deeplight.evaluate.run import AnyEstimator, evaluate
from deeplight.preprocess import Framing, frame_photo

# Height, width and vertical field of view in degrees of the upright photo.
PHOTOS = {
    "video, 9:16 standing, 66 degrees": (1920, 1080, 66.0),
    "phone, 4:3 standing, 26 mm": (4032, 3024, 67.3),
    "phone, 4:3 lying, 26 mm": (3024, 4032, 53.1),
    "photo, 3:2 lying, long side 66": (2000, 3000, 46.8),
    "camera, 3:2 lying, 50 mm": (2000, 3000, 27.0),
    "camera, 3:2 lying, 85 mm": (2000, 3000, 16.1),
}


@dataclass(frozen=True)
class PartialView:
    """An estimator that sees of each input what a photo with this framing would show."""

    estimator: OnnxEstimator
    name: str
    framing: Framing

    def estimate_inputs(self, inputs: np.ndarray) -> np.ndarray:
        f = self.framing
        rows = _shown(f.top, f.bottom, f.photo_height, inputs.shape[2])
        columns = _shown(f.left, f.right, f.photo_width, inputs.shape[3])
        return self.estimator.estimate_inputs(inputs[:, :, rows][..., columns])


def _shown(start: float, stop: float, length: int, cells: int) -> np.ndarray:
    """For every cell of the input the nearest cell that lies inside the photo."""
    first = (0 - start) / (stop - start) * cells
    last = (length - start) / (stop - start) * cells
    low, high = max(0, int(np.ceil(first - 1e-6))), min(cells, int(np.floor(last + 1e-6)))
    return np.clip(np.arange(cells), low, high - 1)


@dataclass(frozen=True)
class Args:
    """Options of the measurement."""

    data: tyro.conf.Positional[str]
    """Data set."""
    split: str = "val"
    """What is measured."""
    landscape: Path | None = None
    """Network of preset -landscape, for a row of its own."""
    examples: int | None = None
    """Measure only this number of examples, evenly spread."""


def main(args: Args) -> None:
    views = [
        PartialView(OnnxEstimator(), name, frame_photo(h, w, np.radians(fov)))
        for name, (h, w, fov) in PHOTOS.items()
    ]
    shown = {view.name: f"{view.framing.visible_fraction:.2f}" for view in views}
    estimators: Sequence[AnyEstimator] = views
    if args.landscape is not None:
        own = NamedModel("landscape network, its own view", OnnxEstimator(args.landscape))
        estimators, shown = [*views, own], {**shown, own.name: "1.00 of its own"}
    report = evaluate(estimators, open_dataset(args.data), args.split, args.examples)
    print("| photo | shown | L1 diffuse | silver | mirror | angle of colour |")
    print("|---|---|---|---|---|---|")
    for name, share in shown.items():
        metrics = report.scores[name].metrics()
        l1 = " | ".join(
            f"{metrics[f'l1_{sphere}'].mean():.3f}"
            for sphere in ("diffuse", "matte_silver", "mirror")
        )
        theta = np.nanmean(metrics["theta_rgb_deg"])
        print(f"| {name} | {share} | {l1} | {theta:.1f} |")


if __name__ == "__main__":
    main(tyro.cli(Args))
