"""`deeplight fuse` on files: a clip with poses, photos, a panorama, a front camera, bad input."""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import motion_tracks
from deeplight.cli.main import main
from deeplight.estimators.preview import ACCENT, SPHERE, WIDTH
from deeplight.fuse import clip as clip_module
from deeplight.fuse import fuse as fuse_module
from deeplight.fuse.session import Session
from deeplight.fuse.track import Tracked
from deeplight.io.environment_file import read_environment
from deeplight.io.photos import read_photo, write_png
from deeplight.io.video import facts
from deeplight.io.video_writer import VideoWriter
from deeplight.mappings.resample import shrink_latlong, turned_latlong
from fused import HEIGHT, fuse, pan
from lab.pans import Sweep, Troubles, film_pan

pytestmark = pytest.mark.needs("av")


def clip(folder: Path) -> Path:
    path = folder / "clip.mp4"
    with VideoWriter(path, 180, 320, 5.0) as writer:
        for frame in pan().frames:
            writer.write(frame.pixels)
    return path


def photos(folder: Path, count: int) -> list[str]:
    paths = [folder / f"{k:02d}.png" for k in range(count)]
    for path, frame in zip(paths, pan().frames, strict=False):
        write_png(path, frame.pixels)
    return [str(path) for path in paths]


def poses(folder: Path) -> Path:
    path = folder / "poses.json"
    frames = [{"rotation": frame.rotation.tolist()} for frame in pan().frames]
    path.write_text(json.dumps({"convention": "webxr", "frames": frames}))
    return path


def error(result: Path) -> float:
    found = read_environment(result)
    assert found.seen is not None
    wanted = shrink_latlong(pan().truth(), HEIGHT)
    return float(np.median(np.abs(np.log(found.radiance / wanted))[found.seen > 0.99]))


