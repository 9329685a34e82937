"""Photo to network input: one definition, exact, independent of how the pixels lie in memory."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from deeplight.camera import TRAINED_CAMERA
from deeplight.contract import ModelContract
from deeplight.errors import ShapeError
from deeplight.preprocess import Framing, background, frame_photo, network_input, normalise

TRAINED_FOV = math.radians(66)

# The exact areas are computed in float64; the product sums in integers and divides in float32.
# Where a cell lies far outside a tiny photo its edge is extended over thousands of pixels.
TOLERANCE = 5e-5
"""In units of the network's input, whose range is 1: a fiftieth of an 8-bit level."""


def random_photo(height: int, width: int, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (height, width, 3), dtype=np.uint8)


def overlaps(edges: np.ndarray, count: int) -> np.ndarray:
    """Length of each pixel inside each interval over the interval's; end pixels go on for ever."""
    low = np.arange(count, dtype=float)
    high = low + 1
    low[0], high[-1] = -np.inf, np.inf
    inside = np.minimum(edges[1:, None], high) - np.maximum(edges[:-1, None], low)
    return np.clip(inside, 0, None) / np.diff(edges)[:, None]


def exact_input(photo: np.ndarray, framing: Framing) -> np.ndarray:
    """The definition, written as two matrix products in float64."""
    rows = np.linspace(framing.top, framing.bottom, framing.input_height + 1)
    columns = np.linspace(framing.left, framing.right, framing.input_width + 1)
    along = overlaps(rows, photo.shape[0]), overlaps(columns, photo.shape[1])
    return np.einsum("rh,hwc,kw->crk", along[0], photo / 255, along[1], optimize=True) - 0.5


def test_the_trained_frame_gives_exactly_the_8x8_box_filter_of_its_upper_80_percent() -> None:
    photo = random_photo(1920, 1080)
    framing = frame_photo(1920, 1080, TRAINED_FOV)
    box = photo[:1536].reshape(192, 8, 135, 8, 3).mean(axis=(1, 3), dtype=np.float64)
    assert framing.visible_fraction == pytest.approx(1.0)
    assert framing.used_fraction == pytest.approx(0.8)
    np.testing.assert_allclose(
        network_input(photo, framing), box.transpose(2, 0, 1) / 255 - 0.5, atol=1e-7
    )


def test_the_box_filter_test_notices_a_frame_shifted_by_one_pixel() -> None:
    photo = random_photo(1920, 1080)
    framing = frame_photo(1920, 1080, TRAINED_FOV)
    shifted = network_input(np.roll(photo, 1, axis=0), framing)
    assert np.abs(shifted - network_input(photo, framing)).max() > 0.01


@settings(max_examples=25, deadline=None)
@given(
    height=st.integers(32, 400),
    width=st.integers(32, 400),
    fov_deg=st.none() | st.floats(8, 140),
    seed=st.integers(0, 9),
)
def test_any_size_and_field_of_view_matches_the_exact_areas(
    height: int, width: int, fov_deg: float | None, seed: int
) -> None:
    photo = random_photo(height, width, seed)
    framing = frame_photo(height, width, None if fov_deg is None else math.radians(fov_deg))
    difference = np.abs(network_input(photo, framing) - exact_input(photo, framing))
    assert difference.max() < TOLERANCE


@pytest.mark.parametrize(
    "turn",
    [
        lambda a: a[::-1],
        lambda a: a[:, ::-1],
        lambda a: a[::-1, ::-1],
        lambda a: a.transpose(1, 0, 2),
        lambda a: a[::-1].transpose(1, 0, 2),
        lambda a: a[:, ::-1].transpose(1, 0, 2),
        lambda a: a[::-1, ::-1].transpose(1, 0, 2),
    ],
    ids=["2nd", "4th", "3rd", "5th", "8th", "6th", "7th"],
)
def test_a_turned_view_gives_what_its_copy_gives(turn) -> None:
    view = turn(random_photo(240, 301))
    framing = frame_photo(*view.shape[:2], math.radians(60))
    copy = np.ascontiguousarray(view)
    np.testing.assert_allclose(
        network_input(view, framing), network_input(copy, framing), atol=TOLERANCE
    )


@pytest.mark.parametrize(("fov_deg", "height", "width"), [(66, 1200, 900), (80, 900, 1200)])
def test_the_input_shows_the_rays_of_the_trained_camera(
    fov_deg: float, height: int, width: int
) -> None:
    """A photo painted with its own ray directions comes out with the trained camera's."""
    half = math.tan(math.radians(fov_deg) / 2)
    y = half * (1 - (np.arange(height) + 0.5) * 2 / height)
    x = half * width / height * ((np.arange(width) + 0.5) * 2 / width - 1)
    photo = np.zeros((height, width, 3), np.float32)
    photo[..., 0], photo[..., 1] = (x / 4 + 0.5)[None], (y / 4 + 0.5)[:, None]
    seen = (network_input(photo, frame_photo(height, width, math.radians(fov_deg)))) * 4
    rays = replace(TRAINED_CAMERA, width=135, height=240).rays()[:192]
    np.testing.assert_allclose(seen[0], rays[..., 0] / -rays[..., 2], atol=2e-3)
    np.testing.assert_allclose(seen[1], rays[..., 1] / -rays[..., 2], atol=2e-3)


