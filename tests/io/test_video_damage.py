"""Films with damaged frames, or of colours that nothing converts: said, never hidden."""

from pathlib import Path

import av
import numpy as np
import pytest

from deeplight.errors import ImageFileError
from deeplight.io.video import frames, video_frames

HEIGHT, WIDTH, GROUP = 96, 160, 5


def picture(number: int) -> np.ndarray:
    """Noise, since a damaged even picture may look whole, whose brightness says its number."""
    noise = np.random.default_rng(number).integers(0, 80, (HEIGHT, WIDTH, 3))
    return (noise + 15 * number).astype(np.uint8)


def film(path: Path, codec: str = "libx264", pixels: str = "yuv420p", matrix: int = 1) -> Path:
    options = {"crf": "10", "g": str(GROUP), "bf": "0", "sc_threshold": "0"}
    options = options if codec == "libx264" else {}
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=25, options=options)
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, pixels
        stream.codec_context.colorspace = matrix
        for number in range(2 * GROUP):
            frame = av.VideoFrame.from_ndarray(picture(number), format="rgb24")
            frame = frame.reformat(format=pixels, dst_colorspace=1)
            frame.colorspace = matrix
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def damaged(path: Path, frame: int) -> Path:
    """Overwrite the middle of a frame."""
    with av.open(str(path)) as container:
        packet = [packet for packet in container.demux(video=0) if packet.size][frame]
        start, size = packet.pos, packet.size
    content = bytearray(path.read_bytes())
    for at in range(start + size // 3, start + size * 2 // 3):
        content[at] = 0x55
    path.write_bytes(content)
    return path


@pytest.mark.parametrize("hurt", [0, 3, 5])
def test_damaged_frames_and_what_is_drawn_from_them_are_left_out(tmp_path: Path, hurt: int) -> None:
    path = film(tmp_path / "a.mp4")
    whole = [photo.pixels for photo in frames(path)]
    read = list(frames(damaged(path, hurt)))
    until = GROUP * (hurt // GROUP + 1)  # a key frame owes nothing to those before it
    kept = [number for number in range(2 * GROUP) if not hurt <= number < until]
    assert len(read) == len(kept)
    for photo, number in zip(read, kept, strict=True):
        np.testing.assert_array_equal(photo.pixels, whole[number])
    said = [bool(photo.notes) for photo in read]
    assert said == [number == until for number in kept]


def test_from_a_time_on_damaged_frames_are_left_out_too(tmp_path: Path) -> None:
    path = damaged(film(tmp_path / "a.mp4"), 3)
    times = [still.time_s for still in video_frames(path)]
    for from_s in (0.06, 0.14, 0.21):
        later = [still.time_s for still in video_frames(path, from_s)]
        assert later == [time_s for time_s in times if time_s >= from_s]


def test_a_film_without_a_whole_frame_is_refused(tmp_path: Path) -> None:
    path = damaged(damaged(film(tmp_path / "a.mp4"), 0), GROUP)
    with pytest.raises(ImageFileError, match="no frame of it is whole"):
        list(frames(path))


@pytest.mark.parametrize("matrix", [8, 10, 14])
def test_colours_that_nothing_converts_are_refused(tmp_path: Path, matrix: int) -> None:
    path = film(tmp_path / "a.mkv", "ffv1", "yuv444p", matrix)
    with pytest.raises(ImageFileError, match=rf"a\.mkv of colour matrix {matrix}"):
        list(frames(path))


@pytest.mark.parametrize("codec", ["libvpx", "libvpx-vp9"])
def test_the_alpha_of_a_webm_is_read(tmp_path: Path, codec: str) -> None:
    path, pixels = tmp_path / "a.webm", np.full((HEIGHT, WIDTH, 4), (200, 60, 60, 255), np.uint8)
    pixels[:, : WIDTH // 2, 3] = 0
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=25, options={"auto-alt-ref": "0", "crf": "10"})
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuva420p"
        frame = av.VideoFrame.from_ndarray(pixels, format="rgba").reformat(format="yuva420p")
        container.mux(stream.encode(frame))
        container.mux(stream.encode())
    (photo,) = frames(path)
    assert np.abs(photo.pixels[:, 8:70].astype(int) - 118).max() <= 4
    assert np.abs(photo.pixels[:, 90:-8].astype(int) - (200, 60, 60)).max() <= 8
    assert photo.notes == ("transparent parts taken as mid-grey",)
