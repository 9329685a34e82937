"""Stills of a video: time, turn, range, bits and HDR come out as they were filmed."""

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest

from deeplight.camera_response import encode
from deeplight.errors import ConfigError, ImageFileError
from deeplight.io.colour import (
    from_cicp,
    hlg_from_radiance,
    hlg_pixels,
    radiance_from_hlg,
    radiance_from_pq,
)
from deeplight.io.video import facts, frames, video_frames
from deeplight.io.video_writer import VideoWriter

HEIGHT, WIDTH, COUNT = 96, 64, 6


def patches(seed: int = 0) -> np.ndarray:
    """Linear radiance, 6 x 4 patches of 16 pixels, muted so that chroma planes can hold it."""
    rng = np.random.default_rng(seed)
    grey = rng.uniform(0.05, 0.8, (6, 4, 1))
    return (grey * rng.uniform(0.7, 1.2, (6, 4, 3))).clip(0, 1).repeat(16, 0).repeat(16, 1)


def film(path: Path, codec: str, rotation_deg: int = 0, times: np.ndarray | None = None) -> Path:
    radiance = patches().astype(np.float32)
    hdr = codec == "libx265"
    picture = hlg_pixels(radiance) if hdr else np.round(encode(radiance) * 255).astype(np.uint8)
    with VideoWriter(path, WIDTH, HEIGHT, 30, codec, rotation_deg, quality=4) as video:
        for number in range(COUNT):
            video.write(picture, None if times is None else float(times[number]))
    return path


def middles(values: np.ndarray) -> np.ndarray:
    return values[8::16, 8::16].astype(float)


@pytest.mark.parametrize("codec", ["libx264", "libx265"])
@pytest.mark.parametrize("rotation_deg", [0, 90, 180, 270])
def test_colours_luma_and_turn_come_back(tmp_path: Path, codec: str, rotation_deg: int) -> None:
    """8 bits in BT.709 and 10-bit HLG in BT.2020 show the same picture, however it is stored."""
    path = film(tmp_path / "a.mp4", codec, rotation_deg)
    wanted = middles(encode(patches()) * 255)
    clip = list(video_frames(path))
    assert len(clip) == COUNT
    for still in (clip[0], clip[-1]):
        got = middles(still.rgb())
        assert got.shape == wanted.shape
        assert np.abs(got - wanted).max() <= 5
        assert np.abs(middles(still.luma) - got @ [0.2126, 0.7152, 0.0722]).max() <= 6
    known = facts(path)
    assert (known.width, known.height, known.rotation_deg) == (WIDTH, HEIGHT, rotation_deg)
    assert known.transfer == ("HLG" if codec == "libx265" else "BT.709")
    np.testing.assert_array_equal(next(iter(frames(path))).pixels, clip[0].rgb())


@pytest.mark.parametrize("codec", ["libx264", "libx265"])
def test_channels_and_averaged_luma_are_the_pictures(tmp_path: Path, codec: str) -> None:
    still = next(video_frames(film(tmp_path / "a.mp4", codec, 90)))
    np.testing.assert_array_equal(np.stack(still.channels(), axis=-1), still.rgb())
    assert still.luma.flags.c_contiguous
    shares = still.averaged_luma(lambda grey: grey[::16, ::16])
    np.testing.assert_array_equal(shares, still.luma[::16, ::16])
    means = still.averaged_luma(lambda grey: grey.reshape(6, 16, 4, 16).mean((1, 3)).astype(int))
    wanted = still.luma.reshape(6, 16, 4, 16).mean((1, 3))
    assert np.abs(means - wanted).max() <= 1.5  # rounded twice
    assert np.abs(means.T[:4, :4] - wanted[:4, :4]).max() > 10


def test_a_wrong_turn_would_be_noticed(tmp_path: Path) -> None:
    """The twin: the picture of the test above differs from itself upside down."""
    still = next(video_frames(film(tmp_path / "a.mp4", "libx264", 90)))
    wanted = middles(encode(patches()) * 255)
    assert np.abs(middles(still.rgb())[::-1, ::-1] - wanted).max() > 30


