"""Films of every look come out as they are meant to be seen: turned, mirrored, stretched, coloured.

The films are made here; those of ../shared/cases, by other programs, are read too where they lie.
"""

import struct
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace

import av
import numpy as np
import pytest

from deeplight.errors import ImageFileError
from deeplight.io.colour import BT2020, DISPLAY_P3, bt709_from_primaries, srgb_decode, srgb_encode
from deeplight.io.video import _film_of, facts, frames, video_frames
from deeplight.io.video_frame import Appearance

HEIGHT, WIDTH = 48, 64
MATRICES = {  # EXIF's number: a b c d of the display matrix (x' = ax + cy, y' = bx + dy)
    1: (1, 0, 0, 1),
    2: (-1, 0, 0, 1),
    3: (-1, 0, 0, -1),
    4: (1, 0, 0, -1),
    5: (0, 1, 1, 0),
    6: (0, 1, -1, 0),
    7: (0, -1, -1, 0),
    8: (0, -1, 1, 0),
}


def scene(height: int = HEIGHT, width: int = WIDTH) -> np.ndarray:
    """Four muted quarters: no turn or mirroring looks like another."""
    picture = np.full((height, width, 3), 128, np.uint8)
    picture[: height // 2, : width // 2] = (200, 60, 60)
    picture[: height // 2, width // 2 :] = (60, 190, 60)
    picture[height // 2 :, : width // 2] = (60, 60, 200)
    return picture


def film(path: Path, picture: np.ndarray, **said: object) -> Path:
    """Two frames in H.264, with what the codec's context shall say of them."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=30, options={"crf": "2"})
        stream.height, stream.width = picture.shape[:2]
        stream.pix_fmt = "yuv444p"  # colours stay sharp where the quarters meet
        stream.codec_context.color_range, stream.codec_context.colorspace = 1, 1
        for name, value in said.items():
            setattr(stream.codec_context, name, value)
        for _ in range(2):
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(picture), format="rgb24")
            frame = frame.reformat(format="yuv444p", dst_colorspace=1, dst_color_range=1)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


@pytest.mark.parametrize(
    ("said", "camera"),
    [
        ({"com.apple.quicktime.make": "Apple", "com.apple.quicktime.model": "iPhone 12"},
         "Apple iPhone 12"),
        ({"com.android.manufacturer": "Google", "com.android.model": "Pixel 8"}, "Google Pixel 8"),
        ({"com.apple.quicktime.make": "Apple"}, ""),
        ({}, ""),
    ],
)  # fmt: skip
def test_a_film_names_its_camera(tmp_path: Path, said: dict[str, str], camera: str) -> None:
    path = tmp_path / "film.mov"
    with av.open(str(path), "w", options={"movflags": "use_metadata_tags"}) as container:
        container.metadata.update(said)
        stream = container.add_stream("libx264", rate=30)
        stream.height, stream.width, stream.pix_fmt = HEIGHT, WIDTH, "yuv420p"
        container.mux(stream.encode(av.VideoFrame.from_ndarray(scene(), format="rgb24")))
        container.mux(stream.encode())
    assert facts(path).camera == camera


def displayed(path: Path, matrix: tuple[int, int, int, int]) -> Path:
    """Write a display matrix into the track header, as phones do."""
    content = bytearray(path.read_bytes())
    start = content.find(b"tkhd") + 44  # version 0: the matrix follows 40 bytes of header
    a, b, c, d = (value << 16 for value in matrix)
    content[start : start + 36] = struct.pack(">9i", a, b, 0, c, d, 0, 0, 0, 1 << 30)
    path.write_bytes(content)
    return path


def stored(orientation: int) -> np.ndarray:
    """The scene as a camera stores it whose file names `orientation`, by the matrix's own words."""
    a, b, c, d = MATRICES[orientation]
    upright = scene()
    height, width = (WIDTH, HEIGHT) if b else (HEIGHT, WIDTH)
    rows, columns = np.mgrid[0:height, 0:width]
    x = a * columns + c * rows + (WIDTH - 1) * (min(a, c) < 0)
    y = b * columns + d * rows + (HEIGHT - 1) * (min(b, d) < 0)
    return upright[y, x]


def worst(got: np.ndarray, wanted: np.ndarray) -> float:
    """Largest difference of the middles of the quarters."""
    assert got.shape == wanted.shape
    at = np.ix_(
        *([size // 4, 3 * size // 4 if size % 4 else size - size // 4] for size in got.shape[:2])
    )
    return float(np.abs(got[at].astype(int) - wanted[at]).max())


@pytest.mark.parametrize("orientation", MATRICES)
def test_every_turn_and_mirror_is_undone(tmp_path: Path, orientation: int) -> None:
    path = displayed(film(tmp_path / "a.mp4", stored(orientation)), MATRICES[orientation])
    still = next(video_frames(path))
    assert worst(still.rgb(), scene()) <= 4
    assert worst(still.luma, scene() @ [0.2126, 0.7152, 0.0722]) <= 4
    shares = still.averaged_luma(lambda grey: grey[12::24, 16::32])
    np.testing.assert_array_equal(shares, still.luma[12::24, 16::32])
    known = facts(path)
    assert (known.width, known.height) == (WIDTH, HEIGHT)
    assert known.mirrored == (orientation in (2, 4, 5, 7))
    turned = np.rot90(
        stored(orientation)[:, :: -1 if known.mirrored else 1], known.rotation_deg // 90
    )
    np.testing.assert_array_equal(turned, scene())  # what the facts say brings it upright too
    assert worst(still.rgb(), scene()[:, ::-1]) > 30  # the twin: a mirror image is far off


@pytest.mark.parametrize("aspect", [Fraction(2), Fraction(1, 2), Fraction(4, 3)])
@pytest.mark.parametrize("orientation", [1, 6])
def test_pixels_become_square(tmp_path: Path, aspect: Fraction, orientation: int) -> None:
    upright = scene(96, 96)
    lying = np.rot90(upright, 1) if orientation == 6 else upright
    path = film(tmp_path / "a.mp4", lying[:, ::1], sample_aspect_ratio=aspect)
    displayed(path, MATRICES[orientation])
    long = round(96 * max(aspect, 1 / aspect))
    wide = (aspect > 1) == (orientation == 1)
    height, width = (96, long) if wide else (long, 96)
    still = next(video_frames(path))
    assert still.rgb().shape == (height, width, 3)
    assert worst(still.rgb(), scene(height, width)) <= 4
    assert still.luma.shape == (height, width)
    assert (facts(path).width, facts(path).height) == (width, height)


@pytest.mark.parametrize("aspect", [Fraction(1001, 1000), Fraction(90, 1)])
def test_nearly_square_and_absurd_pixels_are_square(tmp_path: Path, aspect: Fraction) -> None:
    path = film(tmp_path / "a.mp4", scene(), sample_aspect_ratio=aspect)
    assert next(video_frames(path)).rgb().shape == scene().shape


@pytest.mark.parametrize(
    ("number", "primaries", "name"), [(12, DISPLAY_P3, "Display P3"), (9, BT2020, "BT.2020")]
)
def test_wide_colours_become_srgb(
    tmp_path: Path, number: int, primaries: tuple[float, ...], name: str
) -> None:
    linear = srgb_decode(scene() / 255) @ np.linalg.inv(bt709_from_primaries(primaries)).T
    wide = np.round(srgb_encode(linear) * 255).astype(np.uint8)
    path = film(tmp_path / "a.mp4", wide, color_primaries=number, color_trc=1)
    photo = next(frames(path))
    assert worst(photo.pixels, scene()) <= 5
    assert worst(wide, scene()) > 15  # as it was read before
    assert photo.notes == (f"{name} video, converted to sRGB",)


def test_television_primaries_and_curves_stay_as_they_are(tmp_path: Path) -> None:
    """Phones name BT.601's and players do not care."""
    path = film(tmp_path / "a.mp4", scene(), color_primaries=5, color_trc=5)
    photo = next(frames(path))
    assert worst(photo.pixels, scene()) <= 4
    assert photo.notes == ()


def test_the_container_speaks_where_the_frame_is_silent(tmp_path: Path) -> None:
    with av.open(str(film(tmp_path / "a.mp4", scene()))) as container:
        frame = next(container.decode(video=0))
    said = Appearance(primaries=9, transfer=18, matrix=9, full_range=True).with_frame(frame)
    assert (said.primaries, said.transfer, said.hdr) == (9, 18, "HLG")
    assert (said.matrix, said.full_range) == (1, False)  # the frame's own words


def test_a_cover_is_not_the_film() -> None:
    def stream(disposition: int, codec: str | None = "h264") -> SimpleNamespace:
        known = None if codec is None else SimpleNamespace(name=codec)
        return SimpleNamespace(disposition=disposition, codec_context=known)

    cover, thumbnails, second, film, unknown = (
        stream(1024 | 1),
        stream(2048),
        stream(0),
        stream(1),
        stream(1, codec=None),
    )

    def chosen(*streams: SimpleNamespace) -> SimpleNamespace | None:
        return _film_of(SimpleNamespace(streams=SimpleNamespace(video=streams)))

    assert chosen(cover, unknown, thumbnails, second, film) is film
    assert chosen(cover, second) is second
    assert chosen(cover) is None
    track = stream(1, codec="mjpeg")  # a cover as Matroska's tracks are by default
    assert chosen(track, second) is second
    assert chosen(track) is track


def test_a_cover_that_is_a_track_is_not_the_film(tmp_path: Path) -> None:
    with av.open(str(tmp_path / "a.mkv"), "w") as container:
        cover = container.add_stream("mjpeg", rate=1)
        film = container.add_stream("libx264", rate=30, options={"crf": "2"})
        tracks = ((cover, "yuvj420p", 255), (film, "yuv420p", 100))
        for stream, kind, _ in tracks:
            stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, kind
        for stream, kind, value in tracks:
            grey = np.full((HEIGHT, WIDTH, 3), value, np.uint8)
            frame = av.VideoFrame.from_ndarray(grey, format="rgb24").reformat(format=kind)
            container.mux(stream.encode(frame))
            container.mux(stream.encode())
    (photo,) = frames(tmp_path / "a.mkv")
    assert np.abs(photo.pixels.astype(int) - 100).max() < 4


@pytest.mark.parametrize("name", ["take:1.mp4", "http:x.mp4", "concat:a|b.mp4", "50%25 d.mp4"])
def test_names_that_look_like_addresses_are_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    film(tmp_path / "a.mp4", scene()).rename(tmp_path / name)
    monkeypatch.chdir(tmp_path)
    assert worst(next(frames(name)).pixels, scene()) <= 4


def test_tags_in_an_old_encoding_are_harmless(tmp_path: Path) -> None:
    path = film(tmp_path / "a.mov", scene())
    content = path.read_bytes()
    assert content.count(b"VideoHandler") == 1
    path.write_bytes(content.replace(b"VideoHandler", b"Vid\xe9oHandler"))
    assert worst(next(frames(path)).pixels, scene()) <= 4


PLAYLISTS = {
    "a.mp4": "ffconcat version 1.0\nfile {film}\n",
    "b.mp4": "#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n{film}\n#EXT-X-ENDLIST\n",
    "c.mp4": '<?xml version="1.0"?><MPD xmlns="urn:mpeg:dash:schema:mpd:2011"><Period/></MPD>',
    "d.mp4": "{film}\n",
    "e.mp4": "\ufeff#EXTM3U\n{film}\n",
    "f.mp4": "ffconcat version 1.0\n# é\nfile {film}\n",
}


@pytest.mark.parametrize("name", PLAYLISTS)
def test_lists_of_other_files_are_refused(
    tmp_path: Path, name: str, capfd: pytest.CaptureFixture[str]
) -> None:
    film(tmp_path / "film.mp4", scene())
    text = PLAYLISTS[name].format(film="film.mp4")
    (tmp_path / name).write_text(text, "latin-1" if "é" in text else "utf-8")
    with pytest.raises(ImageFileError, match="list of other files") as caught:
        list(frames(tmp_path / name))
    assert "\n" not in str(caught.value)
    assert capfd.readouterr().err == ""


def test_numbered_pictures_are_no_film(tmp_path: Path) -> None:
    from PIL import Image

    Image.fromarray(scene()).save(tmp_path / "1.png")
    (tmp_path / "1.png").rename(tmp_path / "%d.mp4")
    with pytest.raises(ImageFileError):
        list(frames(tmp_path / "%d.mp4"))


SAME = ["hflip", "transposed", "sar2", "cover_art", "handler_name_latin1"]


@pytest.mark.parametrize("name", SAME)
def test_films_of_other_programs(cases: Path, name: str) -> None:
    wanted = [photo.pixels.astype(int) for photo in frames(cases / "sound/video_upright.mp4")]
    (path,) = (cases / "sound").glob(f"video_{name}.*")
    got = [photo.pixels for photo in frames(path)]
    assert len(got) == len(wanted) == 2
    for picture, right in zip(got, wanted, strict=True):
        assert picture.shape == right.shape
        assert np.abs(picture - right).mean() < 1.5  # each was compressed anew
        assert np.abs(picture[:, ::-1] - right).mean() > 10


def test_hlg_of_the_container_alone(cases: Path) -> None:
    path = cases / "sound/video_hlg_only_in_colr_h264.mp4"
    assert facts(path).transfer == "HLG"
    (note,) = next(frames(path)).notes
    assert "HLG" in note


@pytest.mark.parametrize(
    ("codec", "layout"), [("qtrle", "argb"), ("prores_ks", "yuva444p10le"), ("png", "rgba")]
)
@pytest.mark.parametrize("alpha", [255, 0, 128])
def test_what_a_film_lets_through_is_mid_grey(
    tmp_path: Path, codec: str, layout: str, alpha: int
) -> None:
    picture = np.dstack([scene(), np.full((HEIGHT, WIDTH), 255, np.uint8)])
    picture[:, : WIDTH // 2, 3] = alpha
    path = tmp_path / "a.mov"
    with av.open(str(path), "w") as container:
        stream = container.add_stream(codec, rate=30)
        stream.height, stream.width, stream.pix_fmt = HEIGHT, WIDTH, layout
        frame = av.VideoFrame.from_ndarray(picture, format="rgba")
        container.mux(stream.encode(frame.reformat(format=layout, dst_colorspace=1)))
        container.mux(stream.encode())
    still = next(iter(frames(path)))
    assert still.notes == ("transparent parts taken as mid-grey",)
    shown = still.pixels.astype(float)
    wanted = picture[..., :3].astype(float)
    wanted[:, : WIDTH // 2] += (118 - wanted[:, : WIDTH // 2]) * (1 - alpha / 255)
    quarters = [np.s_[4:20, 4:28], np.s_[4:20, 36:60], np.s_[28:44, 4:28], np.s_[28:44, 36:60]]
    assert max(np.abs(shown[q].mean((0, 1)) - wanted[q].mean((0, 1))).max() for q in quarters) < 6
