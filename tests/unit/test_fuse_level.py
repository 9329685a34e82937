"""Level light of photos that say how they were tilted."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from deeplight.errors import ConfigError
from deeplight.frames import UP, world_from_camera
from deeplight.fuse import fuse
from deeplight.fuse.frame import SourceFrame, frame_of
from deeplight.io.photos import read_photo

PIXELS = np.full((40, 32, 3), 128, np.uint8)
ELEVATION = 0x9405


def test_a_photo_that_looks_up_says_where_up_is(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif.get_ifd(0x8769)[ELEVATION] = 20.0
    Image.fromarray(PIXELS).save(tmp_path / "a.jpg", exif=exif)
    found = frame_of(read_photo(tmp_path / "a.jpg"), "a.jpg", 0).up
    np.testing.assert_allclose(found, [0, np.cos(0.349066), -np.sin(0.349066)], atol=1e-5)


def level_from(world: np.ndarray, tilted: bool) -> np.ndarray:
    """Two photos to one side, placed in a world that is turned by `world` from the level one."""
    held = [world_from_camera(0.1, 0.3, 0.2), world_from_camera(0.2, 0.3, 0.2)]
    frames = [
        SourceFrame("", PIXELS, k, up=turn.T @ UP if tilted else None)
        for k, turn in enumerate(held)
    ]
    turns = {k: world @ turn for k, turn in enumerate(held)}
    return np.asarray(fuse._levelled(frames, turns, 0))


def test_tilt_is_enough_to_be_level() -> None:
    world = world_from_camera(0.7, -0.5, 0.4)
    np.testing.assert_allclose(level_from(world, tilted=True)[:, 1], world @ UP, atol=1e-9)


def test_without_it_photos_to_one_side_are_too_few() -> None:
    with pytest.raises(ConfigError, match="EXIF tilt"):
        level_from(np.eye(3), tilted=False)
