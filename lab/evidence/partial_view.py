"""What it costs when a photo shows only part of the view the network was trained on.

python -m lab.evidence.partial_view DATA [SPLIT]

Every background of SPLIT (default val) is cut down to what each kind of photo would show of it
and filled from its edges, as `preprocess` fills a real photo. Prints a Markdown table.
"""

import sys
from dataclasses import dataclass

import numpy as np

from deeplight.dataset import open_dataset
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.evaluate.run import evaluate
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


def main(folder: str, split: str = "val") -> None:
    estimator = OnnxEstimator()
    views = [
        PartialView(estimator, name, frame_photo(h, w, np.radians(fov)))
        for name, (h, w, fov) in PHOTOS.items()
    ]
    report = evaluate(views, open_dataset(folder), split)
    print("| photo | shown | L1 diffuse | silver | mirror | angle of colour |")
    print("|---|---|---|---|---|---|")
    for view in views:
        metrics = report.scores[view.name].metrics()
        l1 = " | ".join(
            f"{metrics[f'l1_{name}'].mean():.3f}" for name in ("diffuse", "matte_silver", "mirror")
        )
        theta = np.nanmean(metrics["theta_rgb_deg"])
        print(f"| {view.name} | {view.framing.visible_fraction:.2f} | {l1} | {theta:.1f} |")


if __name__ == "__main__":
    main(*sys.argv[1:])
