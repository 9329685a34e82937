"""Light from one's own photographs: simulated brackets give back the light they were taken in."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from deeplight.bracket.ball import Circle, find_circle, unwrapped, uv_showing
from deeplight.bracket.card import GREY_ROW
from deeplight.bracket.exposures import exposure_amount, read_frames
from deeplight.bracket.probe import Probe, ProbeSettings, measure
from deeplight.bracket.response import recovered
from deeplight.camera_response import LUMINANCE
from deeplight.cli.main import main
from deeplight.errors import ConfigError, ImageFileError
from deeplight.frames import looking_at
from deeplight.io.environment_file import read_environment
from deeplight.mappings import latlong, resample
from deeplight.sphere import SphereView

pytestmark = pytest.mark.needs("cv2")

TIMES = (1 / 2000, 1 / 500, 1 / 125, 1 / 30, 1 / 8, 1 / 2)


def tone_curve(linear: np.ndarray) -> np.ndarray:
    """No camera of ours: gamma 2.05 with an S on top."""
    pixel = np.clip(linear, 0, 1) ** (1 / 2.05)
    return pixel + 0.2 * pixel * (1 - pixel) * (2 * pixel - 1)


def environment(height: int = 128, sun: float = 25.0) -> np.ndarray:
    """Smooth light, 1000 : 1 from floor to sky, and a sun six degrees wide."""
    rays = latlong.directions(height, 2 * height)
    sky = np.array([0.5, 0.8, 1.2]) * np.exp(2 * rays[..., 1:2])
    floor = 0.02 * np.array([1.0, 0.8, 0.6]) * (1.2 + np.sin(6 * rays[..., 0:1]))
    light = floor + sky / (1 + np.exp(-9 * rays[..., 1:2]))
    towards = np.array([0.6, 0.5, -0.62])
    near = rays @ (towards / np.linalg.norm(towards))
    edge = np.clip((near[..., None] - np.cos(0.06)) * 1000, -30, 30)
    return (light + sun / (1 + np.exp(-edge))).astype(np.float32)


def tiles() -> np.ndarray:
    """Edges to align by."""
    return np.kron(np.random.default_rng(3).uniform(0.4, 1, (16, 32)), np.ones((8, 8)))[..., None]


def write_bracket(
    folder: Path,
    radiance: np.ndarray,
    times: tuple[float, ...] = TIMES,
    exif: bool = True,
    noise: float = 0.004,
    shifts: dict[int, tuple[int, int]] | None = None,
    **tags: Any,
) -> list[Path]:
    """Photos with pixel = curve(radiance * time * 50), as JPEG with EXIF."""
    folder.mkdir(exist_ok=True, parents=True)
    random = np.random.default_rng(0)
    paths = []
    for number, time in enumerate(times):
        linear = np.clip(radiance * time * 50, 0, 1)
        noisy = linear + noise * np.sqrt(linear) * random.normal(size=linear.shape)
        pixels = np.round(tone_curve(noisy) * 255).astype(np.uint8)
        pixels = np.roll(pixels, (shifts or {}).get(number, (0, 0)), (0, 1))
        data = Image.Exif()
        if exif:
            camera = data.get_ifd(0x8769)
            camera[0x829A] = IFDRational(1, round(1 / time))
            camera[0x829D], camera[0x8827] = IFDRational(4, 1), 100
            for tag, value in tags.items():
                camera[int(tag[1:], 16)] = value
        paths.append(folder / f"{number}.jpg")
        Image.fromarray(pixels).save(paths[-1], exif=data, quality=98, subsampling=0)
    return paths


def panorama_probe(paths: list[Path], **settings: Any) -> Probe:
    return measure(paths, ProbeSettings(shows="panorama", **settings))


def relative_errors(found: np.ndarray, true: np.ndarray) -> np.ndarray:
    """After one common factor: the unit is another test's."""
    factor = np.median(found / true)
    return np.abs(found / factor / true - 1)


# -- radiance --------------------------------------------------------------------------------------


def test_a_bracket_of_an_unknown_camera_gives_its_radiance_back(tmp_path: Path) -> None:
    """Through 8 bits, noise and JPEG: half of all texels within 1.2 %, all power within 2 %."""
    true = environment()
    probe = panorama_probe(write_bracket(tmp_path, true))
    errors = relative_errors(probe.environment.radiance, true)
    assert np.median(errors) < 0.012
    assert np.quantile(errors, 0.9) < 0.03
    weight = latlong.solid_angles(128, 256)[..., None]
    power, wanted = ((light * weight).sum((0, 1)) for light in (probe.environment.radiance, true))
    assert (power / wanted) / np.mean(power / wanted) == pytest.approx(np.ones(3), abs=0.02)
    bright = true.mean(-1) > 15
    floor = true.mean(-1) < 0.05
    contrast = probe.environment.radiance[bright].mean() / probe.environment.radiance[floor].mean()
    assert contrast == pytest.approx(true[bright].mean() / true[floor].mean(), rel=0.02)


