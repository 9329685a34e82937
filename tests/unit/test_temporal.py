"""Flicker: light that stands still in the room does not flicker, whatever the camera does."""

from dataclasses import replace

import numpy as np
import pytest

from deeplight.evaluate.scores import TRUE_LIGHTING, Report
from deeplight.evaluate.temporal import changes, flicker, neighbours, runs_of_frames, step
from deeplight.frames import turned, world_from_camera
from deeplight.mappings import mirror_ball

POSES = np.stack([world_from_camera(0.35 * n, -0.2 + 0.03 * n) for n in range(4)])


def smooth(directions: np.ndarray) -> np.ndarray:
    """ln radiance of a room that changes slowly with direction, world frame."""
    level = 0.8 * directions[..., 1] + 0.5 * directions[..., 0]
    return np.stack([level, 0.5 * level, level - 1], -1).astype(np.float32)


def seen(pose: np.ndarray) -> np.ndarray:
    """That room in the camera's frame."""
    return smooth(turned(mirror_ball.pixel_directions(32), pose))


def report(answers: dict[str, np.ndarray]) -> Report:
    count = len(POSES)
    none = np.zeros(count)
    return Report(
        "val",
        np.arange(count),
        tuple(f"k{n}" for n in range(count)),
        np.array(["a", "a", "b", "b"]),
        np.array(["indoor"] * count),
        none,
        {},
        none,
        np.array(["t"] * count),
        np.arange(count),
        POSES,
        answers,
    )


STILL = np.stack([seen(pose) for pose in POSES])
BRIGHTER = STILL + np.log(2) * (np.arange(4) % 2)[:, None, None, None].astype(np.float32)
FIXED_TO_CAMERA = np.stack([STILL[0]] * 4)


def test_without_a_turn_the_same_light_does_not_change() -> None:
    random = np.random.default_rng(0).normal(size=(32, 32, 3)).astype(np.float32)
    assert step(random, random, np.eye(3))[mirror_ball.coverage(32) > 0] == pytest.approx(
        0, abs=1e-5
    )
    twice = step(random, random + np.float32(np.log(2)), np.eye(3))
    assert twice[mirror_ball.coverage(32) > 0] == pytest.approx(1, abs=1e-5)


def test_light_that_stands_still_in_the_room_hardly_flickers() -> None:
    found = {
        f.estimator: f
        for f in flicker(
            changes(
                report(
                    {
                        "still": STILL,
                        "stuck": FIXED_TO_CAMERA,
                        "blinking": BRIGHTER,
                        TRUE_LIGHTING: STILL,
                    }
                )
            ),
            np.array(["a", "a", "b", "b"]),
            50,
        )
    }
    assert found["still"].change.value < 0.05
    assert found["stuck"].change.value > 2 * found["still"].change.value
    assert found["blinking"].change.value == pytest.approx(1, abs=0.05)
    assert found["blinking"].error.value == pytest.approx(1, abs=1e-4)
    assert found["still"].error.value == 0
    assert found["still"].pairs == 3
    assert found["stuck"].true_change == found["still"].change


def test_turning_the_wrong_way_would_be_seen() -> None:
    right = step(STILL[0], STILL[3], POSES[3].T @ POSES[0])
    wrong = step(STILL[0], STILL[3], POSES[0].T @ POSES[3])
    inside = mirror_ball.coverage(32) > 0
    assert np.abs(wrong[inside]).mean() > 3 * np.abs(right[inside]).mean()


def test_neighbours_are_of_one_take_and_of_known_poses() -> None:
    whole = report({})
    assert neighbours(whole).tolist() == [[0, 1], [1, 2], [2, 3]]
    gap = replace(whole, frames=np.array([0, 1, 5, 6]))
    assert neighbours(gap).tolist() == [[0, 1], [2, 3]]
    two = replace(whole, takes=np.array(["t", "t", "u", "u"]), frames=np.array([0, 1, 1, 2]))
    assert neighbours(two).tolist() == [[0, 1], [2, 3]]
    unknown = whole.world_from_camera.copy()
    unknown[1] = np.nan
    assert neighbours(replace(whole, world_from_camera=unknown)).tolist() == [[2, 3]]


def test_runs_start_where_a_take_starts_and_are_at_most_four_long() -> None:
    assert [run.tolist() for run in runs_of_frames(report({}), neighbours(report({})))] == [
        [0, 1, 2, 3]
    ]
    assert [r.tolist() for r in runs_of_frames(report({}), neighbours(report({})), 2)] == [[0, 1]]
    assert runs_of_frames(report({}), np.zeros((0, 2), np.int64)) == []
