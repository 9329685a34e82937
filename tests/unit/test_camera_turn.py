"""After a full turn of the camera an object stands where it stood."""

from collections.abc import Iterable
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

pytest.importorskip("cv2")

from deeplight.camera import PinholeCamera
from deeplight.compose.camera_turn import CameraTurn, named_ranges
from deeplight.compose.follow import Follower, turned_to
from deeplight.compose.ground import Viewpoint, viewpoint_turned
from deeplight.compose.look import blurred
from deeplight.errors import ConfigError
from deeplight.frames import turned
from deeplight.fuse.poses import angle_between
from deeplight.mappings import resample

FRAMES = 60  # 6 degrees from one to the next; the last two see the first one's place again
TRUE = Viewpoint(PinholeCamera(180, 240, np.radians(66)), 1.4, np.radians(-10))
AT = (90.0, 190.0)


@lru_cache
def panorama() -> np.ndarray:
    """Something to see everywhere, of all sizes."""
    rng = np.random.default_rng(0)
    layers = [
        blurred(rng.random((360, 720, 1)).astype(np.float32) - 0.5, sigma) * sigma
        for sigma in (1.5, 4, 10)
    ]
    total = np.sum(layers, axis=0)
    return np.clip(128 + 55 * total / total.std(), 0, 255).astype(np.float32)


@lru_cache
def views() -> list[Viewpoint]:
    """A full turn in a hand that shakes."""
    rng = np.random.default_rng(1)
    shake = rng.normal(0, 0.012, (FRAMES, 3)) * (np.arange(FRAMES)[:, None] > 0)
    return [
        replace(
            TRUE,
            yaw_rad=2 * np.pi * k / FRAMES + yaw,
            pitch_rad=TRUE.pitch_rad + pitch,
            roll_rad=roll,
        )
        for k, (yaw, pitch, roll) in enumerate(shake)
    ]


def seen(view: Viewpoint) -> np.ndarray:
    rays = turned(TRUE.camera.rays(), view.world_from_camera).astype(np.float32)
    return resample.sample_latlong(panorama(), rays)[..., 0].astype(np.uint8)


@lru_cache
def pictures() -> list[np.ndarray]:
    """What is seen on the way."""
    return [seen(view) for view in views()]


def true_places() -> np.ndarray:
    """Where the place is seen, nan behind the camera."""
    point = TRUE.point(*AT)
    return np.stack([view.pixels(point[None])[0] for view in views()])


def believed(pitch_deg: float, fov_deg: float) -> Viewpoint:
    """What one takes the first camera for."""
    return Viewpoint(PinholeCamera(180, 240, np.radians(fov_deg)), 1.4, np.radians(pitch_deg))


def composed(first: Viewpoint, frames: Iterable[np.ndarray]) -> tuple[np.ndarray, list[int]]:
    """Where an object would be drawn, and the frames without a camera."""
    anchor = first.point(*AT)
    camera = CameraTurn(first, anchor)
    places = [camera.update(frame).pixels(anchor[None])[0] for frame in frames]
    return np.stack(places), camera.lost


def misses(places: np.ndarray) -> np.ndarray:
    """Pixels by which a place that is in the picture is missed, nan where it is not."""
    true = true_places()
    inside = ((true >= 0) & (true <= [180, 240])).all(1)
    off = np.nan_to_num(np.linalg.norm(places - true, axis=1), nan=1e3)
    assert inside[:2].all()
    assert inside[-2:].all()
    assert not inside[10:50].any()
    return np.where(inside, off, np.nan)


@pytest.mark.parametrize(("pitch_deg", "fov_deg"), [(-10, 66), (-16, 66), (-10, 60)])
def test_after_a_full_turn_the_object_stands_where_it_stood(
    pitch_deg: float, fov_deg: float
) -> None:
    places, lost = composed(believed(pitch_deg, fov_deg), pictures())
    assert not lost
    assert np.nanmax(misses(places)) < 3


def test_its_place_alone_is_not_found_again() -> None:
    anchor, now, follower = TRUE.point(*AT), TRUE, None
    places = []
    for frame in pictures():
        follower = follower or Follower(frame.astype(np.float32), *AT)
        at = follower.update(frame.astype(np.float32))
        now = now if at is None else turned_to(now, anchor, *at)
        places.append(now.pixels(anchor[None])[0])
    assert np.nanmax(misses(np.stack(places))[-2:]) > 40


def test_what_blurred_frames_were_off_by_is_gone_where_it_began() -> None:
    swing = np.radians([0, 12, 0, -12, 0])
    parts = np.radians(np.linspace(-3, 3, 9))
    follower = Follower(seen(TRUE).astype(np.float32), *AT)
    for yaw in swing:
        views = [seen(replace(TRUE, yaw_rad=yaw + part)) for part in parts]
        follower.update(np.mean(views, axis=0))
    found = follower.update(seen(TRUE).astype(np.float32))
    assert found is not None
    assert np.hypot(*np.subtract(found, AT)) < 0.5


