"""What the preview draws: a level panorama, and labels of lamps that lie near each other."""

import itertools

import numpy as np
import pytest
from PIL import Image, ImageDraw

from deeplight.estimators.preview import (
    ACCENT,
    CAPTION,
    LIGHT_SIZE,
    TITLE,
    _font,
    _free,
    _how_shown,
    _overlap,
    _turned,
    mark_lamps,
)
from deeplight.frames import normalised
from deeplight.io.tilt import Tilt
from deeplight.lamp import Lamp
from deeplight.mappings import latlong


@pytest.mark.parametrize("y", [66, 250, 425])
def test_labels_of_near_lamps_do_not_overlap_and_stay_in_the_picture(y):
    draw = ImageDraw.Draw(Image.new("RGB", (900, 500)))
    taken = []
    for step in range(4):
        box = draw.textbbox((500 + 3 * step, y + step), "light, 30 x white", anchor="lm")
        assert not taken or any(_overlap(box, other) for other in taken)
        taken.append(_free(box, taken, 64, 64 + LIGHT_SIZE[1]))
    assert not any(_overlap(a, b) for a, b in itertools.combinations(taken, 2))
    assert all(box[1] >= 64 and box[3] <= 64 + LIGHT_SIZE[1] for box in taken[1:])


def test_no_label_covers_a_ring():
    """Lamps 13 and 18 degrees apart, as in a photo of a cup of coffee."""
    near = ([0.34, 0.57, 0.75], [0.12, 0.58, 0.8], [-0.18, 0.58, 0.79])
    lamps = [Lamp(normalised(np.array(d)), np.full(3, 2.0), 0.06) for d in near]
    picture = Image.new("RGB", (LIGHT_SIZE[0], LIGHT_SIZE[1] + 100))
    mark_lamps(ImageDraw.Draw(picture), lamps, (0, 50, *LIGHT_SIZE))
    shown = (np.asarray(picture) == ACCENT).all(-1)
    y, x = np.nonzero(shown)
    for lamp in lamps:
        (row,), (column,) = latlong.position(lamp.direction[None], LIGHT_SIZE[1], LIGHT_SIZE[0])
        angle = np.arctan2(y - row - 50, x - column)[np.hypot(y - row - 50, x - column) < 15]
        assert len(np.unique(np.round(angle * 4))) > 22  # all around, of 26


@pytest.mark.parametrize("source", ["upright edges and the network's guess", "EXIF acceleration"])
def test_how_the_panorama_is_shown_fits_next_to_its_title(source):
    caption = _how_shown(Tilt(-0.75, 0.1, source, 0.5))
    assert f"43 ± 29° down ({source})" in caption
    widths = [_font(size).getlength(text) for size, text in ((22, TITLE), (CAPTION, caption))]
    assert sum(widths) + 24 < LIGHT_SIZE[0]


def test_a_label_alone_stays_where_it_is():
    assert _free((10, 80, 90, 96), [(200, 80, 290, 96)], 64, 400) == (10, 80, 90, 96)


@pytest.mark.parametrize("rows", [64, 1024])
def test_a_horizon_is_shown_level_whatever_the_tilt(rows):
    tilt = Tilt(-0.4, 0.2, "a test")
    bright_sky = latlong.directions(rows, 2 * rows) @ tilt.up > 0
    radiance = np.repeat(bright_sky[..., None], 3, axis=2).astype(np.float32)

    def wave(turn: np.ndarray) -> float:
        """How many of the picture's rows the horizon goes up and down."""
        bright = _turned(radiance, turn)[..., 0] > 0.5
        return float(np.ptp(bright.sum(axis=0)))

    assert wave(tilt.level_from_camera) < 0.05 * LIGHT_SIZE[1]
    assert wave(np.eye(3)) > 0.2 * LIGHT_SIZE[1]
