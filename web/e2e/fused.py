"""What Python's session makes of frames that a page recorded: python fused.py FOLDER.

FOLDER holds `frames.json` (file, rotation, and rows of the light wanted) and the frames.
`light.f32` is written there: radiance, then what was seen, in the world's frame.
"""

import json
import sys
from pathlib import Path

import numpy as np

from deeplight.estimators.open import open_model
from deeplight.fuse.session import Session

folder = Path(sys.argv[1])
record = json.loads((folder / "frames.json").read_text())
estimator, session = open_model(), None
for frame in record["frames"]:
    estimate = estimator.explain(folder / frame["file"])
    if session is None:
        session = Session(estimate.framing.vertical_fov_rad, lambda _: np.empty(0))
    logs = np.log(np.maximum(estimate.lighting.radiance, 1e-30))
    added = session.add(estimate.photo.pixels, np.reshape(frame["rotation"], (3, 3)), logs)
light = session.environment(np.eye(3), added.log_gain, record["rows"])
parts = [light.radiance.ravel(), light.seen.ravel()]
np.concatenate(parts).astype("<f4").tofile(folder / "light.f32")
