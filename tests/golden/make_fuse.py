"""Make what a port of `Session` must give: python tests/golden/make_fuse.py.

Frames and estimates are formulas, so that any language can make them again; see `frame` and
`estimate`. `fuse.json` holds what Python made of them, after each step of a session.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np

from deeplight.frames import world_from_camera
from deeplight.fuse.gains import overlaps
from deeplight.fuse.merge import expected_power, likely_factor
from deeplight.fuse.session import Session
from deeplight.mappings import mirror_ball

GOLDEN = Path(__file__).with_name("fuse.json")
FOV_RAD, HEIGHT, WIDTH, ROWS = 1.15, 96, 54, 16
POSES = ((0.0, -0.1, 0.02), (0.2, -0.05, 0.0), (0.4, -0.15, -0.03), (0.02, 0.1, 0.0))
"""Yaw, pitch and roll of `world_from_camera` for each frame."""


FACTORS = (
    (1.0, 0.0, 2.7, 4.0),
    (1.0, 2.0, 2.0, 4.0),
    (0.5, 3.0, 9.0, 10.0),
    (2.0, 0.1, 0.2, 4.0),
    (0.01, 3.0, 40.0, 10.0),
)
"""Powers of what clips, of the rest and of the whole, and the usual factor."""
STEADY_ESTIMATES = (5, -5, 20, 0)
"""Estimates that the frames get in turn, so that what is believed moves up and down."""
BRIGHTER = 70
"""Levels by which the frames of the second light are brighter: there, much of the sky clips."""


def frame(number: int, brighter: int = 0) -> np.ndarray:
    """8-bit pixels: a smooth sky in world directions under this frame's gain, clipped at 255."""
    yaw, pitch, _ = POSES[number]
    column, row = (np.arange(n) for n in (WIDTH, HEIGHT))
    across, down = (column - 27) / 48 - yaw, (row - 48) / 72 - pitch
    wave = np.sin(3 * across)[None, :] + np.cos(3 * down)[:, None]
    value = 135 + 40 * wave[..., None] + 12 * number * np.array([1.0, 0.5, 0.0]) + np.arange(3) * 9
    return np.floor(np.clip(value + brighter, 0, 255)).astype(np.uint8)


def estimate(number: int) -> np.ndarray:
    """ln radiance on the ball: brighter above, and one warmer lamp on the right behind."""
    directions = mirror_ball.pixel_directions(32)
    lamp = np.exp(30 * (directions @ np.array([0.8, 0.36, 0.48]) - 1))[..., None]
    value = -1.0 + 0.4 * directions[..., 1:2] + 0.1 * number + lamp * np.array([2.0, 1.8, 1.5])
    return np.asarray(value, np.float32)


def kept_of_a_slow_turn() -> list[int]:
    """Numbers of the frames that a session keeps while one turns by a radian in 50 steps."""
    session = Session(FOV_RAD, lambda _: estimate(0))
    for number in range(50):
        session.add(frame(0), world_from_camera(0.02 * number, 0.0), estimate(0))
    return [view.number for view in session.views]


def other_place(number: int) -> np.ndarray:
    """8-bit pixels of blocks; below 0 as dark as a covered lens."""
    row, column = np.arange(HEIGHT)[:, None] // 8, np.arange(WIDTH)[None] // 8
    value = 20 + 20 * ((7 * row + 13 * column + number * row * column) % 11)
    shown = value if number >= 0 else value // 40
    return np.repeat(shown[..., None], 3, 2).astype(np.uint8)


CHANGES = ((1, 0), (1, 0), (-1, 1), (-1, 1), (-1, 1), (1, 0), (3, 1), (3, 1), (3, 1), (3, 0))
"""Number of `other_place` and of the pose of each frame: a lens that is covered, then a cut."""


def changes() -> list[dict[str, Any]]:
    """What a session makes of frames in which the place is covered and left."""
    session, steps = Session(FOV_RAD, lambda _: estimate(0)), []
    for number, pose in CHANGES:
        turn = world_from_camera(*POSES[pose])
        added = session.add(other_place(number), turn, estimate(0))
        steps.append(
            {
                "views": added.views,
                "forgotten": added.forgotten,
                "disagreement": round(added.disagreement, 6),
            }
        )
    return steps


def golden() -> dict[str, Any]:
    """What Python makes of the frames."""
    session = Session(FOV_RAD, lambda _: estimate(0))
    steps = []
    for number, pose in enumerate(POSES):
        added = session.add(frame(number), world_from_camera(*pose), estimate(number))
        steps.append(
            {
                "views": added.views,
                "disagreement": round(added.disagreement, 6),
                "log_gain": np.round(added.log_gain, 6).tolist(),
            }
        )
    (a, a_weight), (b, b_weight) = (session.views[k].cells() for k in (0, 1))
    shared = overlaps(b, b_weight, a[None], a_weight[None])
    found = session.environment(height=ROWS)
    assert found.seen is not None
    bright = Session(FOV_RAD, lambda _: estimate(0))
    for number, pose in enumerate(POSES):
        bright.add(frame(number, BRIGHTER), world_from_camera(*pose), estimate(number))
    return {
        "vertical_fov_rad": FOV_RAD,
        "kept_of_a_slow_turn": kept_of_a_slow_turn(),
        "poses": POSES,
        "changes": [[*change, step] for change, step in zip(CHANGES, changes(), strict=True)],
        "pixels_of_frame_1_row_48": frame(1)[48].tolist(),
        "steps": steps,
        "cells_of_frame_0": _sampled(a, a_weight),
        "overlap_of_frames_1_and_0": {
            "difference": np.round(shared.difference[0], 6).tolist(),
            "weight": np.round(shared.weight[0], 6).tolist(),
        },
        "gains": np.round(session.gains, 6).tolist(),
        "expected_power": np.round(expected_power(session.views, session.gains), 5).tolist(),
        "environment": np.round(found.radiance, 5).tolist(),
        "seen": np.round(found.seen, 5).tolist(),
        "environment_that_clips": np.round(bright.environment(height=ROWS).radiance, 5).tolist(),
        "steady_estimates": STEADY_ESTIMATES,
        "steady_environments": steady_environments(),
        "likely_factors": [[*f, round(likely_factor(*f), 6)] for f in FACTORS],
    }


def steady_environments() -> list[Any]:
    """What is shown after each frame, in its camera and white."""
    session = Session(FOV_RAD, lambda _: estimate(0))
    shown = []
    for number, (pose, own) in enumerate(zip(POSES, STEADY_ESTIMATES, strict=True)):
        turn = world_from_camera(*pose)
        added = session.add(frame(number), turn, estimate(own))
        light = session.environment(turn, added.log_gain, ROWS // 2, steady=True)
        shown.append(np.round(light.radiance, 5).tolist())
    return shown


def _sampled(logs: np.ndarray, weights: np.ndarray) -> list[dict[str, Any]]:
    """Every 60th cell that was seen."""
    seen = np.flatnonzero(weights.any(1))[::60]
    return [
        {
            "cell": int(k),
            "log": np.round(logs[k], 5).tolist(),
            "weight": np.round(weights[k], 8).tolist(),
        }
        for k in seen
    ]


if __name__ == "__main__":
    GOLDEN.write_text(json.dumps(golden()) + "\n", encoding="utf-8")
