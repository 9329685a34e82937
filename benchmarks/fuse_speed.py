"""How long fusing takes on one core: python benchmarks/fuse_speed.py PANORAMAS

Films a turn in one place, 36 frames of 720 x 1280, and prints processor time: of `Session.add`
without the network, of an environment, and of `deeplight fuse` next to decoding the same clip.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import sys
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

import cv2
import numpy as np

from deeplight.estimators.open import open_model
from deeplight.fuse.fuse import fuse_frames
from deeplight.fuse.session import Session
from deeplight.fuse.sources import read_frames
from deeplight.io.video import video_frames
from deeplight.io.video_writer import VideoWriter
from deeplight.simulate.panorama import load, places_in
from lab.pans import Pan, Sweep, Troubles, film_pan

REPEATED = 12  # each picture is this number of frames of the clip
HEIGHTS = (64, 256, 512)
Result = TypeVar("Result")


def main(panoramas: str) -> None:
    cv2.setNumThreads(1)
    place = next(place for place in places_in(Path(panoramas)) if place.split == "val")
    pan = film_pan(load(place), Sweep(36), Troubles(), np.random.default_rng(1), (1280, 720))
    session_times(pan)
    with TemporaryDirectory() as folder:
        clip_times(pan, Path(folder) / "clip.mp4")


def session_times(pan: Pan) -> None:
    """Two turns; the second one is timed, when every frame takes another one's place."""
    grey = np.full((32, 32, 3), -1, np.float32)
    session = Session(pan.camera.vertical_fov_rad, lambda _: grey)
    times = []
    for frame in [*pan.frames, *pan.frames]:
        start = time.process_time()
        session.add(frame.pixels, frame.rotation)
        times.append(1e3 * (time.process_time() - start))
    half = np.array(times[len(times) // 2 :])
    kept = f"{len(session.views)} views kept"
    print(
        f"Session.add: median {np.median(half):.1f} ms, 90 % {np.quantile(half, 0.9):.1f}, {kept}"
    )
    for height in HEIGHTS:
        start = time.process_time()
        session.environment(height=height)
        print(f"environment of {height} rows: {time.process_time() - start:.2f} s")


def clip_times(pan: Pan, path: Path) -> None:
    """Decoding and fusing of a clip."""
    with VideoWriter(path, 720, 1280, 30.0) as writer:
        for frame in pan.frames:
            for _ in range(REPEATED):
                writer.write(frame.pixels)
    count = timed("decode", lambda: sum(1 for _ in video_frames(path)))
    timed("decode to RGB", lambda: sum(still.rgb().size for still in video_frames(path)))
    frames = timed("choose frames", lambda: read_frames([path], None))
    model = open_model(threads=1)
    fused = timed("place, estimate and fuse", lambda: fuse_frames(frames, model))
    print(f"{count} frames, {len(frames)} chosen, {len(fused.placed)} placed")


def timed(name: str, work: Callable[[], Result]) -> Result:
    """Run and print how much processor time it took."""
    start = time.process_time()
    result = work()
    print(f"{name}: {time.process_time() - start:.1f} s")
    return result


if __name__ == "__main__":
    main(*sys.argv[1:])
