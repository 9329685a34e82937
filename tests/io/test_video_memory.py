"""Frames that nobody holds are freed at once, not when Python's collector comes by."""

import gc
from pathlib import Path

import numpy as np
import pytest

from deeplight.io.video import video_frames
from deeplight.io.video_writer import VideoWriter

pytestmark = pytest.mark.needs("av")

LENGTH, HELD = 24, 12  # a decoder holds some as well


@pytest.mark.parametrize("held", [False, True])
def test_frames_looked_at_are_freed(tmp_path: Path, held: bool) -> None:
    import av

    with VideoWriter(tmp_path / "clip.mp4", 64, 64, 10.0) as writer:
        for k in range(LENGTH):
            writer.write(np.full((64, 64, 3), 8 * k, np.uint8))
    kept = []
    gc.collect()
    gc.disable()
    try:
        for still in video_frames(tmp_path / "clip.mp4"):
            assert still.luma.shape == still.rgb().shape[:2]
            if held:
                kept.append(still)
        alive = sum(type(thing) is av.VideoFrame for thing in gc.get_objects())
    finally:
        gc.enable()
    assert (alive > HELD) == held