def test_uneven_times_come_back(tmp_path: Path) -> None:
    times = np.array([0.0, 0.031, 0.08, 0.11, 0.19, 0.2])
    path = film(tmp_path / "a.mp4", "libx264", times=times)
    got = [still.time_s for still in video_frames(path)]
    np.testing.assert_allclose(got, times, atol=1e-4)
    assert facts(path).variable_rate is True
    even = facts(film(tmp_path / "b.mp4", "libx264"))
    assert even.variable_rate is False
    assert even.rate_hz == pytest.approx(30)
    assert (even.frames, even.codec) == (COUNT, "h264")
    assert even.duration_s == pytest.approx(COUNT / 30)


@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize("pixel_format", ["yuv420p", "yuv420p10le"])
def test_luma_is_full_range(tmp_path: Path, pixel_format: str, full: bool) -> None:
    """A grey wedge keeps its ends whatever range and bits it was stored in."""
    wedge = np.linspace(0, 255, 128).astype(np.uint8)[None, :, None].repeat(64, 0).repeat(3, 2)
    path = tmp_path / "a.mp4"
    with av.open(str(path), "w") as container:
        name = "libx264" if pixel_format == "yuv420p" else "libx265"
        options = {"crf": "1", "x265-params": "log-level=error"}
        stream = container.add_stream(name, rate=30, options=options)
        stream.width, stream.height, stream.pix_fmt = 128, 64, pixel_format
        stream.codec_context.color_range = 2 if full else 1
        frame = av.VideoFrame.from_ndarray(wedge, format="rgb24").reformat(
            format=pixel_format, dst_colorspace=5, dst_color_range=2 if full else 1
        )
        frame.pts = 0  # x265 gives a frame without a time any time at all
        container.mux(stream.encode(frame))
        container.mux(stream.encode())
    luma = next(video_frames(path)).luma[32].astype(int)
    assert np.abs(luma - wedge[32, :, 0]).max() <= 3


def test_hlg_is_its_own_inverse_and_has_the_standards_values() -> None:
    radiance = np.linspace(0, 3.7, 500)
    np.testing.assert_allclose(radiance_from_hlg(hlg_from_radiance(radiance)), radiance, atol=1e-9)
    np.testing.assert_allclose(hlg_from_radiance(np.array([1.0])), 0.75, atol=1e-6)
    # BT.2100: signal 0.5 is a twelfth of the range; BT.2408: PQ signal 0.58 is 203 cd/m2.
    low, high = radiance_from_hlg(np.array([0.5, 1.0]))
    assert low / high == pytest.approx(1 / 12, rel=1e-4)
    np.testing.assert_allclose(radiance_from_pq(np.array([0.58])), 1, rtol=0.01)


def test_hdr_brighter_than_white_clips_and_grey_stays_grey() -> None:
    radiance = np.array([[[0.2, 0.2, 0.2], [3.0, 3.0, 3.0], [0.5, 0.2, 0.1]]], np.float32)
    pixels = from_cicp(9, 18).pixels(hlg_pixels(radiance))
    wanted = np.round(encode(np.minimum(radiance, 1)) * 255)
    assert np.abs(pixels - wanted).max() <= 2


def cut(path: Path, share: float) -> Path:
    """A video whose index is in front, as a download leaves it when it breaks off."""
    with av.open(str(path), "w", options={"movflags": "faststart"}) as container:
        stream = container.add_stream("libx264", rate=30)
        stream.width = stream.height = 128
        stream.pix_fmt = "yuv420p"
        for number in range(20):
            noise = np.random.default_rng(number).integers(0, 255, (128, 128, 3), np.uint8)
            frame = av.VideoFrame.from_ndarray(noise, format="rgb24")
            frame.pts, frame.time_base = number, Fraction(1, 30)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    whole = path.read_bytes()
    path.write_bytes(whole[: int(len(whole) * share)])
    return path


