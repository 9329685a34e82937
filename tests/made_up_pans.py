"""Pans through a made-up place, for tests of what looks around."""

import cv2
import numpy as np

from lab.pans import Pan, Sweep, Troubles, film_pan


def pan(pictures: int, troubles: Troubles, things: int = 900) -> Pan:
    """A turn of small upright pictures through a place full of things of all sizes and colours."""
    rng = np.random.default_rng(3)
    place = np.full((256, 512, 3), 0.3, np.float32)
    for size in np.geomspace(60, 3, things):
        centre = (int(rng.integers(512)), int(rng.integers(40, 216)))
        axes = (int(size * rng.uniform(0.3, 1)), int(size * rng.uniform(0.3, 1)))
        colour = rng.uniform(0.02, 0.9, 3).tolist()
        cv2.ellipse(place, centre, axes, rng.uniform(0, 180), 0, 360, colour, -1)
    return film_pan(place, Sweep(pictures), troubles, np.random.default_rng(1), (320, 180))
