"""The evidence knows how a frame's camera was held, and what its lens showed, whichever it was."""

from typing import Any

import numpy as np
import pytest

from deeplight.dataset.example import Example, ExampleMeta
from deeplight.frames import world_from_camera
from deeplight.simulate.many_phones import FAMILY, KEPT, Optics
from deeplight.simulate.many_takes import visible_pixels
from deeplight.simulate.phone import PHONES
from deeplight.sphere import PAPER_RIG
from lab.evidence.compose_evidence_pictures import viewpoint
from lab.evidence.horizon_accuracy import shown_part

SPHERES = {name: np.zeros((32, 32, 3), np.uint8) for name in PAPER_RIG.views}
NARROW, WIDE = Optics(0.76, 0.75), Optics(1.4, 0.5625, fov_known=False)


def seen_by(camera: str, optics: Optics | None = None) -> Example:
    """A frame whose every pixel says which pixel of the photo it repeats."""
    details: dict[str, Any] = {"world_from_camera": world_from_camera(0.7, -0.3, 0.1).tolist()}
    photo = np.zeros((192, 135, 3), np.uint8)
    if optics:
        known = ("vertical_fov_rad", "aspect", "fov_known", "view_fov_rad")
        details |= {name: getattr(optics, name) for name in known}
        pixels = visible_pixels(optics)
        photo[..., 0], photo[..., 1] = pixels.rows[:, None], pixels.columns
    meta = ExampleMeta("p", "t", 0, "indoor", "val_indoor", "paper", camera, "CC0", "p", details)
    return Example("k", photo, SPHERES, meta)


@pytest.mark.parametrize(
    ("example", "fov_rad"),
    [
        (seen_by("paper"), PHONES["paper"].vertical_fov_rad),
        (seen_by(FAMILY, NARROW), PHONES["paper"].vertical_fov_rad),
        (seen_by(KEPT, WIDE), WIDE.view_fov_rad),
    ],
)
def test_a_frame_says_how_its_camera_was_held(example: Example, fov_rad: float) -> None:
    view = viewpoint(example, 192, 135)
    assert view.camera.vertical_fov_rad == pytest.approx(fov_rad)
    assert (view.pitch_rad, view.roll_rad) == pytest.approx((-0.3, 0.1))


@pytest.mark.parametrize("optics", [NARROW, WIDE])
def test_repeated_edges_are_no_part_of_the_photo(optics: Optics) -> None:
    """Each row and column once; the part lies where the lens showed it, within two pixels."""
    part, plane = shown_part(seen_by(FAMILY, optics))
    for line in (part[:, 0, 0], part[0, :, 1]):
        np.testing.assert_array_equal(line, np.arange(len(line)))
    wide, high = (tangent / optics.view_scale for tangent in optics.tangents)
    pixel = 2 * plane.right / part.shape[1]
    whole, _ = shown_part(seen_by("paper"))
    assert plane.right == -plane.left == pytest.approx(min(wide, 67.5 * pixel), abs=2 * pixel)
    assert plane.top == pytest.approx(min(high, np.tan(np.radians(33))), abs=2 * pixel)
    assert whole.shape == (192, 135, 3)
