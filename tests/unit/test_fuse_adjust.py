"""Rotations of cameras that strayed while they turned, from exact matches in a made-up room."""

import numpy as np
import pytest

from deeplight.frames import Rotation, exponential, world_from_camera
from deeplight.fuse.adjust import Free, Pair, adjusted
from deeplight.fuse.poses import angle_between

PICTURES, POINTS = 18, 3000
LOW, HIGH = np.array([-2.0, -1.5, -3.0]), np.array([3.0, 1.3, 4.0])
HALF = np.tan(np.radians(33)) * np.array([0.6, 1.0])
TURNS = {k: world_from_camera(2 * np.pi * k / PICTURES, -0.1) for k in range(PICTURES)}


def walls(rng: np.random.Generator, points: int) -> np.ndarray:
    """Points on the walls of a box round the origin, m."""
    rays = rng.normal(size=(points, 3))
    reach = np.where(rays > 0, HIGH / rays, LOW / rays).min(1, keepdims=True)
    return np.asarray(reach * rays)


def places(reach_m: float) -> np.ndarray:
    """Where the camera is in each picture: on a wobble back to where it began."""
    angle = np.arange(PICTURES)[:, None] * (2 * np.pi / PICTURES) * np.array([1, 2, 1])
    return np.asarray(reach_m * np.sin(angle + np.array([0, 0, 1])) / np.sqrt(3))


def pairs(reach_m: float, noise: float = 5e-4, count: int = POINTS) -> list[Pair]:
    """What neighbours in time both show, as their planes at distance 1."""
    rng = np.random.default_rng(4)
    points, at = walls(rng, count), places(reach_m)
    planes, shown = [], []
    for k, turn in TURNS.items():
        own = (points - at[k]) @ turn
        planes.append(own[:, :2] / -own[:, 2:] + rng.normal(0, noise, (count, 2)))
        shown.append((own[:, 2] < 0) & (np.abs(planes[-1]) < HALF).all(1))
    found = []
    for i in range(PICTURES):
        for j in ((i + step) % PICTURES for step in (1, 2, 3)):
            both = shown[i] & shown[j]
            if both.sum() > 8:
                turn = TURNS[i].T @ TURNS[j]
                found.append(Pair(i, j, planes[i][both], planes[j][both], turn))
    return found


def worst(found: dict[int, Rotation]) -> float:
    """Largest error, degrees."""
    first = TURNS[0].T
    return max(
        float(np.degrees(angle_between(first @ TURNS[k], turn))) for k, turn in found.items()
    )


def begun() -> dict[int, Rotation]:
    rng = np.random.default_rng(5)
    return {k: turn @ exponential(rng.normal(0, 0.02, 3)) for k, turn in TURNS.items()}


@pytest.mark.parametrize(("stray", "most", "times"), [(0.3, 2.5, 2), (0.1, 1, 4)])
def test_where_the_camera_strayed_rotations_are_better_with_its_places(
    stray: float, most: float, times: float
) -> None:
    matches = pairs(stray)
    rotations, _, _ = adjusted(matches, begun(), Free(scale=False, places=True))
    alone, _, _ = adjusted(matches, begun(), Free(scale=False, places=False))
    assert worst(rotations) < most
    assert worst(alone) > times * worst(rotations)


def test_where_it_did_not_nothing_changes() -> None:
    matches = pairs(0.0)
    both = [
        adjusted(matches, begun(), Free(scale=False, places=places))[0] for places in (True, False)
    ]
    for k in TURNS:
        np.testing.assert_array_equal(both[0][k], both[1][k])
    assert worst(both[0]) < 0.1


def test_the_focal_length_is_found() -> None:
    matches = [
        Pair(p.first, p.second, p.one * 0.9, p.other * 0.9, p.first_from_second) for p in pairs(0.0)
    ]
    rotations, scale, _ = adjusted(matches, begun(), Free(scale=True, places=True))
    assert abs(scale * 0.9 - 1) < 0.01
    assert worst(rotations) < 0.2
    kept, one, _ = adjusted(matches, begun(), Free(scale=False, places=False))
    assert one == 1
    assert worst(kept) > worst(rotations)


def open_turn(
    reach_m: float, noise: float, points: int = POINTS, pictures: int = 15
) -> tuple[list[Pair], dict[int, Rotation]]:
    """Matches of the first pictures only, and rotations to begin with."""
    turns = {k: turn for k, turn in begun().items() if k < pictures}
    matches = pairs(reach_m, noise, points)
    return [p for p in matches if max(p.first, p.second) < pictures and p.first < p.second], turns


def test_of_an_open_turn_noise_makes_the_field_of_view_no_smaller() -> None:
    matches, turns = open_turn(0.0, 3e-3, 20_000, PICTURES // 2)
    rotations, scale, _ = adjusted(matches, turns, Free(scale=True, places=False))
    assert abs(scale - 1) < 0.01
    assert worst(rotations) < 1


def test_a_small_step_in_an_open_turn_is_not_solved_for() -> None:
    matches, turns = open_turn(0.05, 1e-3)
    rotations, scale, _ = adjusted(matches, turns, Free(scale=True, places=True))
    assert abs(scale - 1) < 0.005
    assert worst(rotations) < 3
