"""Rotations from pictures alone, of pans whose rotations are known."""

from functools import lru_cache

import cv2
import numpy as np

import made_up_pans
from deeplight.frames import world_from_camera
from deeplight.fuse.poses import angle_between
from deeplight.fuse.track import Tracked, track
from lab.pans import Pan, Troubles

FOV = float(np.radians(66))


@lru_cache
def pan() -> Pan:
    return made_up_pans.pan(15, Troubles(people=2, blur_rad=0.004))


@lru_cache
def finely() -> Pan:
    return made_up_pans.pan(40, Troubles())


def tracked(pictures: list[np.ndarray]) -> Tracked:
    return track(pictures, [FOV] * len(pictures), fov_known=True)


def errors(found: Tracked, truth: Pan) -> np.ndarray:
    first = truth.frames[min(found.rotations)].rotation
    return np.degrees(
        [
            angle_between(first.T @ truth.frames[k].rotation, turn)
            for k, turn in found.rotations.items()
        ]
    )


def test_a_full_turn_closes() -> None:
    found = tracked([frame.pixels for frame in pan().frames])
    assert len(found.rotations) == 15
    assert errors(found, pan()).max() < 0.5


def test_pictures_out_of_order_find_each_other() -> None:
    order = [3, 4, 5, 6, 10, 11, 12, 7, 8, 9]
    found = tracked([pan().frames[k].pixels for k in order])
    assert len(found.rotations) == len(order)
    first = pan().frames[order[0]].rotation
    off = [
        angle_between(first.T @ pan().frames[order[k]].rotation, t)
        for k, t in found.rotations.items()
    ]
    assert np.degrees(max(off)) < 0.5


def test_the_field_of_view_is_refined() -> None:
    guessed = float(np.radians(58))
    found = track([frame.pixels for frame in pan().frames], [guessed] * 15, fov_known=False)
    assert abs(np.degrees(2 * np.arctan(np.tan(guessed / 2) * found.scale)) - 66) < 1
    assert errors(found, pan()).max() < 1


def lying(picture: np.ndarray) -> np.ndarray:
    """The middle of a picture, wider than high."""
    rows, columns, _ = picture.shape
    height = columns * 5 // 6
    return picture[(rows - height) // 2 : (rows + height) // 2]


def test_pictures_of_several_fields_of_view_are_placed_together() -> None:
    upright = [frame.pixels for frame in pan().frames[:5]]
    pictures = [lying(one) if k % 2 else one for k, one in enumerate(upright)]
    heights = [one.shape[0] / upright[0].shape[0] for one in pictures]
    fovs = [2 * float(np.arctan(np.tan(FOV / 2) * height)) for height in heights]
    found = track(pictures, fovs, fov_known=True)
    assert len(found.rotations) == 5
    assert errors(found, pan()).max() < 0.5
    alike = track(pictures, [FOV] * 5, fov_known=True)
    assert len(alike.rotations) < 5


def zoomed(picture: np.ndarray, factor: float) -> np.ndarray:
    """Its middle, as large as all of it was."""
    rows, columns, _ = picture.shape
    high, wide = round(rows / factor), round(columns / factor)
    top, left = (rows - high) // 2, (columns - wide) // 2
    return np.asarray(cv2.resize(picture[top : top + high, left : left + wide], (columns, rows)))


def test_each_picture_of_a_zoom_has_its_own_field_of_view() -> None:
    truth = finely()
    zooms = 1 + 0.3 * np.sin(np.linspace(0, np.pi, 10))
    pictures = [zoomed(f.pixels, z) for f, z in zip(truth.frames[:10], zooms, strict=True)]
    found = tracked(pictures)
    np.testing.assert_allclose(list(found.zooms.values()), zooms, rtol=0.03)
    assert errors(found, truth).max() < 1


def test_a_zoom_at_once_is_found_and_none_where_there_is_none() -> None:
    frames = [frame.pixels for frame in finely().frames]
    assert not tracked(frames[:6]).zooms
    zooms = [1.0] * 3 + [1.15] * 3
    found = tracked([zoomed(one, z) for one, z in zip(frames, zooms, strict=False)])
    np.testing.assert_allclose(list(found.zooms.values()), zooms, rtol=0.03)


def test_stretched_pictures_miss_each_other() -> None:
    pictures = [frame.pixels for frame in finely().frames[:16]]
    wide = [np.repeat(picture, 2, axis=1) for picture in pictures]
    plain, stretched = (track(p, [FOV] * 16, fov_known=False) for p in (pictures, wide))
    assert plain.residual_rad < np.radians(0.1)
    assert stretched.residual_rad > np.radians(0.6)


def test_a_picture_from_elsewhere_is_not_placed() -> None:
    pictures = [frame.pixels for frame in pan().frames[:5]]
    pictures.insert(2, np.random.default_rng(0).integers(0, 255, (320, 180, 3)).astype(np.uint8))
    assert sorted(tracked(pictures).rotations) == [0, 1, 3, 4, 5]


def test_blank_pictures_place_nothing() -> None:
    assert tracked([np.full((320, 180, 3), 120, np.uint8)] * 3).rotations == {}


def test_the_error_measure_sees_a_wrong_rotation() -> None:
    found = tracked([frame.pixels for frame in pan().frames[:4]])
    turned = {k: turn @ world_from_camera(0.05 * k) for k, turn in found.rotations.items()}
    assert errors(Tracked(turned, 1.0, 0.0), pan()).max() > 5
