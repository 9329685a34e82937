"""Objects that stay in place in videos."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deeplight.camera import PinholeCamera
from deeplight.compose.composite import composite
from deeplight.compose.follow import Follower, turned_to
from deeplight.compose.ground import Viewpoint
from deeplight.compose.look import Look, blurred
from deeplight.compose.panned import seen_from, widened
from deeplight.compose.trace import Layers, Quality
from deeplight.frames import turned
from deeplight.mappings import resample

VIEW = Viewpoint(PinholeCamera(160, 240, np.radians(60)), 1.4, np.radians(-25), np.radians(5))


def panorama() -> np.ndarray:
    """Something to see everywhere."""
    noise = np.random.default_rng(0).random((180, 360, 1)).astype(np.float32)
    return blurred(noise, 1.5) * 400


def seen(everything: np.ndarray, view: Viewpoint) -> np.ndarray:
    rays = turned(view.camera.rays(), view.world_from_camera)
    return resample.sample_latlong(everything, rays.astype(np.float32))[..., 0]


@pytest.mark.parametrize("frames", [12])
def test_the_place_is_followed_as_the_camera_turns(frames: int) -> None:
    everything, point = panorama(), VIEW.point(80, 170)
    follower, errors, moved = None, [], 0.0
    for i in range(frames):
        yaw, pitch = 0.025 * i, VIEW.pitch_rad + 0.012 * i
        now = replace(VIEW, yaw_rad=yaw, pitch_rad=pitch)
        true = VIEW.pixels(point[None])[0] if i == 0 else now.pixels(point[None])[0]
        picture = seen(everything, now)
        follower = follower or Follower(picture, *true)
        found = follower.update(picture)
        errors.append(np.abs(np.array(found) - true).max())
        moved = max(moved, float(np.abs(true - [80, 170]).max()))
    assert moved > 30  # so standing still would be found out
    assert max(errors) < 4


def test_on_a_bare_floor_the_place_does_not_follow_the_noise() -> None:
    rng = np.random.default_rng(0)
    bare = 120 + rng.normal(0, 3, (8, 240, 160)).astype(np.float32)
    follower = Follower(bare[0], 80, 170)
    assert all(follower.update(frame) == (80, 170) for frame in bare[1:])
    assert follower.update(seen(panorama(), VIEW)) is None


@pytest.mark.parametrize(("x", "y"), [(80, 170), (60, 150), (110, 200)])
def test_the_turned_camera_sees_the_point_where_it_should(x: float, y: float) -> None:
    point = VIEW.point(80, 170)
    now = turned_to(VIEW, point, x, y)
    assert now.pixels(point[None])[0] == pytest.approx((x, y), abs=1e-6)
    assert abs(now.pitch_rad - VIEW.pitch_rad) < 0.4
    assert abs(now.yaw_rad) < 0.4
    assert now.roll_rad == VIEW.roll_rad


@pytest.mark.parametrize("yaw", [0.0, 0.9, np.pi])
def test_an_object_out_of_the_picture_leaves_the_photo_as_it_is(yaw: float) -> None:
    rendered = widened(VIEW)
    crop = (150, 250, 170, 280)
    size = crop[3] - crop[1], crop[2] - crop[0]
    dark = np.zeros((*size, 3), np.float32)
    layers = Layers(crop, dark, np.ones(size, np.float32), dark)
    now = replace(VIEW, yaw_rad=yaw)
    photo = np.full((240, 160, 3), 90, np.uint8)
    made = composite(photo, seen_from(layers, rendered, now), Look(1.0, np.zeros((3, 3))))
    assert (made.pixels == photo).all() == (yaw > 0)


def add_sound(film: Path) -> None:
    """A moment of silence, as a second track."""
    import av

    silent = film.rename(film.with_name("silent.mp4"))
    with av.open(str(silent)) as source, av.open(str(film), "w") as target:
        picture = target.add_stream_from_template(source.streams.video[0])
        sound = target.add_stream("aac", rate=44100)
        for packet in source.demux(video=0):
            if packet.dts is not None:
                packet.stream = picture
                target.mux(packet)
        silence = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), "fltp", "mono")
        silence.rate = 44100
        target.mux(sound.encode(silence))
        target.mux(sound.encode())
    silent.unlink()


def test_a_video_gives_a_video_and_a_killed_run_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("av")
    pytest.importorskip("mitsuba")
    from deeplight.cli.main import main
    from deeplight.compose import video
    from deeplight.io.video import video_frames
    from deeplight.io.video_writer import VideoWriter

    tiny = Quality(samples=4, shadow_samples=4, shadow_pixels=300)
    monkeypatch.setattr("deeplight.compose.video.FRAME", tiny)
    everything = panorama()
    with VideoWriter(tmp_path / "in.mp4", 64, 96, 10.0) as writer:
        for i in range(3):
            view = Viewpoint(PinholeCamera(64, 96, np.radians(60)), yaw_rad=0.02 * i)
            grey = seen(everything, view).clip(0, 255).astype(np.uint8)
            writer.write(np.repeat(grey[..., None], 3, -1))
    add_sound(tmp_path / "in.mp4")
    words = ["--object", "sphere", "--engine", "scalar", "--pitch", "-20", "--at", "32", "70"]
    out = tmp_path / "out.mp4"
    assert main(["compose", str(tmp_path / "in.mp4"), "--out", str(out), *words]) == 0
    assert "the video's sound is left out" in capsys.readouterr().out
    before, after = (
        [still.rgb().astype(int) for still in video_frames(path)]
        for path in (tmp_path / "in.mp4", out)
    )
    assert len(after) == 3
    for one, other in zip(before, after, strict=True):
        changed = np.abs(one - other).mean(-1)
        assert changed[55:70, 26:38].mean() > 3 * changed[:30].mean() + 5
    composite, made, written = video.composite, [], []
    write = VideoWriter.write

    def composed_until_killed(*given: object, **more: object) -> object:
        made.append(given)
        if len(made) == 6:
            raise KeyboardInterrupt
        return composite(*given, **more)

    def noted(writer: VideoWriter, pixels: np.ndarray, time_s: float) -> None:
        written.append(pixels.copy())  # the encoder's own bytes may differ
        write(writer, pixels, time_s)

    monkeypatch.setattr(video, "composite", composed_until_killed)
    monkeypatch.setattr(VideoWriter, "write", noted)
    command = ["compose", str(tmp_path / "in.mp4"), "--out", str(out), *words]
    assert main(command) == 0
    assert main(command) == 130
    assert main(command) == 0
    assert len(made) == 7  # of the second run's three frames only the last one was left
    np.testing.assert_array_equal(written[:3], written[-3:])
    assert {path.name for path in tmp_path.iterdir()} == {"in.mp4", "out.mp4"}