def test_a_fault_in_the_middle_comes_after_the_good_frames(tmp_path: Path) -> None:
    assert len(list(video_frames(cut(tmp_path / "whole.mp4", 1.0)))) == 20
    got: list[int] = []

    def watched() -> Iterator[int]:
        for still in video_frames(cut(tmp_path / "cut.mp4", 0.6)):
            got.append(still.number)
            yield still.number

    with pytest.raises(ImageFileError, match="middle of a frame"):
        list(watched())
    assert 8 <= len(got) <= 12


def test_hostile_files_are_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    silent = tmp_path / "audio.mp4"
    with av.open(str(silent), "w") as container:
        stream = container.add_stream("aac", rate=44100)
        sound = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), "fltp", "mono")
        sound.rate = 44100
        container.mux(stream.encode(sound))
        container.mux(stream.encode())
    empty = tmp_path / "empty.mp4"
    empty.touch()
    huge = film(tmp_path / "huge.mp4", "libx264")
    monkeypatch.setattr("deeplight.io.video.MAX_VIDEO_PIXELS", WIDTH * HEIGHT - 1)
    for path, message in ((silent, "without video"), (empty, "0 bytes"), (huge, "64 x 96")):
        for read in (facts, lambda p: list(video_frames(p))):
            with pytest.raises(ImageFileError, match=message) as caught:
                read(path)
            assert "\n" not in str(caught.value)


def test_a_film_that_breaks_off_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError):
        break_off(tmp_path / "a.mp4")
    assert not list(tmp_path.iterdir())
    good = {"path": tmp_path / "a.mp4", "width": 64, "height": 96, "rate": 30}
    for words in ({"width": 63}, {"codec": "mpeg2"}, {"rotation_deg": 45}, {"rate": 0}):
        with pytest.raises(ConfigError):
            VideoWriter(**good | words)


def break_off(path: Path) -> None:
    with VideoWriter(path, 64, 96, 30) as video:
        video.write(np.zeros((96, 64, 3), np.uint8))
        raise RuntimeError


def test_greys_come_back_to_the_level(tmp_path: Path) -> None:
    levels = np.arange(8, 248, 16, dtype=np.uint8)
    wedge = np.zeros((96, 16 * len(levels), 3), np.uint8)
    wedge[:] = levels.repeat(16)[None, :, None]
    with VideoWriter(tmp_path / "a.mp4", wedge.shape[1], 96, 30, quality=2) as video:
        video.write(wedge)
    still = next(video_frames(tmp_path / "a.mp4"))
    for got in (*still.rgb()[48, 8::16].T, still.luma[48, 8::16]):
        errors = got.astype(int) - levels
        assert np.abs(errors).max() <= 1
        assert abs(errors.mean()) < 0.3


def with_key_frames(path: Path, every: int) -> Path:
    """40 frames at 8 Hz with a key frame now and then, as phones write them."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=8, options={"g": str(every), "bf": "2"})
        stream.width, stream.height, stream.pix_fmt = 64, 48, "yuv420p"
        for k in range(40):
            grey = np.full((48, 64, 3), 6 * k, np.uint8)
            container.mux(stream.encode(av.VideoFrame.from_ndarray(grey, format="rgb24")))
        container.mux(stream.encode())
    return path


@pytest.mark.parametrize("every", [6, 250])
@pytest.mark.parametrize("from_s", [0.0, 0.6, 2.5, 4.8])
def test_from_a_time_on_come_the_same_frames(tmp_path: Path, every: int, from_s: float) -> None:
    film = with_key_frames(tmp_path / "a.mp4", every)
    late = [f for f in video_frames(film) if f.time_s >= from_s]
    found = list(video_frames(film, from_s))
    assert [f.number for f in found] == list(range(len(late)))
    assert [f.time_s for f in found] == [f.time_s for f in late]
    assert all(np.array_equal(a.rgb(), b.rgb()) for a, b in zip(found, late, strict=True))


def test_from_after_the_end_nothing_comes(tmp_path: Path) -> None:
    assert list(video_frames(with_key_frames(tmp_path / "a.mp4", 6), 60.0)) == []
