"""A real photo brought to the network's view, against the picture it gave when it was right."""

from math import radians
from pathlib import Path

import numpy as np
import pytest

from deeplight.io.photos import decode_rgb, read_photo
from deeplight.preprocess import background, frame_photo

GOLDEN = Path(__file__).parent / "preprocess_coffee.png"

# JPEG decoders may differ by a level per pixel; a cell averages four of them or more.
LEVELS = 2
FOV_DEG = 55


def coffee_background(root: Path, fov_deg: float = FOV_DEG) -> np.ndarray:
    """The coffee photo as the network sees it; to renew the golden, write this with write_png."""
    pixels = read_photo(root / "examples/photos/coffee.jpg").pixels
    framing = frame_photo(*pixels.shape[:2], radians(fov_deg))
    return background(pixels, framing).astype(int)


def worst(got: np.ndarray) -> int:
    return int(np.abs(got - decode_rgb(GOLDEN.read_bytes()).astype(int)).max())


def test_the_coffee_photo_is_seen_as_before(root: Path) -> None:
    assert worst(coffee_background(root)) <= LEVELS


@pytest.mark.parametrize("fov_deg", [FOV_DEG - 0.5, FOV_DEG + 0.5])
def test_half_a_degree_of_field_of_view_is_noticed(root: Path, fov_deg: float) -> None:
    assert worst(coffee_background(root, fov_deg)) > 5 * LEVELS


def test_a_mirrored_photo_is_noticed(root: Path) -> None:
    assert worst(coffee_background(root)[:, ::-1]) > 5 * LEVELS
