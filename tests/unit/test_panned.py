"""A rendering seen by a camera that has turned is the rendering from there."""

from dataclasses import replace

import numpy as np
import pytest

from deeplight.camera import PinholeCamera
from deeplight.compose.ground import Viewpoint
from deeplight.compose.panned import is_near, seen_from, widened
from deeplight.compose.trace import Layers

VIEW = Viewpoint(PinholeCamera(90, 120, 1.0), pitch_rad=-0.3, roll_rad=0.1)
TURNED = replace(VIEW, pitch_rad=-0.38, yaw_rad=0.12)


def whole(view: Viewpoint) -> Layers:
    """Smooth layers that depend on the direction in the world alone, over the whole picture."""
    camera = view.camera
    x, y, z = np.moveaxis(camera.rays() @ view.world_from_camera.T, -1, 0)
    radiance = np.stack([2 + np.sin(8 * x), 2 + np.cos(6 * y), 2 + np.sin(5 * z + x)], -1)
    crop = 0, 0, camera.width, camera.height
    return Layers(crop, *(a.astype(np.float32) for a in (radiance, 0.5 + y / 2, radiance / 4)))


def test_a_turned_camera_sees_what_is_there() -> None:
    wide = widened(VIEW)
    seen, true = seen_from(whole(wide), wide, TURNED), whole(TURNED)
    assert seen.crop == true.crop
    for name in ("radiance", "cover", "shadow"):
        np.testing.assert_allclose(getattr(seen, name), getattr(true, name), atol=3e-3)
    wrong = seen_from(whole(wide), wide, replace(TURNED, yaw_rad=0.2))
    assert np.abs(wrong.radiance - true.radiance).max() > 0.1


def test_a_widened_camera_has_the_same_pixels_in_its_middle() -> None:
    wide = widened(VIEW)
    seen = seen_from(whole(wide), wide, VIEW)
    np.testing.assert_allclose(seen.radiance, whole(VIEW).radiance, atol=1e-5)


def test_outside_of_what_was_rendered_the_photo_is_unchanged() -> None:
    part = Layers((40, 50, 60, 70), np.ones((20, 20, 3)), np.ones((20, 20)), np.zeros((20, 20, 3)))
    seen = seen_from(part, VIEW, replace(VIEW, yaw_rad=0.05))
    left, top, right, bottom = seen.crop
    assert (right - left, bottom - top) == (pytest.approx(20, abs=4), pytest.approx(20, abs=4))
    assert seen.shadow.max() <= 1
    away = seen_from(part, VIEW, replace(VIEW, yaw_rad=2.0))
    assert not away.cover.any()
    assert (away.shadow == 1).all()


def test_only_what_looks_nearly_the_same_way_is_near() -> None:
    assert is_near(VIEW, TURNED)
    assert not is_near(VIEW, replace(VIEW, yaw_rad=0.4))