def test_a_wrong_response_would_not(tmp_path: Path) -> None:
    """The twin: gamma 2.2 for a camera that is not."""
    true = environment()
    probe = panorama_probe(write_bracket(tmp_path, true), gamma=2.2)
    assert np.quantile(relative_errors(probe.environment.radiance, true), 0.9) > 0.05


def test_photos_in_any_order_give_the_same(tmp_path: Path) -> None:
    paths = write_bracket(tmp_path, environment())
    first, second = (panorama_probe(list(order)) for order in (paths, paths[::-1]))
    assert (first.environment.radiance == second.environment.radiance).all()


def test_the_recovered_curve_is_the_cameras(tmp_path: Path) -> None:
    response = recovered(read_frames(write_bracket(tmp_path, environment())))
    linear = np.linspace(0.01, 0.9, 60)[:, None].repeat(3, 1)
    stops = np.log2(response.linear(tone_curve(linear).astype(np.float32)) / linear)
    assert np.abs(stops - np.median(stops)).max() < 0.1
    assert np.abs(stops - np.median(stops)).mean() < 0.03


def test_light_that_the_shortest_exposure_clips_is_reported(tmp_path: Path) -> None:
    probe = panorama_probe(write_bracket(tmp_path, environment(sun=1e5)))
    assert any("white in the shortest exposure" in fact for fact in probe.facts)
    whole = panorama_probe(write_bracket(tmp_path / "b", environment(sun=10.0)))
    assert not any("white in" in fact for fact in whole.facts)


# -- scale and colour ------------------------------------------------------------------------------


def with_card(radiance: np.ndarray, colour: np.ndarray) -> np.ndarray:
    radiance = radiance.copy()
    radiance[90:110, 40:70] = 0.18 * colour
    return radiance


def test_a_grey_card_makes_light_neutral_and_sets_the_unit(tmp_path: Path) -> None:
    """Illuminated by orange light of 2: the card's 0.18 comes out as grey 0.18."""
    light = 2 * np.array([1.4, 1.0, 0.5])
    paths = write_bracket(tmp_path, with_card(environment(), light))
    probe = panorama_probe(paths, card=(40, 90, 30, 20))
    shown = probe.environment.radiance[95:105, 45:65].mean((0, 1))
    assert shown == pytest.approx(np.full(3, 0.18), rel=0.02)
    without = panorama_probe(paths).environment.radiance[95:105, 45:65].mean((0, 1))
    assert without[0] / without[2] > 2


def test_like_gives_the_unit_of_that_photo(tmp_path: Path) -> None:
    """Radiance whose photo is at level 128 comes out as gamma 2.2 reads that level."""
    true = environment()
    (photo,) = write_bracket(tmp_path / "photo", true, times=(1 / 60,), noise=0)
    probe = panorama_probe(write_bracket(tmp_path, true), like=photo)
    pixels = np.asarray(Image.open(photo)).astype(float)
    middle = (np.abs(pixels - 128) <= 2).all(-1)
    one_channel = np.abs(pixels - 128) <= 1
    chosen = middle[..., None] if middle.any() else one_channel
    shown = probe.environment.radiance[np.broadcast_to(chosen, pixels.shape)]
    assert np.median(shown) == pytest.approx((128 / 255) ** 2.2, rel=0.03)
    assert probe.environment.unit == "camera_white"
    assert exposure_amount(photo) == pytest.approx(1 / 60 / 16)


def test_a_chart_linearises_within_a_twentieth_of_a_stop(tmp_path: Path) -> None:
    """Two exposures alone say little of the curve; with the chart its grey row comes out right."""
    radiance = environment()
    patches = np.zeros((4, 6))
    patches[3] = GREY_ROW
    patches[:3] = 0.2
    chart = np.kron(patches, np.ones((10, 10)))[..., None] * np.array([1.2, 1.0, 0.8]) * 0.5
    radiance[70:110, 100:160] = chart
    corners = (100, 70, 160, 70, 160, 110, 100, 110)
    paths = write_bracket(tmp_path, radiance, times=(1 / 60, 1 / 30), noise=0.001)

    def stops_off(probe: Probe) -> float:
        row = probe.environment.radiance[102:108, 100:160].reshape(6, 6, 10, 3)[:, :, 3:7]
        stops = np.log2(row.mean((0, 2, 3)) / GREY_ROW)
        return float(np.abs(stops - stops.mean()).max())

    assert stops_off(panorama_probe(paths, chart=corners)) < 0.05
    assert stops_off(panorama_probe(paths)) > 0.1  # the twin
    turned = (160, 110, 100, 110, 100, 70, 160, 70)
    with pytest.raises(ConfigError, match="grey row"):
        panorama_probe(paths, chart=turned)


