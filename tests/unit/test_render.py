"""What composing needs next to Mitsuba: the camera over the plane, look, layers, variant, light."""

import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from deeplight.camera import PinholeCamera
from deeplight.compose import mitsuba_variant as engine
from deeplight.compose.composite import composite, radiance_of, write_layers
from deeplight.compose.denoise import denoised
from deeplight.compose.ground import Viewpoint
from deeplight.compose.look import blurred, grain, look_of
from deeplight.compose.trace import Layers
from deeplight.errors import ConfigError, ImageFileError, InputError, MissingExtraError
from deeplight.io.environment_file import read_environment

VIEW = Viewpoint(PinholeCamera(640, 480, np.radians(50)), 1.4, np.radians(-20), np.radians(7))
RNG = np.random.default_rng(3)


@pytest.mark.parametrize("pixel", [(320, 400), (20, 470), (600, 250)])
def test_a_point_of_the_plane_is_seen_where_it_was_asked_for(pixel: tuple[int, int]) -> None:
    point = VIEW.point(*pixel)
    assert point[1] == pytest.approx(0, abs=1e-12)
    assert VIEW.pixels(point[None])[0] == pytest.approx(pixel)


def test_the_middle_of_a_level_photo_is_its_horizon() -> None:
    level = Viewpoint(VIEW.camera, 1.4, 0.0)
    with pytest.raises(ConfigError, match="horizon"):
        level.point(320, 240)
    assert level.point(320, 480)[2] == pytest.approx(-1.4 / np.tan(np.radians(25)))
    assert level.point(640, 400)[0] > 0  # right is +X


@pytest.mark.parametrize(
    "wrong", [{"height_m": 0.0}, {"height_m": float("nan")}, {"pitch_rad": 2.0}, {"roll_rad": -2.0}]
)
def test_an_impossible_camera_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        Viewpoint(VIEW.camera, **wrong)


@pytest.mark.parametrize("at", [(-1, 100), (320, 481), (float("nan"), 3)])
def test_a_place_outside_the_photo_is_refused(at: tuple[float, float]) -> None:
    with pytest.raises(ConfigError):
        VIEW.point(*at)


def test_grain_is_measured_and_given_back() -> None:
    x = np.linspace(60, 180, 256)
    clean = np.stack([np.tile(x, (192, 1))] * 3, -1)
    noisy = (clean + RNG.normal(0, [2.0, 3.0, 5.0], clean.shape)).round().astype(np.uint8)
    look = look_of(noisy)
    assert np.sqrt(np.diag(look.grain)) * 255 == pytest.approx([2, 3, 5], rel=0.15)
    given = grain(look, 100, 100, seed=1).std((0, 1))
    assert given == pytest.approx(np.sqrt(np.diag(look.grain)), rel=0.05)
    assert np.sqrt(np.diag(look_of(clean.astype(np.uint8)).grain)).max() * 255 < 1


@pytest.mark.parametrize("sigma", [0.0, 0.8, 1.6])
def test_blur_is_measured(sigma: float) -> None:
    y, x = np.mgrid[:800, :800] / 4
    edges = (np.sin(x / 9 + y / 23) > 0) * 150.0 + 50
    fine = np.repeat(edges[..., None], 3, -1).reshape(200, 4, 200, 4, 3).mean((1, 3))
    photo = blurred(fine, sigma).round().astype(np.uint8)
    assert look_of(photo).blur_px == pytest.approx(sigma, abs=0.25)


def test_denoising_borrows_from_like_surface_only() -> None:
    cover = np.ones((12, 20))
    cover[:, 16:] = 0
    normal = np.zeros((12, 20, 3))
    normal[:, :8, 0], normal[:, 8:, 1] = 1, 1
    clean = (
        np.where(np.arange(20)[:, None] < 8, [0.2, 0.4, 0.6], [2.0, 1.0, 0.5]) * cover[..., None]
    )
    assert denoised(clean, cover, normal * cover[..., None]) == pytest.approx(clean, abs=1e-6)
    noisy = clean + RNG.normal(0, 0.05, clean.shape) * cover[..., None]
    once = denoised(noisy, cover, normal * cover[..., None])
    assert (once - clean).std() < 0.35 * (noisy - clean).std()
    twice = denoised(once, cover, normal * cover[..., None], step=2)
    assert (twice - clean).std() < 0.8 * (once - clean).std()
    assert denoised(clean, cover, normal * cover[..., None], step=2) == pytest.approx(clean)


