"""Panoramas of made-up places, for tests of what learns from panoramas."""

import numpy as np

from deeplight.evaluate.rivals.sky import Sky


def towards(elevation_deg: float, azimuth_deg: float) -> np.ndarray:
    """0 degrees is the middle of a panorama, 90 right of it."""
    up, around = np.radians(elevation_deg), np.radians(azimuth_deg)
    return np.array([np.cos(up) * np.sin(around), np.sin(up), -np.cos(up) * np.cos(around)])


def places(count: int = 4) -> list[np.ndarray]:
    """Skies, each over another coloured floor so that views differ."""
    random = np.random.default_rng(1)
    found = []
    for number in range(count):
        panorama = Sky(towards(25 + 12 * number, 90 * number + 10), 2.5 + number).panorama(128)
        blocks = np.kron(random.uniform(0.02, 0.3, (8, 32, 3)), np.ones((8, 8, 1)))
        panorama[64:] = blocks
        found.append(panorama.astype(np.float32))
    return found


def rooms(count: int = 4) -> list[np.ndarray]:
    """Dim walls, each with a window of its own in another place."""
    random = np.random.default_rng(2)
    found = []
    for number in range(count):
        panorama = np.kron(random.uniform(0.05, 0.4, (16, 32, 3)), np.ones((8, 8, 1)))
        left = 10 + 60 * number
        panorama[30:54, left : left + 30] = 30 * random.uniform(0.7, 1.0, 3)
        found.append(panorama.astype(np.float32))
    return found