def test_a_clip_with_poses(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    session = tmp_path / "state.npz"
    words = ("--poses", poses(tmp_path), "--fov", "66", "--session", session)
    assert fuse(out, clip(tmp_path), *words, drawn=True) == 0
    names = ["clip.exr", "clip.json", "clip.preview.png"]
    assert sorted(path.name for path in out.iterdir()) == names
    assert error(out / "clip.json") < 0.12
    assert "12 frames, 5" in capsys.readouterr().out
    record = json.loads((out / "clip.json").read_text())
    assert len(record["fused"]["frames"]) == 12
    loaded = Session.load(session, lambda _: np.zeros((32, 32, 3), np.float32))
    light = loaded.environment(height=HEIGHT)
    np.testing.assert_allclose(
        light.radiance, read_environment(out / "clip.json").radiance, rtol=1e-3
    )
    listed = [lamp["direction"] for lamp in record["lamps"]["lamps"]]
    np.testing.assert_allclose(listed, [lamp.direction for lamp in light.lamps], atol=1e-3)
    main = record["dominant_light"]["primary_light_direction"]
    np.testing.assert_allclose(main, listed[0], atol=1e-6)
    ringed = (read_photo(out / "clip.preview.png").pixels == ACCENT).all(-1)
    assert ringed.any()


@pytest.mark.parametrize(
    ("times", "word"),
    [
        ([{}] * 6, "6 of 12 frames without a pose left out"),
        ([{}] * 24, "24 poses for 12 frames"),
        ([{"time_s": 200 * k} for k in range(12)], "turn by less than 6 degrees"),
    ],
)
def test_a_pose_file_that_does_not_fit_the_clip_is_said(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    times: list[dict[str, float]],
    word: str,
) -> None:
    turns = [frame.rotation.tolist() for frame in pan().frames] * 2
    frames = [{"rotation": turn, **time} for turn, time in zip(turns, times, strict=False)]
    (tmp_path / "poses.json").write_text(json.dumps(frames))
    words = ("--poses", tmp_path / "poses.json", "--fov", "66")
    assert fuse(tmp_path / "out", clip(tmp_path), *words) == 0
    assert word in " ".join(capsys.readouterr().out.split())


@pytest.mark.parametrize(("off_deg", "is_said"), [(0.3, False), (1.0, True)])
def test_pictures_that_no_turning_explains_are_said(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    off_deg: float,
    is_said: bool,
) -> None:
    turns = {k: pan().frames[k].rotation for k in range(3)}
    found = Tracked(turns, 1.0, float(np.radians(off_deg)))
    monkeypatch.setattr(fuse_module, "track", lambda *_: found)
    assert fuse(tmp_path / "out", *photos(tmp_path, 3)) == 0
    assert ("no turning fits the pictures" in capsys.readouterr().out) is is_said


def test_photos_are_placed_by_what_they_show(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert fuse(out, *photos(tmp_path, 5), "--fov", "66", drawn=True) == 0
    assert error(out / "00.json") < 0.15


def test_another_frame_is_another_camera(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert fuse(out, *photos(tmp_path, 5), "--fov", "66", "--frame", "2") == 0
    assert error(out / "00.json") > 0.25


def test_a_photo_from_elsewhere_is_left_out_and_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    stray = tmp_path / "stray.png"
    write_png(stray, np.random.default_rng(0).integers(0, 255, (320, 180, 3)).astype(np.uint8))
    assert fuse(tmp_path / "out", *photos(tmp_path, 4), stray) == 0
    assert "could not be placed: stray.png" in capsys.readouterr().out


def test_nothing_placed_is_said_and_nothing_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, grey in (("a.png", 90), ("b.png", 160)):
        write_png(tmp_path / name, np.full((320, 180, 3), grey, np.uint8))
    assert fuse(tmp_path / "out", tmp_path / "a.png", tmp_path / "b.png") == 2
    assert "expected pictures that overlap" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_killed_run_goes_on_and_writes_the_same_bytes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    film = clip(tmp_path)
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    assert fuse(whole, film) == 0
    chosen: list[object] = []
    read = clip_module.moving

    def counted(stills: Iterator[object]) -> Iterator[object]:
        chosen.append(stills)
        return read(stills)

    def stopped(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(clip_module, "moving", counted)
    with monkeypatch.context() as patch:
        patch.setattr(fuse_module, "track", stopped)
        assert fuse(killed, film) == 130
    assert [path.name for path in killed.iterdir()] == [".clip.fusing"]
    assert fuse(killed, film, "--workers", "2") == 0
    assert len(chosen) == 1
    assert sorted(p.name for p in killed.iterdir()) == sorted(p.name for p in whole.iterdir())
    for path in whole.iterdir():
        assert (killed / path.name).read_bytes() == path.read_bytes()


@pytest.mark.parametrize("claimed", [12, 24])
def test_a_clip_of_which_much_is_damaged_is_said_to_be(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    claimed: int,
) -> None:
    film = clip(tmp_path)
    known = replace(facts(film), frames=claimed)
    monkeypatch.setattr(clip_module, "facts", lambda _: known)
    assert fuse(tmp_path / "out", film) == 0
    said = "12 of 24 frames are left out" in capsys.readouterr().out
    assert said is (claimed == 24)


def test_front_and_back_camera_look_opposite_ways(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_png(tmp_path / "back.png", np.full((320, 180, 3), (150, 90, 90), np.uint8))
    write_png(tmp_path / "front.png", np.full((320, 180, 3), (90, 90, 150), np.uint8))
    out = tmp_path / "out"
    assert fuse(out, tmp_path / "back.png", "--front", tmp_path / "front.png", drawn=True) == 0
    assert "1 frame and the front photo front.png" in capsys.readouterr().out
    for color, is_shown in (((150, 90, 90), True), ((90, 90, 150), True), ((90, 150, 90), False)):
        assert shown(out / "back.preview.png", color) is is_shown
    found = read_environment(out / "back.json")
    assert found.seen is not None
    ahead, behind = found.radiance[HEIGHT // 2, HEIGHT], found.radiance[HEIGHT // 2, 0]
    assert ahead[0] > 1.5 * ahead[2]
    assert behind[2] > 1.5 * behind[0]
    assert found.seen[HEIGHT // 2, [0, HEIGHT, HEIGHT // 2]].tolist() == [1, 1, 0]


def shown(preview: Path, color: tuple[int, int, int]) -> bool:
    """Whether a frame of one colour is among those that a preview shows."""
    frames = read_photo(preview).pixels[-SPHERE:, : WIDTH // 3]
    return bool((frames == color).all(-1).sum() > 1000)


def test_a_level_light_has_up_at_the_top(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    samples = [motion_tracks.camm(frame.rotation) for frame in pan().frames]
    film = motion_tracks.add_track(clip(tmp_path), b"camm", samples, 0.2)
    assert fuse(out, film, "--fov", "66", "--level") == 0
    assert "rotations from CAMM metadata" in capsys.readouterr().out
    found = read_environment(out / "clip.json")
    assert found.seen is not None
    rows = (found.seen > 0.5).nonzero()[0]
    wanted = HEIGHT * (100 / 180)  # the ring looked 10 degrees down
    assert abs(rows.mean() - wanted) < 1.5


def test_a_damaged_photo_is_left_out_and_the_others_keep_their_poses(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = photos(tmp_path, 4)
    Path(names[1]).write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(40))
    words = ["--poses", poses(tmp_path), "--fov", "66"]
    assert fuse(tmp_path / "a", *names, *words) == 2
    first, last = capsys.readouterr().err.strip().splitlines()
    assert "01.png" in first
    assert "1 of 4 that cannot be used" in last
    turned = json.loads(poses(tmp_path).read_text())
    del turned["frames"][1]
    poses(tmp_path).write_text(json.dumps(turned))
    (tmp_path / "less.json").write_text(json.dumps(turned))
    words = ["--poses", tmp_path / "less.json", "--fov", "66"]
    assert fuse(tmp_path / "b", names[0], *names[2:], *words) == 0
    both = [(tmp_path / name / "00.exr").read_bytes() for name in "ab"]
    assert both[0] == both[1]


def test_the_light_is_in_no_camera_that_is_left_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = photos(tmp_path, 3)
    Path(names[1]).write_bytes(b"")
    words = ["--poses", poses(tmp_path), "--fov", "66", "--frame", "1"]
    assert fuse(tmp_path / "a", *names, *words) == 2
    assert "--frame of a photo that is used; got 1" in capsys.readouterr().err
    assert not (tmp_path / "a").exists()


def test_one_photo_is_too_few(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (photo,) = photos(tmp_path, 1)
    assert fuse(tmp_path / "out", photo) == 2
    assert f"got one picture, {Path(photo).name}" in capsys.readouterr().err


def test_without_any_usable_photo_no_pose_is_asked_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("a.png", "b.png"):
        write_png(tmp_path / name, np.zeros((8, 8, 3), np.uint8))
    assert fuse(tmp_path / "out", tmp_path / "a.png", tmp_path / "b.png") == 2
    said = capsys.readouterr().err
    assert "expected usable photos; got none" in said
    assert "pose" not in said


def test_photos_at_several_exposures_show_what_clips_in_one(tmp_path: Path) -> None:
    place = np.full((256, 512, 3), 0.3, np.float32) * np.where(pan().panorama > 0.4, 1.5, 0.7)
    place[110:125, 250:262] = 20.0
    sweep = Sweep(3, (0.0,), 10.0, (0.0, 0.0, -4.0))
    ideal = Troubles(0.0, 0.0, response=False)
    start = film_pan(place, sweep, ideal, np.random.default_rng(4), (320, 180)).frames[0].rotation
    place = turned_latlong(place, start)  # so that the first frame looks at the lamp
    burst = film_pan(place, sweep, ideal, np.random.default_rng(4), (320, 180))
    for k, frame in enumerate(burst.frames):
        exif = Image.Exif()
        time_s = 0.02 * 2.0 ** sweep.bracket_stops[k]
        exif.get_ifd(0x8769).update({0x829A: time_s, 0x829D: 2.0, 0x8827: 100})
        Image.fromarray(frame.pixels).save(tmp_path / f"{k}.jpg", exif=exif, quality=97)
    peaks = []
    for count in (2, 3):
        names = [tmp_path / f"{k}.jpg" for k in range(count)]
        assert fuse(tmp_path / f"out{count}", *names, "--fov", "66") == 0
        found = read_environment(tmp_path / f"out{count}" / "0.json")
        peaks.append(float(found.radiance[found.seen > 0.99].max()))
    white = 20.0 * float(np.exp(burst.frames[0].log_gain).mean())
    assert white > 3
    assert abs(np.log(peaks[1] / white)) < 0.25
    assert abs(np.log(peaks[0] / white)) > 0.25


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--fov", "200"], "--fov between"),
        (["--height", "3"], "--height from"),
        (["--frame", "17"], "--frame from 0 to 0; got 17"),
        (["--session", "x.txt"], "--session FILE.npz"),
        (["--workers", "-1"], "at least 0 workers"),
        (["--workers", "2"], "--workers without a clip"),
        (["--poses", "missing.json"], "missing.json"),
    ],
)
def test_what_cannot_be_done_is_said_in_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], message: str
) -> None:
    (photo,) = photos(tmp_path, 1)
    out = str(tmp_path / "out")
    assert main(["fuse", photo, "--out", out, *words]) == 2
    complaint = capsys.readouterr().err
    assert message in complaint
    assert complaint.count("\n") == 1