def test_what_the_photo_does_not_show_is_its_edge_continued() -> None:
    photo = random_photo(300, 300)
    photo[0], photo[-1] = (255, 0, 0), (0, 0, 255)
    framing = frame_photo(300, 300, math.radians(30))
    seen = network_input(photo, framing) + 0.5
    np.testing.assert_allclose(seen[:, 0, 60], [1, 0, 0], atol=TOLERANCE)
    np.testing.assert_allclose(seen[:, -1, 60], [0, 0, 1], atol=TOLERANCE)
    rows = min(framing.bottom, 300) - max(framing.top, 0)
    columns = min(framing.right, 300) - max(framing.left, 0)
    area = (framing.bottom - framing.top) * (framing.right - framing.left)
    assert framing.visible_fraction == pytest.approx(rows * columns / area) != 1


def test_an_unknown_field_of_view_is_66_degrees_along_the_long_side_and_says_so() -> None:
    portrait, landscape = frame_photo(1920, 1080), frame_photo(1080, 1920)
    assert portrait.fov_source == landscape.fov_source == "assumed"
    assert portrait.vertical_fov_rad == pytest.approx(TRAINED_FOV)
    across = math.tan(landscape.vertical_fov_rad / 2) * 1920 / 1080
    assert 2 * math.atan(across) == pytest.approx(TRAINED_FOV)
    assert frame_photo(1920, 1080, 1.0, "exif").fov_source == "exif"


def test_sixteen_bits_and_floats_mean_the_same_as_eight() -> None:
    photo = random_photo(200, 150)
    framing = frame_photo(200, 150)
    wanted = network_input(photo, framing)
    for same in (photo.astype(np.uint16) * 257, photo / 255, (photo / 255).astype(np.float32)):
        np.testing.assert_allclose(network_input(same, framing), wanted, atol=TOLERANCE)


def test_a_bright_very_tall_photo_does_not_overflow_the_narrow_sums() -> None:
    photo = np.full((60_000, 32, 3), 255, np.uint8)
    framing = frame_photo(60_000, 32, TRAINED_FOV)
    np.testing.assert_allclose(network_input(photo, framing), 0.5, atol=TOLERANCE)


def test_the_stored_background_is_the_input_in_8_bits() -> None:
    photo = random_photo(700, 500)
    framing = frame_photo(700, 500, math.radians(60))
    stored = background(photo, framing)
    assert stored.shape == (192, 135, 3)
    assert stored.dtype == np.uint8
    half_a_level = 0.5 / 255 + 1e-6
    assert np.abs(normalise(stored) - network_input(photo, framing)).max() <= half_a_level


def test_normalise_takes_one_or_a_batch_and_spans_the_range() -> None:
    batch = np.stack([np.zeros((192, 135, 3), np.uint8), np.full((192, 135, 3), 255, np.uint8)])
    both = normalise(batch)
    assert both.shape == (2, 3, 192, 135)
    assert both.dtype == np.float32
    assert (both[0] == -0.5).all()
    assert (both[1] == 0.5).all()
    np.testing.assert_array_equal(normalise(batch[1]), both[1])


def test_another_contract_gives_another_framing() -> None:
    # Section 4's landscape comparison: 1080 x 810 from the middle of the 1080 x 1536 input.
    landscape = ModelContract(
        width=192, height=144, background_top=363 / 1920, background_fraction=1173 / 1920
    )
    framing = frame_photo(1920, 1080, TRAINED_FOV, contract=landscape)
    edges = (framing.top, framing.bottom, framing.left, framing.right)
    np.testing.assert_allclose(edges, (363, 1173, 0, 1080), atol=1e-6)
    assert network_input(random_photo(1920, 1080), framing).shape == (3, 144, 192)


@pytest.mark.parametrize("fov_rad", [0.0, -1.0, math.pi, math.nan, math.inf])
def test_an_impossible_field_of_view_is_refused(fov_rad: float) -> None:
    with pytest.raises(ShapeError, match="field of view"):
        frame_photo(100, 100, fov_rad)


@pytest.mark.parametrize(
    "photo",
    [
        np.zeros((99, 100, 3), np.uint8),
        np.zeros((100, 100, 3), np.int64),
        np.full((100, 100, 3), 7.0, np.float32),
        np.full((100, 100, 3), np.nan, np.float32),
    ],
    ids=["other size", "other type", "out of range", "nan"],
)
def test_a_photo_that_is_none_is_refused(photo: np.ndarray) -> None:
    with pytest.raises(ShapeError):
        network_input(photo, frame_photo(100, 100))
