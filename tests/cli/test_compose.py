"""`deeplight compose` as it is typed."""

from pathlib import Path

import numpy as np
import pytest

from deeplight.camera_response import CameraResponse
from deeplight.cli.main import main
from deeplight.compose.trace import Quality
from deeplight.io.photos import read_photo, write_png
from deeplight.io.radiance import read_hdr, write_exr

pytestmark = pytest.mark.needs("mitsuba")


SHORT = ["--engine", "scalar", "--pitch", "-30", "--fov", "50"]


@pytest.fixture(autouse=True)
def few_rays(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pictures this small need few."""
    monkeypatch.setattr("deeplight.compose.trace.PREVIEW", Quality(8, 8, 400))


@pytest.fixture
def photo(tmp_path: Path) -> Path:
    """A small photo of a warm, unevenly lit plane."""
    y, x = np.mgrid[:48, :64]
    radiance = (0.2 + 0.2 * x / 64 + 0.1 * y / 48)[..., None] * np.array([1.0, 0.8, 0.6])
    pixel = CameraResponse().pixel_from_radiance(radiance.astype(np.float32))
    path = tmp_path / "photo.png"
    write_png(path, (pixel * 255).astype(np.uint8))
    return path


@pytest.fixture
def light(tmp_path: Path) -> Path:
    """A faint sky with a lamp up on the left."""
    from deeplight.mappings import latlong

    lamp = latlong.directions(32, 64) @ np.array([-0.7, 0.7, 0.14], np.float32) > 0.98
    path = tmp_path / "light.exr"
    write_exr(path, (0.3 + 25 * lamp[..., None] * np.ones(3)).astype(np.float32))
    return path


def compose(*words: object) -> int:
    return main(["compose", *(str(word) for word in words)])


def test_two_objects_stand_where_they_were_put(
    photo: Path, light: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, layers = tmp_path / "new" / "out.png", tmp_path / "new" / "layers.exr"
    words = ["--object", "sphere", "--object", "sphere", "--at", 18, 34, "--at", 46, 34]
    words += ["--material", "mirror", "--material", "diffuse", "--size", "0.35"]
    code = compose(photo, *words, "--out", out, "--layers", layers, "--light", light, *SHORT)
    assert code == 0
    before, after = (read_photo(path).pixels.astype(int) for path in (photo, out))
    changed = np.abs(after - before).max(-1) > 8
    assert changed[27:33, 15:21].mean() > 0.7
    assert changed[27:33, 43:49].mean() > 0.7
    assert not changed[:12].any()
    assert read_hdr(layers).shape == (48, 64, 3)
    printed = capsys.readouterr().out
    assert "0.35 m" in printed
    assert "--pitch" not in printed  # it was given


def test_the_shadow_falls_away_from_a_given_sun(photo: Path, tmp_path: Path, capsys) -> None:
    lit = []
    for azimuth in (-90, 90):
        out = tmp_path / f"{azimuth}.exr"
        words = ["--object", "sphere", "--at", 32, 36, "--size", "0.4", "--layers", out]
        words += ["--sun", azimuth, 30, "--fill", "any", "--out", tmp_path / "a.png"]
        assert compose(photo, *words, *SHORT) == 0
        shadow = read_hdr_layer(out)
        lit.append(shadow[:, 40:].mean() - shadow[:, :24].mean())
    assert "sun placed, given by its angles" in capsys.readouterr().out
    assert lit[0] < -0.01 < 0.01 < lit[1]


def read_hdr_layer(path: Path) -> np.ndarray:
    """The shadow's factor in the layered file."""
    import OpenImageIO as oiio

    values: np.ndarray = oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT)
    names = oiio.ImageBuf(str(path)).spec().channelnames
    return values[..., names.index("shadow.G")]


def test_defaults_are_reported_warnings_first(photo: Path, tmp_path: Path, capsys) -> None:
    out = tmp_path / "a.jpg"
    assert compose(photo, "--object", "sphere", "--out", out, "--engine", "scalar") == 0
    printed = capsys.readouterr().out
    for assumption in ("field of view", "camera pitch from the network's guess", "sphere:"):
        assert assumption in printed
    assert printed.index("warning: the camera's pitch is unsure") < printed.index("field of view")
    assert read_photo(out).pixels.shape == (48, 64, 3)


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["--object", "none.glb"], "none.glb"),
        (["--object", "teapot"], "teapot"),
        (["--material", "gold"], "gold"),
        (["--at", "10", "2"], "horizon"),
        (["--at", "10", "200"], "inside the photo"),
        (["--size", "-1"], "size"),
        (["--camera-height", "0"], "height"),
        (["--pitch", "120"], "pitch"),
        (["--object", "sphere", "--object", "bunny", "--at", "30", "40"], "--at"),
        (["--material", "mirror", "--material", "silver"], "--material"),
        (["--layers", "a.png"], "--layers"),
        (["--sun", "0", "100"], "elevation"),
        (["--sun", "0", "40", "--light", "none.exr"], "--sun"),
        (["--fill", "any", "--light", "none.exr"], "--fill"),
        (["--light", "none.exr"], "none.exr"),
        (["--material", "file"], "built-in"),
    ],
)
def test_wrong_words_give_one_line_and_no_file(
    words: list[str], part: str, photo: Path, tmp_path: Path, capsys
) -> None:
    out = tmp_path / "results" / "out.png"
    assert compose(photo, "--out", out, "--fov", "50", "--engine", "scalar", *words) == 2
    printed = capsys.readouterr().err
    assert part in printed
    assert printed.count("\n") == 1
    assert not out.parent.exists()


def test_the_photo_is_never_overwritten(photo: Path) -> None:
    before = photo.read_bytes()
    assert compose(photo, "--out", photo) == 2
    assert photo.read_bytes() == before
    assert compose(photo, "--out", photo.with_suffix(".gif")) == 2
