"""Frames of several cameras, and of one held both ways, each have their own field of view."""

from math import atan, radians, tan

import numpy as np
import pytest

from deeplight.errors import InputError
from deeplight.fuse.frame import SourceFrame, with_fields_of_view
from deeplight.fuse.fuse import fuse_views

pytestmark = pytest.mark.needs("cv2")

UPRIGHT, LYING = (400, 300), (300, 400)


def frame(shape: tuple[int, int], fov_deg: float | None = None, part: bool = False) -> SourceFrame:
    turn = np.eye(3) if part else None
    fov = fov_deg and radians(fov_deg)
    pixels = np.zeros((*shape, 3), np.uint8)
    return SourceFrame("", pixels, 0, vertical_fov_rad=fov, world_from_camera=turn)


def fovs(frames: list[SourceFrame], fov_deg: float | None = None) -> list[float]:
    found = with_fields_of_view(frames, fov_deg and radians(fov_deg))
    return [radians(0) if f.vertical_fov_rad is None else f.vertical_fov_rad for f in found]


def test_each_photo_keeps_what_its_file_says() -> None:
    assert fovs([frame(UPRIGHT, 67), frame(LYING, 90)]) == [radians(67), radians(90)]


@pytest.mark.parametrize("first", [0, 1])
def test_what_says_nothing_is_the_same_camera_held_either_way(first: int) -> None:
    known, unknown = frame(UPRIGHT, 67), frame(LYING)
    found = fovs([known, unknown][:: 1 - 2 * first])
    assert found[first] == pytest.approx(radians(67))
    assert found[1 - first] == pytest.approx(2 * atan(tan(radians(67) / 2) * 3 / 4))


def test_a_given_one_is_of_all_but_parts_of_panoramas() -> None:
    given = fovs([frame(UPRIGHT, 67), frame(UPRIGHT, 90), frame(UPRIGHT, 40, part=True)], 50)
    assert given == pytest.approx([radians(50), radians(50), radians(40)])


def test_where_a_file_says_otherwise_a_line_says_which_is_used() -> None:
    frames = [frame(UPRIGHT), frame(UPRIGHT, 67), frame(UPRIGHT, 68), frame(UPRIGHT, 40, part=True)]
    notes = {note for f in with_fields_of_view(frames, radians(50)) for note in f.notes}
    (note,) = notes
    for part in ("50 degrees as given", "67", "1 more"):
        assert part in note
    for given in (None, 67.5):
        assert not any(f.notes for f in with_fields_of_view(frames, given and radians(given)))


def test_without_any_word_nothing_is_known() -> None:
    assert fovs([frame(UPRIGHT), frame(LYING)]) == [0, 0]


@pytest.mark.parametrize("photos", [0, 2])
def test_as_many_rotations_as_photos(photos: int) -> None:
    with pytest.raises(InputError):
        fuse_views([np.zeros((40, 30, 3), np.uint8)] * photos, [np.eye(3)] * photos or None)
    with pytest.raises(InputError, match="rotation for each photo"):
        fuse_views([np.zeros((40, 30, 3), np.uint8)] * photos, [np.eye(3)])
