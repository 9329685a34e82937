"""What a photo's EXIF data say of its exposure; which frames of a long clip are kept."""

import math
import struct
import zlib
from functools import lru_cache
from pathlib import Path
from tempfile import mkdtemp

import cv2
import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from deeplight.fuse.frame import SourceFrame, log_exposure_of
from deeplight.fuse.panorama_photo import is_panorama
from deeplight.fuse.sources import MOST_FRAMES, read_frames, thinned
from deeplight.io.exif import exif_directories
from deeplight.io.video_writer import VideoWriter
from lab.pans import Sweep, Troubles, film_pan

pytestmark = pytest.mark.needs("cv2")

TIME, F_NUMBER, ISO = 0x829A, 0x829D, 0x8827


def photo(path: Path, **tags: float) -> Path:
    exif = Image.Exif()
    numbers = {"time": TIME, "f_number": F_NUMBER, "iso": ISO}
    exif.get_ifd(0x8769).update({numbers[name]: value for name, value in tags.items()})
    Image.new("RGB", (40, 40)).save(path, exif=exif)
    return path


def test_exposure_is_time_times_iso_over_f_number_squared(tmp_path: Path) -> None:
    file = photo(tmp_path / "a.jpg", time=0.01, f_number=2.0, iso=400)
    assert log_exposure_of(exif_directories(file)) == pytest.approx(math.log(0.01 * 400 / 4))


UNKNOWN = IFDRational(1, 0xFFFFFFFF)


@pytest.mark.parametrize(
    "tags",
    [
        {},
        {"time": 0.01},
        {"time": 0.01, "f_number": 0.0, "iso": 100},
        {"time": 0.01, "f_number": UNKNOWN, "iso": 100},
    ],
)
def test_what_is_missing_or_nonsense_is_not_known(tmp_path: Path, tags: dict[str, float]) -> None:
    assert math.isnan(log_exposure_of(exif_directories(photo(tmp_path / "a.jpg", **tags))))


def test_a_file_that_is_no_photo_is_not_known(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(b"nothing")
    assert math.isnan(log_exposure_of(exif_directories(tmp_path / "a.jpg")))


def test_a_header_that_lies_about_its_size_is_neither_known_nor_a_panorama(tmp_path: Path) -> None:
    file = tmp_path / "a.png"
    Image.new("RGB", (4, 4)).save(file)
    header = bytearray(file.read_bytes())
    header[16:24] = struct.pack(">II", 10**9, 10**9)  # width, height
    header[29:33] = struct.pack(">I", zlib.crc32(header[12:29]))
    file.write_bytes(header)
    assert math.isnan(log_exposure_of(exif_directories(file)))
    assert not is_panorama(file)


@pytest.mark.parametrize("length", [5, 160, 161, 1000])
def test_of_a_long_clip_few_frames_are_kept_evenly_spread(length: int) -> None:
    pixels = np.zeros((4, 4, 3), np.uint8)
    frames = (SourceFrame("", pixels, number) for number in range(length))
    numbers = [frame.number for frame in thinned(frames)]
    assert min(length, MOST_FRAMES // 2) <= len(numbers) <= MOST_FRAMES
    assert len(set(np.diff(numbers))) == 1
    assert numbers[0] == 0
    assert numbers[-1] + (numbers[1] - numbers[0]) >= length


@lru_cache
def slow_pan(overlay: bool) -> Path:
    """16 frames at 30 Hz, turning 14 degrees in all; three balls on a rod may turn with them."""
    rng = np.random.default_rng(3)
    place = np.full((256, 512, 3), 0.3, np.float32)
    for k in range(300):
        centre = int(rng.integers(512)), int(rng.integers(256))
        cv2.circle(place, centre, 2 + k % 20, rng.uniform(0.2, 0.4, 3).tolist(), -1)
    film = film_pan(place, Sweep(16, (0.0,), 14.0), Troubles(0.0), rng, (426, 240))
    path = Path(mkdtemp()) / "clip.mp4"
    with VideoWriter(path, 240, 426, 30.0) as writer:
        for frame in film.frames:
            pixels = np.array(frame.pixels)
            for k in range(3 * overlay):
                cv2.circle(pixels, (50 + 70 * k, 380), 30, (250, 240, 20 + 90 * k), -1)
                cv2.circle(pixels, (42 + 70 * k, 372), 9, (20, 20, 20), -1)
            writer.write(pixels)
    return path


@pytest.mark.parametrize("overlay", [False, True])
def test_frames_kept_of_a_slow_pan_overlap_whatever_moves_with_the_camera(overlay: bool) -> None:
    numbers = [frame.number for frame in read_frames([slow_pan(overlay)], None)]
    assert numbers[0] == 0
    assert 3 <= len(numbers) <= 8
    assert max(np.diff(numbers)) <= 8  # of 16
    assert numbers[-1] >= 10
