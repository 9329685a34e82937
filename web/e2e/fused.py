"""What Python's session makes of frames that a page recorded: python fused.py FOLDER.

FOLDER holds the frames and `frames.json`: file, rotation and whether the page was given a light
then, and rows of the light wanted. `light.f32` is written there: radiance of the last light, then
what was seen, in the world's frame.
"""

import json
import sys
from pathlib import Path

import numpy as np

from deeplight.estimators.look import Answer, seen_from_photo
from deeplight.estimators.open import open_model
from deeplight.fuse.session import Session
from deeplight.io.photos import read_photo
from deeplight.preprocess import network_input

folder = Path(sys.argv[1])
record = json.loads((folder / "frames.json").read_text())
estimator, session = open_model(), None
for frame in record["frames"]:
    photo = read_photo(folder / frame["file"])
    framing = estimator.frame(photo)
    if session is None:
        session = Session(framing.vertical_fov_rad, lambda _: np.empty(0))
    # The live page looks at each frame once.
    answers = map(Answer, *estimator.estimate_fully(network_input(photo.pixels, framing)[None]))
    logs = seen_from_photo(list(answers), [framing]).log_radiance
    added = session.add(photo.pixels, np.reshape(frame["rotation"], (3, 3)), logs)
    if frame["isLit"]:  # what is shown steadily depends on what was shown before
        light = session.environment(np.eye(3), added.log_gain, record["rows"], steady=True)
parts = [light.radiance.ravel(), light.seen.ravel()]
np.concatenate(parts).astype("<f4").tofile(folder / "light.f32")
