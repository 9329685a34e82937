"""Video frames come out upright and in the right colours."""

import struct
import sys
from pathlib import Path

import numpy as np
import pytest

from deeplight.errors import ImageFileError, MissingExtraError
from deeplight.io.video import frames, is_video

LIMITED, FULL = 1, 2  # FFmpeg's numbers
BT709, BT601 = 1, 5

HEIGHT, WIDTH = 48, 64
COUNT = 5


def quarters() -> np.ndarray:
    """Red, green / blue, grey."""
    picture = np.full((HEIGHT, WIDTH, 3), 128, np.uint8)
    picture[:24, :32], picture[:24, 32:], picture[24:, :32] = (
        (250, 10, 10),
        (10, 250, 10),
        (10, 10, 250),
    )
    return picture


def film(
    path: Path,
    colour_range: int = LIMITED,
    matrix: int = BT709,
    tagged: bool = True,
    scale: int = 1,
) -> Path:
    av = pytest.importorskip("av")
    picture = quarters().repeat(scale, 0).repeat(scale, 1)
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=30, options={"crf": "4"})
        stream.width, stream.height, stream.pix_fmt = WIDTH * scale, HEIGHT * scale, "yuv420p"
        if tagged:
            stream.codec_context.color_range = colour_range
            stream.codec_context.colorspace = matrix
        for _ in range(COUNT):
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24").reformat(
                format="yuv420p", dst_colorspace=matrix, dst_color_range=colour_range
            )
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def turn(path: Path, cosine: int, sine: int) -> Path:
    """Write a rotation into the track header's display matrix, as phones do."""
    content = bytearray(path.read_bytes())
    start = content.find(b"tkhd") + 44  # version 0: the matrix follows 40 bytes of header
    one, unit = 1 << 16, 1 << 30
    assert struct.unpack(">9i", content[start : start + 36]) == (one, 0, 0, 0, one, 0, 0, 0, unit)
    a, b = cosine * one, sine * one
    content[start : start + 36] = struct.pack(">9i", a, b, 0, -b, a, 0, 0, 0, unit)
    path.write_bytes(content)
    return path


def assert_close(got: np.ndarray, wanted: np.ndarray) -> None:
    """Compare the middles of the quarters; chroma bleeds at their edges."""
    rows, columns = got.shape[0] // 4, got.shape[1] // 4
    at = np.ix_([rows, 3 * rows], [columns, 3 * columns])
    assert got.shape == wanted.shape
    assert np.abs(got[at].astype(int) - wanted[at]).max() <= 4


@pytest.mark.parametrize("colour_range", [LIMITED, FULL])
@pytest.mark.parametrize("matrix", [BT709, BT601])
def test_range_and_matrix_are_honoured(tmp_path: Path, colour_range: int, matrix: int) -> None:
    photos = list(frames(film(tmp_path / "film.mp4", colour_range, matrix)))
    assert len(photos) == COUNT
    for photo in photos:
        assert_close(photo.pixels, quarters())
    assert photos[0].source == tmp_path / "film.mp4"


def test_a_film_that_names_no_matrix_is_read_as_players_do(tmp_path: Path) -> None:
    small = film(tmp_path / "small.mp4", matrix=BT601, tagged=False)
    assert_close(next(iter(frames(small))).pixels, quarters())
    large = film(tmp_path / "large.mp4", matrix=BT709, tagged=False, scale=16)
    assert_close(next(iter(frames(large))).pixels, quarters().repeat(16, 0).repeat(16, 1))


@pytest.mark.parametrize(
    ("cosine", "sine", "anticlockwise"), [(0, 1, -1), (-1, 0, 2), (0, -1, 1), (1, 0, 0)]
)
def test_rotation_metadata_is_undone(
    tmp_path: Path, cosine: int, sine: int, anticlockwise: int
) -> None:
    path = turn(film(tmp_path / "film.mp4"), cosine, sine)
    assert_close(next(iter(frames(path))).pixels, np.rot90(quarters(), anticlockwise))


@pytest.mark.parametrize("kept", [0.0, 0.3, 0.8])
def test_a_truncated_film_is_refused(
    tmp_path: Path, kept: float, capfd: pytest.CaptureFixture[str]
) -> None:
    path = film(tmp_path / "film.mp4")
    whole = path.read_bytes()
    path.write_bytes(whole[: int(len(whole) * kept)])
    capfd.readouterr()
    with pytest.raises(ImageFileError, match=r"film\.mp4"):
        list(frames(path))
    assert capfd.readouterr().err == ""


def test_what_is_no_film_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "film.mp4"
    path.write_text("no film at all\n" * 100)
    with pytest.raises(ImageFileError, match="a text"):
        next(frames(path))
    with pytest.raises(FileNotFoundError):
        next(frames(tmp_path / "missing.mp4"))
    with pytest.raises(IsADirectoryError):
        next(frames(tmp_path))


def test_without_its_extra_the_command_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "film.mp4"
    path.write_bytes(b"x")
    monkeypatch.setitem(sys.modules, "av", None)
    with pytest.raises(MissingExtraError, match=r'pip install "\.\[capture\]"'):
        next(frames(path))


def test_a_film_is_known_by_its_suffix() -> None:
    assert is_video("a/film.MOV")
    assert not is_video("photo.jpg")
