"""Labels of lamps that lie near each other."""

import itertools

import pytest
from PIL import Image, ImageDraw

from deeplight.estimators.preview import LIGHT_SIZE, _free, _overlap


@pytest.mark.parametrize("y", [66, 250, 425])
def test_labels_of_near_lamps_do_not_overlap_and_stay_in_the_picture(y):
    draw = ImageDraw.Draw(Image.new("RGB", (900, 500)))
    taken = []
    for step in range(4):
        box = draw.textbbox((500 + 3 * step, y + step), "light, 30 x white", anchor="lm")
        assert not taken or any(_overlap(box, other) for other in taken)
        taken.append(_free(box, taken, 64))
    assert not any(_overlap(a, b) for a, b in itertools.combinations(taken, 2))
    assert all(box[1] >= 64 and box[3] <= 64 + LIGHT_SIZE[1] for box in taken[1:])


def test_a_label_alone_stays_where_it_is():
    assert _free((10, 80, 90, 96), [(200, 80, 290, 96)], 64) == (10, 80, 90, 96)
