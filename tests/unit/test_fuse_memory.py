"""What fusing keeps in memory does not grow with the number of frames."""

import re
import tracemalloc
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from deeplight.frames import world_from_camera
from deeplight.fuse.blend import blended
from deeplight.fuse.frame import SourceFrame
from deeplight.fuse.sources import thinned
from deeplight.fuse.track import FEATURES, features_of
from deeplight.fuse.view import CELLS, View
from deeplight.mappings import latlong

pytestmark = pytest.mark.needs("cv2")

FRAME_BYTES = 4_000
"""Of a frame that waits: its name, number and place on the disk."""


def held_by(work: Callable[[], object]) -> int:
    """Bytes of the work's result."""
    tracemalloc.start()
    result = work()
    held = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    del result
    return held


def source(count: int) -> Iterator[SourceFrame]:
    stretch = np.zeros((count, 120, 68, 3), np.uint8)
    for number, pixels in enumerate(stretch):
        pixels[:] = number % 256
        yield SourceFrame(f"frame {number}", pixels, number)


def test_pictures_of_a_clip_wait_on_the_disk() -> None:
    frames = thinned(source(400))
    assert all((frame.pixels == frame.number % 256).all() for frame in frames)
    few, many = (held_by(lambda n=n: thinned(source(n))) for n in (20, 120))
    assert many - few < FRAME_BYTES * 100


def test_a_full_disk_is_named(tmp_path: Path) -> None:
    resource = pytest.importorskip("resource")  # Windows limits no file's size
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, limits[1]))
    try:
        with pytest.raises(OSError, match=re.escape(str(tmp_path))):
            thinned(source(9), tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_features_are_bytes_and_their_places() -> None:
    noise = np.random.default_rng(0).integers(0, 255, (120, 68, 3)).astype(np.uint8)
    features = features_of(cv2.resize(noise, (272, 480)), 0.6)
    assert len(features.plane) > FEATURES / 2
    assert features.plane.nbytes + features.words.nbytes <= FEATURES * (128 + 16)
    np.testing.assert_allclose(np.linalg.norm(features.unit_words, axis=1), 1, atol=1e-6)


def views(count: int) -> list[View]:
    """All around; each looks a little higher than the one before."""
    rng, estimate = np.random.default_rng(1), np.zeros((8, 8, 3), np.float32)
    turns = (world_from_camera(2 * np.pi * k / count, 0.02 * k, 0.0) for k in range(count))
    pictures = (rng.integers(0, 255, (24, 24, 3)).astype(np.uint8) for _ in range(count))
    return [View(p, turn, 2.0, estimate) for p, turn in zip(pictures, turns, strict=True)]


def test_samples_of_one_band_alone_are_in_memory() -> None:
    directions, several = latlong.directions(64, 128), views(8)
    gains, trust = np.zeros((8, 3)), np.ones((8, CELLS), np.float32)
    found, most = [], []
    blended(several, gains, trust, directions)  # what is worked out once is no matter here
    for at_once in (2**30, 1000):
        tracemalloc.start()
        found.append(blended(several, gains, trust, directions, at_once))
        most.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert most[1] < 0.7 * most[0], most
    for part in ("radiance", "share", "clipped"):
        np.testing.assert_array_equal(*(getattr(seen, part) for seen in found))
