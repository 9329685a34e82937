"""Simulated pans: what is filmed agrees with the truth that comes with it."""

from dataclasses import replace

import numpy as np
import pytest

from deeplight.camera_response import decode
from deeplight.frames import turned
from deeplight.mappings import latlong
from deeplight.mappings.resample import sample_latlong
from lab.pans import Pan, Sweep, Troubles, film_pan, stepped_in_box

pytestmark = pytest.mark.needs("cv2")

IDEAL = Troubles(shake_rad=0.0, response=False)
SWEEP = Sweep(frames=4, pitches_deg=(-10.0, 30.0))


def place() -> np.ndarray:
    rng = np.random.default_rng(3)
    coarse = np.exp(rng.normal(0, 0.7, (8, 16, 3))).astype(np.float32)
    return np.kron(coarse, np.ones((8, 8, 1), np.float32))


def pan(troubles: Troubles, seed: int = 5, **changes: object) -> Pan:
    sweep = replace(SWEEP, **changes)  # type: ignore[arg-type]
    return film_pan(place(), sweep, troubles, np.random.default_rng(seed), (96, 54))


def unclipped_error(filmed: Pan, number: int) -> float:
    """Median ratio error of pixels against the truth of the first frame, through all rotations."""
    frame = filmed.frames[number]
    first_from_this = filmed.frames[0].rotation.T @ frame.rotation
    rays = turned(filmed.camera.rays().astype(np.float32), first_from_this)
    wanted = sample_latlong(filmed.truth(), rays)
    gain = np.exp(frame.log_gain - filmed.frames[0].log_gain)
    known = (frame.pixels < 250) & (frame.pixels > 20)
    own = decode(frame.pixels / np.float32(255)) / gain
    return float(np.median(np.abs(np.log(own / wanted))[known]))


def test_pixels_are_the_truth_behind_rotation_and_gain() -> None:
    filmed = pan(IDEAL)
    assert max(unclipped_error(filmed, k) for k in range(len(filmed.frames))) < 0.02


def test_a_wrong_rotation_shows() -> None:
    filmed = pan(IDEAL)
    wrong = replace(filmed.frames[2], rotation=filmed.frames[3].rotation)
    assert unclipped_error(replace(filmed, frames=[*filmed.frames[:2], wrong]), 2) > 0.1


def test_the_seed_decides_everything() -> None:
    one, same, other = (pan(Troubles(people=1, step_m=0.2), seed) for seed in (1, 1, 2))
    assert all((a.pixels == b.pixels).all() for a, b in zip(one.frames, same.frames, strict=True))
    assert not np.array_equal(one.frames[0].pixels, other.frames[0].pixels)


def test_in_a_box_what_is_near_moves_more_than_what_is_far() -> None:
    step = np.array([0.0, 0.0, -0.1])  # past the walls on the left, 2 m away, and right, 3 m
    columns = latlong.directions(64, 128)
    moved = stepped_in_box(columns, step)
    shift = np.degrees(np.arccos(np.clip((moved * columns).sum(-1), -1, 1)))
    left, right, ahead = (shift[32, k] for k in (32, 96, 64))
    assert columns[32, 32, 0] < -0.99 < 0.99 < columns[32, 96, 0]
    assert left == pytest.approx(np.degrees(np.arctan(0.3 / 2)), abs=0.5)
    assert right == pytest.approx(np.degrees(np.arctan(0.3 / 3)), abs=0.5)
    assert ahead < 1.5


def test_brackets_differ_by_their_stops() -> None:
    filmed = pan(replace(IDEAL, exposure=0.0), bracket_stops=(0.0, -2.0))
    first, second = (frame.log_gain for frame in filmed.frames[:2])
    np.testing.assert_allclose(second - first, -2 * np.log(2), atol=1e-6)


def test_dropped_frames_are_missing() -> None:
    assert len(pan(replace(IDEAL, dropped=0.5)).frames) < 8
