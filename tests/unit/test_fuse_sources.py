"""What a photo's EXIF data say of its exposure."""

import math
from pathlib import Path

import pytest
from PIL import Image

from deeplight.fuse.sources import log_exposure_of

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
    assert log_exposure_of(file) == pytest.approx(math.log(0.01 * 400 / 4))


@pytest.mark.parametrize("tags", [{}, {"time": 0.01}, {"time": 0.01, "f_number": 0.0, "iso": 100}])
def test_what_is_missing_or_nonsense_is_not_known(tmp_path: Path, tags: dict[str, float]) -> None:
    assert math.isnan(log_exposure_of(photo(tmp_path / "a.jpg", **tags)))


def test_a_file_that_is_no_photo_is_not_known(tmp_path: Path) -> None:
    (tmp_path / "a.jpg").write_bytes(b"nothing")
    assert math.isnan(log_exposure_of(tmp_path / "a.jpg"))