def test_the_camera_does_not_drift_over_a_full_turn() -> None:
    camera = CameraTurn(TRUE, TRUE.point(*AT))
    for frame, view in zip(pictures(), views(), strict=True):
        found = camera.update(frame).world_from_camera
        assert angle_between(found, view.world_from_camera) < np.radians(1.5)


def test_frames_that_show_nothing_are_named_and_the_place_is_found_after_them() -> None:
    blind = range(20, 24)
    frames = (
        np.full_like(frame, 90) if k in blind else frame for k, frame in enumerate(pictures())
    )
    places, lost = composed(TRUE, frames)
    assert set(blind) <= set(lost)
    assert 59 not in lost
    assert np.nanmax(misses(places)) < 3


def test_frames_in_which_something_hides_the_place_are_named() -> None:
    yaws = [0.02 * k for k in range(9)]
    frames = [seen(replace(TRUE, yaw_rad=yaw)) for yaw in yaws]
    rng = np.random.default_rng(2)
    for frame in frames[4:6]:
        frame[120:, :] = rng.integers(0, 255, (120, 180))
    camera = CameraTurn(TRUE, TRUE.point(*AT))
    turns = [camera.update(frame).yaw_rad for frame in frames]
    assert not camera.lost
    assert 4 in camera.hidden
    assert set(camera.hidden) <= {4, 5, 6}
    assert not camera.blurred
    np.testing.assert_allclose(turns, yaws, atol=0.02)


@pytest.mark.parametrize("step_deg", [14, 19])
def test_a_camera_that_moves_fast_hides_nothing(step_deg: float) -> None:
    yaws = np.radians([0, step_deg, 0, -step_deg, 0])
    camera = CameraTurn(TRUE, TRUE.point(*AT))
    turns = [camera.update(seen(replace(TRUE, yaw_rad=yaw))).yaw_rad for yaw in yaws]
    assert not camera.lost + camera.hidden + camera.blurred
    np.testing.assert_allclose(turns, yaws, atol=0.01)


def test_frames_blurred_by_a_fast_turn_are_named_so() -> None:
    camera = CameraTurn(TRUE, TRUE.point(*AT))
    for k, blur_deg in enumerate((0, 0, 5, 0)):
        parts = np.radians(k + np.linspace(-blur_deg / 2, blur_deg / 2, 15))
        frame = np.mean([seen(replace(TRUE, yaw_rad=yaw)) for yaw in parts], axis=0)
        camera.update(frame.astype(np.uint8))
    assert camera.blurred == [2]
    assert not camera.lost + camera.hidden


def test_another_place_between_two_cuts_is_named_and_leaves_no_trace() -> None:
    here = [seen(replace(TRUE, yaw_rad=0.02 * k)) for k in range(4)]
    elsewhere = [seen(replace(TRUE, yaw_rad=np.pi + 0.02 * k)) for k in range(3)]
    camera = CameraTurn(TRUE, TRUE.point(*AT))
    turns = [camera.update(frame).yaw_rad for frame in (*here, *elsewhere, *here)]
    assert camera.lost == [4, 5, 6]
    np.testing.assert_allclose(turns[7:], 0.02 * np.arange(4), atol=0.01)


@pytest.mark.parametrize(("pitch_deg", "fov_deg"), [(-10, 66), (-16, 62)])
def test_somebody_who_walks_through_does_not_take_the_object_along(
    pitch_deg: float, fov_deg: float
) -> None:
    filmed = [replace(TRUE, yaw_rad=0.01 * k) for k in range(12)]
    frames = [seen(view) for view in filmed]
    for k, frame in enumerate(frames):
        frame[60:, max(0, 15 * k - 20) : 15 * k + 25] = 30
    places, lost = composed(believed(pitch_deg, fov_deg), frames)
    assert not lost
    true = np.stack([view.pixels(TRUE.point(*AT)[None])[0] for view in filmed])
    assert np.linalg.norm(places - true, axis=1).max() < 3.5


def test_the_camera_is_rolled_as_the_picture_is() -> None:
    camera = CameraTurn(TRUE, TRUE.point(*AT))
    for roll in np.radians([0, 6, 12, 18, 24, 18, 6, 0]):
        view = replace(TRUE, roll_rad=roll)
        found = camera.update(seen(view)).world_from_camera
        assert angle_between(found, view.world_from_camera) < np.radians(1.5)


@pytest.mark.parametrize("roll", [-0.4, 0.0, 1.2])
def test_a_rotation_gives_the_viewpoint_that_has_it(roll: float) -> None:
    view = replace(TRUE, yaw_rad=2.0, pitch_rad=0.7, roll_rad=roll)
    found = viewpoint_turned(TRUE, view.world_from_camera)
    np.testing.assert_allclose(found.world_from_camera, view.world_from_camera, atol=1e-9)
    with pytest.raises(ConfigError):
        viewpoint_turned(TRUE, view.world_from_camera @ np.diag([-1.0, -1.0, 1.0]))


def test_numbers_are_named_in_runs() -> None:
    assert named_ranges([]) == ""
    assert named_ranges([3, 4, 5, 8]) == "3-5, 8"