# -- the ball --------------------------------------------------------------------------------------


def ball_picture(
    light: np.ndarray, circle: Circle, focal: float | None, shape: tuple[int, int] = (300, 400)
) -> np.ndarray:
    """A picture of a ball in light from far away, traced ray by ray."""
    rows, columns = np.mgrid[: 4 * shape[0], : 4 * shape[1]] / 4 + 0.125
    if focal is None:
        u, v = (columns - circle.x) / circle.radius, (circle.y - rows) / circle.radius
        view = SphereView()
    else:
        towards = np.array([circle.x - shape[1] / 2, shape[0] / 2 - circle.y, -focal])
        cosine = focal / np.linalg.norm(towards)
        angle = np.arctan(circle.radius / focal * cosine**1.5)
        view = SphereView(looking_at(towards), float(angle))
        rays = np.stack(
            [columns - shape[1] / 2, shape[0] / 2 - rows, np.full_like(rows, -focal)], -1
        )
        own = rays @ view.ball_from_camera.T
        u, v = (own[..., i] / -own[..., 2] / np.tan(angle) for i in (0, 1))
    normals, views = view.surface(u, v)
    shown = 2 * (normals * views).sum(-1, keepdims=True) * normals - views
    picture = 0.827 * resample.sample_latlong(light, shown)
    outside = np.full_like(picture, 0.05)
    picture = np.where((np.hypot(u, v) < 1)[..., None], picture, outside)
    return picture.reshape(shape[0], 4, shape[1], 4, 3).mean((1, 3)).astype(np.float32)


@pytest.mark.parametrize(
    ("circle", "focal"),
    [(Circle(200.0, 150.0, 120.0), None), (Circle(240.0, 130.0, 90.0), 600.0)],
)
def test_a_ball_gives_the_light_that_it_was_in(circle: Circle, focal: float | None) -> None:
    light = environment()
    picture = ball_picture(light, circle, focal)
    found, seen = unwrapped(picture, circle, focal)
    true = resample.shrink_latlong(light, len(found))
    known = (seen > 0.99) & (true.mean(-1) < 3 * np.median(true))
    errors = np.abs(found / 0.827 / true - 1)[known]
    assert np.median(errors) < 0.02
    weight = latlong.solid_angles(*seen.shape)
    assert np.average(seen, weights=weight) == pytest.approx(0.96, abs=0.025)
    rays = latlong.directions(*seen.shape)
    unseen = rays[seen < 0.5].mean(0)
    behind = np.array([circle.x - 200, 150 - circle.y, -(focal or 1e9)])
    assert unseen @ behind / np.linalg.norm(unseen) / np.linalg.norm(behind) > 0.99
    power = np.einsum("ij,ijc->c", weight * (seen > 0.5), found / 0.827)
    assert power == pytest.approx(np.einsum("ij,ijc->c", weight * (seen > 0.5), true), rel=0.02)


def test_a_near_ball_taken_for_a_far_one_would_be_wrong() -> None:
    """The twin."""
    light, circle = environment(), Circle(240.0, 130.0, 90.0)
    found, seen = unwrapped(ball_picture(light, circle, 600.0), circle, None)
    true = resample.shrink_latlong(light, len(found))
    assert np.median(np.abs(found / 0.827 / true - 1)[seen > 0.99]) > 0.03


def test_every_direction_is_found_where_the_ball_shows_it() -> None:
    view = SphereView(looking_at(np.array([0.3, -0.2, -1.0])), 0.15)
    u, v = np.random.default_rng(0).uniform(-0.68, 0.68, (2, 200))
    normals, views = view.surface(u, v)
    shown = 2 * (normals * views).sum(-1, keepdims=True) * normals - views
    np.testing.assert_allclose(np.stack(uv_showing(shown, view)), np.stack([u, v]), atol=1e-3)


