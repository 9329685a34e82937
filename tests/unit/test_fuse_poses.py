"""Pose files: each tool's axes, known phones in known positions, and what is refused."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deeplight.errors import ConfigError
from deeplight.frames import Rotation, exponential, from_quaternion, rotation, world_from_camera
from deeplight.fuse.poses import between, logarithm, read_poses

TURN = world_from_camera(0.7, -0.3, 0.1)

# A phone held upright looking along -Z of the world, home button below. ARKit's camera: +X runs
# down the phone (world -Y), +Z out of the screen (world +Z), so +Y points right (world +X).
ARKIT_UPRIGHT = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])


def written(path: Path, frames: list[dict[str, Any]], **header: Any) -> Path:
    file = path / "poses.json"
    file.write_text(json.dumps({"frames": frames, **header}))
    return file


def columns(matrix: Rotation, place: tuple[float, float, float] = (1.0, 2.0, 3.0)) -> list[float]:
    whole = np.eye(4)
    whole[:3, :3], whole[:3, 3] = matrix, place
    return whole.T.ravel().tolist()


def test_arkit_upright(tmp_path: Path) -> None:
    file = written(tmp_path, [{"matrix": columns(ARKIT_UPRIGHT)}], convention="arkit")
    np.testing.assert_allclose(read_poses(file, upright=True).rotations[0], np.eye(3), atol=1e-12)


def test_arkit_lying_with_the_home_button_on_the_right(tmp_path: Path) -> None:
    file = written(tmp_path, [{"matrix": columns(np.eye(3))}], convention="arkit")
    np.testing.assert_allclose(read_poses(file, upright=False).rotations[0], np.eye(3), atol=1e-12)


def test_arkit_without_its_quarter_turn_is_another_rotation(tmp_path: Path) -> None:
    file = written(tmp_path, [{"matrix": columns(ARKIT_UPRIGHT)}], convention="arkit", turned_deg=0)
    assert np.abs(read_poses(file, upright=True).rotations[0] - np.eye(3)).max() > 0.9


def test_arcore_reads_out_lying_and_its_display_pose_follows(tmp_path: Path) -> None:
    sensor = TURN @ rotation("z", -np.pi / 2)  # the sensor's readout, turned clockwise to stand
    for convention, matrix in (("arcore", sensor), ("arcore-display", TURN), ("webxr", TURN)):
        file = written(tmp_path, [{"matrix": columns(matrix)}], convention=convention)
        found = read_poses(file, upright=True).rotations[0]
        np.testing.assert_allclose(found, TURN, atol=1e-9, err_msg=convention)


def test_rotation_matrix_and_quaternion_say_the_same(tmp_path: Path) -> None:
    axis, angle = np.array([1.0, 2.0, -2.0]) / 3, 0.8
    turn = exponential(axis * angle)
    quaternion = [*(axis * np.sin(angle / 2)), np.cos(angle / 2)]
    frames = [{"rotation": turn.tolist()}, {"matrix": columns(turn)}, {"quaternion": quaternion}]
    for found in read_poses(written(tmp_path, frames), upright=True).rotations:
        np.testing.assert_allclose(found, turn, atol=1e-9)


def test_between_two_times(tmp_path: Path) -> None:
    turns = [np.eye(3), rotation("y", 0.4)]
    frames = [{"rotation": t.tolist(), "time_s": k} for k, t in enumerate(turns)]
    poses = read_poses(written(tmp_path, frames), upright=True)
    half = poses.at(99, 0.5)
    assert half is not None
    np.testing.assert_allclose(half, rotation("y", 0.2), atol=1e-9)
    assert poses.at(0, 1.5) is None


def test_frames_by_number(tmp_path: Path) -> None:
    frames = [{"rotation": TURN.tolist(), "frame": 7}]
    poses = read_poses(written(tmp_path, frames), upright=True)
    found = poses.at(7, 0.0)
    assert found is not None
    assert poses.at(6, 0.0) is None
    np.testing.assert_allclose(found, TURN)


def test_more_poses_than_frames_are_said_unless_they_say_which_they_are(tmp_path: Path) -> None:
    ordered = written(tmp_path, [{"rotation": TURN.tolist()}] * 3)
    assert read_poses(ordered, upright=True).unused(3) == ()
    assert "3 poses for 2 frames" in read_poses(ordered, upright=True).unused(2)[0]
    numbered = [{"rotation": TURN.tolist(), "frame": k} for k in range(3)]
    assert read_poses(written(tmp_path, numbered), upright=True).unused(2) == ()


def test_logarithm_undoes_exponential() -> None:
    for vector in np.random.default_rng(0).normal(0, 1, (20, 3)):
        np.testing.assert_allclose(logarithm(exponential(vector)), vector, atol=1e-9)
    np.testing.assert_allclose(between(np.eye(3), TURN, 1.0), TURN, atol=1e-9)


def test_quaternions_of_any_length() -> None:
    np.testing.assert_allclose(from_quaternion(np.array([0, 0, 0, 5.0])), np.eye(3))


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("{", "JSON"),
        ("3", "list of frames"),
        ('{"frames": []}', "list of frames"),
        ('{"frames": [{}]}', "frame 0"),
        ('{"frames": [{"quaternion": [0, 0, 0, 0]}]}', "frame 0"),
        ('{"frames": [{"quaternion": [0, 0, NaN, 1]}]}', "frame 0"),
        ('{"frames": [{"rotation": [[1, 0, 0], [0, 1, 0], [0, 0, -1]]}]}', "mirroring"),
        ('{"frames": [{"rotation": [[2, 0, 0], [0, 2, 0], [0, 0, 2]]}]}', "scale"),
        ('{"convention": "opengl", "frames": [{"rotation": 1}]}', "convention"),
        ('{"turned_deg": 45, "frames": [{"rotation": 1}]}', "turned_deg"),
        (
            '[{"quaternion": [0, 0, 0, 1], "time_s": 1},'
            ' {"quaternion": [0, 0, 0, 1], "time_s": 0}]',
            "grow",
        ),
        ('[{"quaternion": [0, 0, 0, 1], "frame": 1.5}]', "whole number"),
        ('[{"quaternion": [0, 0, 0, 1], "frame": -1}]', "whole number"),
        (json.dumps([{"quaternion": [0, 0, 0, 1], "frame": 1}] * 2), "each once"),
        ('[{"quaternion": [0, 0, 0, 1]}, {"quaternion": [0, 0, 0, 1], "time_s": 0}]', "or in none"),
    ],
)
def test_what_is_no_pose_file(tmp_path: Path, text: str, word: str) -> None:
    file = tmp_path / "poses.json"
    file.write_text(text)
    with pytest.raises(ConfigError, match=word):
        read_poses(file, upright=True)
