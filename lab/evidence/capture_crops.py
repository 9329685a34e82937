"""How far stored crops are from the true ones, for every kept frame of simulated clips.

    deeplight capture data/films/clips --out data/captured
    python -m lab.evidence.capture_crops data/films/clips data/captured

Masked L1 of pixel values, per clip and sphere, against CLIP.truth.npz (crops without noise and
compression).
"""

import json
import sys
from pathlib import Path

import numpy as np

from deeplight.dataset import open_dataset
from deeplight.sphere import SPHERES


def main() -> None:
    clips, data = Path(sys.argv[1]), open_dataset(sys.argv[2])
    errors: dict[str, list[list[float]]] = {}
    for split in data.splits:
        if not data.manifest.examples(split):
            continue
        for example in data.examples(split):
            stem = Path(example.meta.source).stem
            truth = true_crops(clips / f"{stem}.truth.json")[example.meta.frame]
            views = data.rigs[example.meta.rig].views
            pairs = [
                (example.spheres[name][mask].astype(float), true[mask])
                for name, true in zip(SPHERES, truth, strict=True)
                for mask in [views[name].mask()]
            ]
            row = [float(np.abs(got - true).mean()) / 255 for got, true in pairs]
            errors.setdefault(stem, []).append(row)
    print("clip".ljust(40), *(name.rjust(13) for name in (*SPHERES, "all")))
    for stem, rows in sorted(errors.items()):
        mean = np.mean(rows, axis=0)
        print(stem[:40].ljust(40), *(f"{value:13.4f}" for value in (*mean, mean.mean())))
    every = np.mean([np.mean(rows, axis=0) for rows in errors.values()], axis=0)
    print("mean of clips".ljust(40), *(f"{value:13.4f}" for value in (*every, every.mean())))


_CACHE: dict[Path, np.ndarray] = {}


def true_crops(path: Path) -> np.ndarray:
    """(frames in the file, 3, 32, 32, 3); the truth lists dropped frames too."""
    if path not in _CACHE:
        dropped = [frame["dropped"] for frame in json.loads(path.read_text())["frames"]]
        with np.load(path.with_suffix(".npz"), allow_pickle=False) as truth:
            _CACHE[path] = truth["crops"][~np.array(dropped, bool)]
    return _CACHE[path]


if __name__ == "__main__":
    main()