def test_a_crease_of_one_pixel_borrows_from_what_is_nearest_to_alike() -> None:
    cover, normal = np.ones((20, 21)), np.zeros((20, 21, 3))
    normal[:, :10, 0] = normal[:, 11:, 1] = 1
    share = RNG.uniform(0.2, 0.8, 20)  # no pixel of the crease is like another
    normal[:, 10, :2] = np.stack([share, 1 - share], -1)
    noisy = 1 + RNG.normal(0, 0.2, (20, 21, 3))
    crease = denoised(noisy, cover, normal)[:, 10]
    assert crease.std() < 0.6 * noisy[:, 10].std()
    assert denoised(noisy, cover, normal, cover)[:, 10].std() > 1.3 * crease.std()  # a mirror


def layers_of(height: int, width: int, crop: tuple[int, int, int, int]) -> Layers:
    cover = RNG.random((height, width)).astype(np.float32)
    radiance = RNG.random((height, width, 3)).astype(np.float32) * cover[..., None]
    return Layers(crop, radiance, cover, RNG.random((height, width, 3)).astype(np.float32))


def test_the_layers_file_gives_the_picture_back(tmp_path: Path) -> None:
    import OpenImageIO as oiio

    photo = RNG.integers(0, 250, (40, 50, 3), np.uint8)
    layers = layers_of(20, 30, (5, 10, 35, 30))
    write_layers(tmp_path / "a.exr", layers, 40, 50)
    file = oiio.ImageInput.open(str(tmp_path / "a.exr"))
    names, values = file.spec().channelnames, file.read_image()
    file.close()
    get = {name: values[..., i] for i, name in enumerate(names)}
    assert (get["A"] == get["mask.Y"]).all()
    rgb = np.stack([get[c] for c in "RGB"], -1)
    shadow = np.stack([get[f"shadow.{c}"] for c in "RGB"], -1)
    linear = radiance_of(photo) * shadow * (1 - get["A"][..., None]) + rgb
    from deeplight.compose.composite import RESPONSE

    expected = RESPONSE.pixel_from_radiance(linear.astype(np.float32)) * 255
    assert np.abs(composite(photo, layers).pixels - expected).max() <= 0.51


def test_layers_must_be_exr(tmp_path: Path) -> None:
    with pytest.raises(ImageFileError):
        write_layers(tmp_path / "a.png", layers_of(2, 2, (0, 0, 2, 2)), 4, 4)


def fake_probe(returncode: int, calls: list[Any]) -> Any:
    def run(command: list[str], **_: Any) -> SimpleNamespace:
        calls.append(command)
        return SimpleNamespace(returncode=returncode)

    return run


@pytest.mark.parametrize(("returncode", "works"), [(0, True), (-6, False), (1, False)])
def test_llvm_is_tried_once_in_a_child_process(
    returncode: int, works: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[Any] = []
    monkeypatch.setattr(subprocess, "run", fake_probe(returncode, calls))
    engine.llvm_works.cache_clear()
    assert engine.llvm_works() is works
    assert engine.llvm_works() is works
    assert len(calls) == 1
    if not works:
        with pytest.raises(ConfigError):
            engine.mitsuba("llvm")
        assert engine.mitsuba("auto").variant() == "scalar_rgb"
    engine.llvm_works.cache_clear()


@pytest.mark.parametrize(
    ("fails", "error", "says"),
    [
        ("raise ModuleNotFoundError('mitsuba')", MissingExtraError, "render"),
        ("raise ImportError('libatomic.so.1: no such file')", ConfigError, "libatomic.so.1"),
        (
            "try:\n    raise ImportError('libatomic.so.1: no such file')\n"
            "except ImportError:\n    not_defined",
            ConfigError,
            "libatomic.so.1",
        ),
    ],
)
def test_a_renderer_that_does_not_load_is_one_line(
    fails: str, error: type[InputError], says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mitsuba.py").write_text(fails)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "mitsuba", raising=False)
    with pytest.raises(error, match=says):
        engine.mitsuba()


def test_a_panorama_as_light_keeps_its_direction(tmp_path: Path) -> None:
    from deeplight.io.lighting_file import VIEW_U
    from deeplight.io.radiance import write_exr

    panorama = np.full((16, 32, 3), 0.1, np.float32)
    panorama[4, 24] = 100  # right of the view
    write_exr(tmp_path / "ours.exr", panorama)
    write_exr(tmp_path / "turned.exr", np.roll(panorama, -8, axis=1), {VIEW_U: 0.25})
    for name in ("ours.exr", "turned.exr"):
        assert read_environment(tmp_path / name).radiance == pytest.approx(panorama)
    write_exr(tmp_path / "narrow.exr", panorama[:, :20])
    with pytest.raises(ImageFileError):
        read_environment(tmp_path / "narrow.exr")
    write_exr(tmp_path / "black.exr", panorama * 0)
    with pytest.raises(ImageFileError):
        read_environment(tmp_path / "black.exr")
