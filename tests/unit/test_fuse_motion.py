"""Rotations from a video's own metadata: both formats, clips turned to stand, contradictions."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

import made_up_pans
import motion_tracks
from clips import write_clip
from deeplight.errors import ImageFileError
from deeplight.frames import Rotation, rotation, world_from_camera
from deeplight.fuse.frame import SourceFrame, field_of_view
from deeplight.fuse.motion import checked, with_motion
from deeplight.fuse.poses import angle_between
from deeplight.io.camera_motion import CameraMotion, camera_motion_of
from lab.pans import Pan, Troubles

pytestmark = pytest.mark.needs("av")

FOV = float(np.radians(66))
STEP_S = 0.5
GREY = np.full((320, 180, 3), 128, np.uint8)


def turns(count: int, seed: int = 0) -> list[Rotation]:
    angles = np.random.default_rng(seed).uniform(-0.9, 0.9, (count, 3))
    return [world_from_camera(*row) for row in angles]


def filmed(path: Path, count: int = 2, rotation_deg: int = 0) -> Path:
    return write_clip(path, [GREY] * count, rotation_deg)


def as_camm(clip: Path, cameras: Sequence[Rotation]) -> Path:
    samples = [motion_tracks.camm(turn) for turn in cameras]
    return motion_tracks.add_track(clip, b"camm", samples, STEP_S)


def as_gpmf(clip: Path, cameras: Sequence[Rotation], tilt: Rotation) -> Path:
    corrections = [world_from_camera(0.02 * k, -0.03) for k in range(len(cameras))]
    two = [slice(0, 2), slice(2, len(cameras))]
    samples = [motion_tracks.gpmf(cameras[part], corrections[part], tilt) for part in two]
    return motion_tracks.add_track(clip, b"gpmd", samples, 2 * STEP_S)


def found(clip: Path) -> CameraMotion:
    motion = camera_motion_of(clip)
    assert motion is not None
    return motion


def test_camm_gives_the_rotations_that_were_written(tmp_path: Path) -> None:
    wanted = turns(5)
    motion = found(as_camm(filmed(tmp_path / "a.mp4"), wanted))
    np.testing.assert_allclose(motion.rotations, wanted, atol=1e-6)
    np.testing.assert_allclose(motion.times_s, STEP_S * np.arange(5), atol=1e-9)


def test_gpmf_gives_them_level_and_with_what_stabilising_turned(tmp_path: Path) -> None:
    wanted = turns(4, 1)
    motion = found(as_gpmf(filmed(tmp_path / "a.mp4"), wanted, world_from_camera(0, 0.4, -0.2)))
    np.testing.assert_allclose(motion.times_s, STEP_S * np.arange(4), atol=1e-9)
    # The start's heading is its own; what is up and how frames are turned to each other is not.
    to_ours = wanted[0] @ motion.rotations[0].T
    np.testing.assert_allclose(to_ours @ motion.rotations, wanted, atol=2e-4)
    np.testing.assert_allclose(to_ours @ [0, 1, 0], [0, 1, 0], atol=2e-4)


def test_a_quaternion_read_the_other_way_round_is_another_rotation(tmp_path: Path) -> None:
    wanted = turns(4, 1)
    motion = found(as_gpmf(filmed(tmp_path / "a.mp4"), [t.T for t in wanted], np.eye(3)))
    step = angle_between(motion.rotations[0].T @ motion.rotations[1], wanted[0].T @ wanted[1])
    assert step > 0.2


def test_other_tracks_are_none_of_it(tmp_path: Path) -> None:
    clip = filmed(tmp_path / "a.mp4")
    assert camera_motion_of(clip) is None
    motion_tracks.add_track(clip, b"mett", [b"\0\0\0\x10time"] * 3, STEP_S)
    assert camera_motion_of(clip) is None


def broken_gpmf() -> bytes:
    payload = motion_tracks.gpmf(turns(2), [np.eye(3)] * 2, np.eye(3))
    return payload.replace(b"CORIs\x08\x00\x02", b"CORIs\x08\x00\x09")


@pytest.mark.parametrize(
    ("entry", "samples", "word"),
    [
        (b"camm", [motion_tracks.camm(np.eye(3)), b"\0\0\0\0\1"], "packet of 5 bytes"),
        (b"camm", [b"\0\0\0\0\1", *[motion_tracks.camm(np.eye(3))] * 2], "packet of 5 bytes"),
        (b"camm", [b"\0\0\0\0" + b"\xff" * 12], "no number"),
        (b"gpmd", [broken_gpmf()], "longer than"),
        (b"gpmd", [broken_gpmf().replace(b"CORIs\x08\x00\x09", b"CORIZ\x08\x00\x02")], "type 'Z'"),
    ],
)
def test_a_damaged_track_is_refused(
    tmp_path: Path, entry: bytes, samples: list[bytes], word: str
) -> None:
    clip = motion_tracks.add_track(filmed(tmp_path / "a.mp4"), entry, samples, STEP_S)
    with pytest.raises(ImageFileError, match=word) as caught:
        camera_motion_of(clip)
    assert "\n" not in str(caught.value)
    frames, notes = with_motion([SourceFrame("", GREY, 0)], clip, FOV)
    assert frames[0].world_from_camera is None
    assert word in notes[0]


@lru_cache
def pan() -> Pan:
    return made_up_pans.pan(15, Troubles())


def source_frames() -> list[SourceFrame]:
    return [SourceFrame("", f.pixels, k, k * STEP_S) for k, f in enumerate(pan().frames)]


@pytest.mark.parametrize("axes_deg", [0, 90])
def test_axes_of_the_stored_or_of_the_upright_picture(tmp_path: Path, axes_deg: int) -> None:
    clip = filmed(tmp_path / "a.mp4", rotation_deg=90)
    upright = [frame.rotation for frame in pan().frames]
    stored = [turn @ rotation("z", np.radians(axes_deg)) for turn in upright]
    frames, notes = with_motion(source_frames(), as_camm(clip, stored), FOV)
    assert notes[0].startswith("rotations from CAMM metadata; the pictures agree")
    for frame, turn in zip(frames, upright, strict=True):
        assert frame.world_from_camera is not None
        assert angle_between(frame.world_from_camera, turn) < 1e-3


def test_the_field_of_view_is_found(tmp_path: Path) -> None:
    clip = as_camm(filmed(tmp_path / "a.mp4"), [frame.rotation for frame in pan().frames])
    narrow = [SourceFrame("", f.pixels[40:280], f.number, f.time_s) for f in source_frames()]
    frames, _ = with_motion(narrow, clip, None)
    wanted = 2 * np.arctan(np.tan(FOV / 2) * 240 / 320)
    assert abs(np.degrees((frames[0].vertical_fov_rad or 0) - wanted)) < 1


@pytest.mark.parametrize("wrong", ["mirrored", "drifting", "short"])
def test_pictures_win_over_metadata_that_contradict_them(tmp_path: Path, wrong: str) -> None:
    cameras = [frame.rotation for frame in pan().frames]
    if wrong == "mirrored":
        cameras = [turn.T for turn in cameras]
    if wrong == "drifting":
        cameras = [world_from_camera(0.09 * k) @ turn for k, turn in enumerate(cameras)]
    if wrong == "short":
        cameras = cameras[:5]
    clip = as_camm(filmed(tmp_path / "a.mp4"), cameras)
    frames, notes = with_motion(source_frames(), clip, FOV)
    assert all(frame.world_from_camera is None for frame in frames)
    assert ("part of the clip" if wrong == "short" else "contradict the pictures") in notes[0]


def test_what_no_picture_can_confirm_is_believed_and_said(tmp_path: Path) -> None:
    clip = as_camm(filmed(tmp_path / "a.mp4"), turns(4))
    bare = [SourceFrame("", GREY, k, k * STEP_S) for k in range(4)]
    frames, notes = with_motion(bare, clip, FOV)
    assert "too little to confirm" in notes[0]
    assert all(frame.world_from_camera is not None for frame in frames)


@pytest.mark.parametrize("axes_deg", [0, 90])
def test_poses_in_other_axes_are_said_to_contradict(axes_deg: int) -> None:
    axes = rotation("z", np.radians(axes_deg))
    frames = [
        replace(shown, world_from_camera=frame.rotation @ axes, vertical_fov_rad=FOV)
        for shown, frame in zip(source_frames(), pan().frames, strict=True)
    ]
    same, notes = checked(frames)
    assert len(notes) == (1 if axes_deg else 0)
    assert [frame.vertical_fov_rad for frame in same] == [FOV] * len(frames)


def test_with_poses_the_field_of_view_is_found_or_said_to_be_assumed() -> None:
    frames = [
        replace(shown, world_from_camera=frame.rotation, picture=shown.pixels[40:280])
        for shown, frame in zip(source_frames(), pan().frames, strict=True)
    ]
    posed, notes = checked(frames)
    wanted = 2 * np.arctan(np.tan(FOV / 2) * 240 / 320)
    assert np.degrees((posed[0].vertical_fov_rad or 0) - wanted) == pytest.approx(0, abs=1)
    assert "unknown, found 5" in notes[0]
    bare = [replace(frame, picture=GREY) for frame in frames]
    posed, notes = checked(bare)
    assert posed[0].vertical_fov_rad == pytest.approx(field_of_view(bare[0]))
    assert "unknown, assumed 66" in notes[0]