def test_the_ball_is_found_in_the_picture() -> None:
    picture = ball_picture(environment(sun=0), Circle(210.0, 140.0, 80.0), None)
    found = find_circle(np.sqrt(np.clip(picture, 0, 1)))
    assert abs(found.x - 210) < 2
    assert abs(found.y - 140) < 2
    assert abs(found.radius - 80) < 2
    with pytest.raises(ConfigError, match="--ball"):
        find_circle(np.full((100, 100, 3), 0.5, np.float32))


def test_the_command_measures_a_ball(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Photo files to a file of ours, in the unit of a photo taken next to it."""
    light = environment(sun=20.0)
    picture = ball_picture(light, Circle(200.0, 150.0, 120.0), None)
    paths = write_bracket(tmp_path / "photos", picture)
    words = ["probe", *map(str, paths), "--out", str(tmp_path / "truth.exr")]
    words += ["--like", str(paths[3]), "--check", str(tmp_path / "check")]
    assert main(words) == 0
    printed = capsys.readouterr().out
    assert "6 exposures over 10.0 stops" in printed
    assert "97.0% of all directions" in printed
    assert {path.name for path in (tmp_path / "check").iterdir()} == {
        "merged.png",
        "environment.png",
    }
    found = read_environment(tmp_path / "truth.exr")
    true = resample.shrink_latlong(light, found.height)
    weight = latlong.solid_angles(found.height, 2 * found.height)
    powers = [
        np.einsum("ij,ijc->c", weight, radiance) @ LUMINANCE for radiance in (found.radiance, true)
    ]
    white = TIMES[3] * 50  # radiance 1 is so much of the sensor's range
    assert powers[0] / powers[1] == pytest.approx(white * curve_factor(), rel=0.05)
    first = tmp_path / "other.exr"
    assert main(["probe", str(paths[0]), "--times", "1", "2", "--out", str(first)]) == 2
    assert not first.exists()


def curve_factor() -> float:
    """What gamma 2.2 reads at level 128, over what the camera meant by it."""
    levels = tone_curve(np.linspace(0, 1, 4096))
    meant = np.interp(128 / 255, levels, np.linspace(0, 1, 4096))
    return float((128 / 255) ** 2.2 / meant)


# -- one clear line --------------------------------------------------------------------------------


def test_wrong_order_missing_exif_and_misaligned_frames_are_reported(tmp_path: Path) -> None:
    true = environment()
    bare = write_bracket(tmp_path / "bare", true, exif=False)
    with pytest.raises(ImageFileError, match=r"0\.jpg without one; give --times"):
        panorama_probe(bare)
    assert panorama_probe(bare, times=TIMES).facts[0].startswith("6 exposures")
    with pytest.raises(ConfigError, match=r"jpg, darker than .*jpg; give the times in the order"):
        panorama_probe(bare, times=TIMES[::-1])
    with pytest.raises(ConfigError, match="6 exposure times; got 2"):
        panorama_probe(bare, times=TIMES[:2])
    with pytest.raises(ConfigError, match="with the same"):
        panorama_probe(bare, times=(*TIMES[:5], TIMES[4]))
    true = true * tiles()
    moved = write_bracket(tmp_path / "moved", true, shifts={4: (0, 9), 5: (0, 9)})
    with pytest.raises(ConfigError, match=r"\.jpg, off by 9 x 0 pixels; use a tripod"):
        panorama_probe(moved)
    straight = panorama_probe(moved, align=True).environment.radiance
    assert np.median(relative_errors(straight, true)) < 0.02
    assert panorama_probe(write_bracket(tmp_path / "still", true)).facts[0].startswith("6 exp")
    Image.fromarray(np.zeros((64, 100, 3), np.uint8)).save(bare[0])
    with pytest.raises(ConfigError, match="photos of one size"):
        panorama_probe(bare, times=TIMES)


def test_settings_that_cannot_be_are_refused(tmp_path: Path) -> None:
    paths = write_bracket(tmp_path, environment(height=64), times=TIMES[:2])
    for settings in (
        {"card": (0, 0, 500, 20)},
        {"chart": (1, 2, 3)},
        {"ball": (10.0, 10.0, 500.0), "shows": "mirror-ball"},
        {"times": (0.0, 1.0)},
    ):
        with pytest.raises(ConfigError):
            measure(paths, ProbeSettings(**{"shows": "panorama", **settings}))
    with pytest.raises(ConfigError, match="reflectances"):
        ProbeSettings(reflectivity=0)
    square = write_bracket(tmp_path / "b", environment(64)[:, :64], times=TIMES[:2])
    with pytest.raises(ConfigError, match="twice as wide"):
        panorama_probe(square)
