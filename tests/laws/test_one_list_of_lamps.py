"""An estimate's lamps are one list and its main light is the first of them, wherever they are
said: in Python, in the .json, in the preview's marks and in every file that has lights."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from jaxtyping import Float

from deeplight.camera_response import LUMINANCE
from deeplight.edit import Edit, direction_of
from deeplight.environment import Environment
from deeplight.estimators.environment import SceneLight, scene_light
from deeplight.estimators.estimate import load_estimator
from deeplight.estimators.network import Estimate
from deeplight.estimators.preview import ACCENT, LIGHT_SIZE, MARGIN, PHOTO_BOX, preview
from deeplight.estimators.results import write_results
from deeplight.formats import gltf
from deeplight.formats.files import FileSpec, write_environment
from deeplight.formats.webxr import light_estimate
from deeplight.frames import normalised, world_from_camera
from deeplight.harmonics import irradiance_coefficients, spherical_harmonics
from deeplight.io.environment_file import read_environment
from deeplight.io.tilt import Tilt
from deeplight.lamp import Lamp, draw_lamps
from deeplight.mappings import latlong

HALL = Path(__file__).parents[2] / "examples" / "photos" / "hall.jpg"
LAMPS = tuple(
    Lamp(normalised(np.array(toward)), np.array(flux), 0.06)
    for toward, flux in (
        ([0.3, 0.7, 0.6], [0.5, 0.5, 0.4]),
        ([0.1, 0.8, 0.5], [0.4, 0.4, 0.5]),
        ([-0.8, 0.3, -0.2], [0.2, 0.3, 0.2]),
    )
)
"""The first two stand so near each other that a search in the panorama takes them for one."""


@pytest.fixture(scope="module")
def estimate() -> Estimate:
    return load_estimator().explain(HALL)


@pytest.fixture(scope="module")
def scene(estimate: Estimate) -> SceneLight:
    return scene_light(estimate, 128)


@pytest.fixture(scope="module")
def made() -> Environment:
    """A gradient, and lamps of which two are near each other."""
    up = latlong.directions(128, 256)[..., 1:2]
    rest = ((0.2 + 0.1 * up) * np.ones(3)).astype(np.float32)
    return Environment(rest + draw_lamps(LAMPS, 128), known_lamps=LAMPS)


def flux_of(radiance: np.ndarray) -> Float[np.ndarray, "3"]:
    return np.einsum("ij,ijc->c", latlong.solid_angles(*radiance.shape[:2]), radiance)


def numbers(lamps: tuple[Lamp, ...]) -> np.ndarray:
    return np.array([[*lamp.direction, *lamp.flux, lamp.angular_radius_rad] for lamp in lamps])


def holds_its_power_once(environment: Environment) -> bool:
    both = flux_of(environment.ambient) + sum(lamp.flux for lamp in environment.lamps)
    return both == pytest.approx(flux_of(environment.radiance), rel=1e-4)


def test_python_has_the_estimates_lamps_and_the_first_is_the_main_light(scene: SceneLight) -> None:
    environment = scene.environment
    assert len(scene.lamps) > 1
    assert environment.lamps == scene.lamps
    main = environment.main_light
    np.testing.assert_allclose(main.direction, scene.lamps[0].direction, atol=1e-6)
    np.testing.assert_allclose(main.irradiance, scene.lamps[0].irradiance, rtol=1e-5)
    share = scene.lamps[0].luminous_flux / (flux_of(environment.radiance) @ LUMINANCE)
    assert main.share == pytest.approx(share, rel=1e-3)
    assert environment.ambient == pytest.approx(scene.rest, abs=1e-3)


def test_the_json_says_the_same_and_comes_back_as_it_was(
    estimate: Estimate, scene: SceneLight, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    black = np.zeros((8, 8, 3), np.uint8)  # the picture takes longer than all the rest
    monkeypatch.setattr("deeplight.estimators.results.preview", lambda *_: black)
    write_results(estimate, load_estimator(), tmp_path, "hall", scene)
    record = json.loads((tmp_path / "hall.json").read_text())
    listed = [lamp["direction"] for lamp in record["lamps"]["lamps"]]
    np.testing.assert_array_equal(listed, [lamp.direction for lamp in scene.lamps])
    said = record["dominant_light"]
    np.testing.assert_allclose(said["primary_light_direction"], listed[0], atol=1e-6)
    irradiance = scene.lamps[0].irradiance
    np.testing.assert_allclose(said["primary_light_intensity"], irradiance, rtol=1e-5)
    again = read_environment(tmp_path / "hall.json")
    np.testing.assert_array_equal(numbers(again.lamps), numbers(scene.lamps))
    assert holds_its_power_once(again)
    assert again.ambient == pytest.approx(scene.rest, rel=1e-3, abs=1e-3)


def test_the_previews_marks_are_these_lamps(estimate: Estimate, scene: SceneLight) -> None:
    picture = preview(estimate, scene.environment, "hall")
    left, (width, height) = 2 * MARGIN + PHOTO_BOX[0], LIGHT_SIZE
    panorama = picture[64 : 64 + height, left : left + width]
    marked = (panorama == ACCENT).all(-1)
    places = [latlong.position(lamp.direction[None], height, width) for lamp in scene.lamps]
    y, x = np.nonzero(marked)
    away = np.array([np.hypot(y - row, x - column) for row, column in places])
    assert (away < 20).any(1).all()  # each lamp has a ring
    assert (away < 20).any(0).all()  # and each ring a lamp
    said = preview(estimate, scene.environment, "hall", elsewhere="its detail invented")
    changed = np.nonzero((said != picture).any((1, 2)))[0]
    assert len(changed) > 5
    assert 64 + height <= changed.min() <= changed.max() < 64 + height + 40  # under it


def written_lights(text: str, kind: str) -> list[Float[np.ndarray, "3"]]:
    """Irradiances in a text file of this kind."""
    if kind == "usda":
        found = re.findall(r"color = \((.*?)\).*?inputs:intensity = (\S+)", text, re.DOTALL)
        return [np.array(json.loads(f"[{colour}]")) * float(power) for colour, power in found]
    if kind == "json":
        listed = json.loads(text)["lamps"]["lamps"]
    else:
        listed = json.loads(
            re.search(r'lights = (\[.*\]);|loads\("""(.*)"""', text).expand(r"\1\2")
        )
    return [np.array(light["irradiance"]) for light in listed]


@pytest.mark.parametrize("kind", ["json", "js", "py", "usda"])
def test_every_format_with_lights_has_this_list(
    made: Environment, kind: str, tmp_path: Path
) -> None:
    if kind == "usda":
        pytest.importorskip("pxr")
    path = tmp_path / f"a.{kind}"
    write_environment(made, FileSpec(path, lamps_apart=True))
    found = written_lights(path.read_text(), kind)
    np.testing.assert_allclose(found, [lamp.irradiance for lamp in LAMPS], rtol=1e-5)


def test_gltf_has_this_list(made: Environment) -> None:
    document = gltf._document(made)
    lights = document["extensions"]["KHR_lights_punctual"]["lights"]
    found = [np.multiply(light["color"], light["intensity"]) for light in lights]
    np.testing.assert_allclose(found, [lamp.irradiance for lamp in LAMPS], rtol=1e-5)


def test_without_lamps_no_format_makes_one_up() -> None:
    dim = Environment(draw_lamps(LAMPS, 64) + np.float32(0.2), known_lamps=())
    document = gltf._document(dim)
    assert "KHR_lights_punctual" not in document["extensionsUsed"]
    assert "nodes" not in document
    assert dim.main_light.irradiance.any()  # AR wants one all the same


def test_harmonics_and_the_main_light_are_the_whole(made: Environment) -> None:
    said = light_estimate(made.lighting, made.main_light)
    x, y, z = (said["primaryLightDirection"][name] for name in "xyz")
    np.testing.assert_allclose([x, y, z], LAMPS[0].direction, atol=1e-6)
    rest = irradiance_coefficients(spherical_harmonics(made.main_light.remainder))[0]
    whole = irradiance_coefficients(spherical_harmonics(made))[0]
    mean = LAMPS[0].flux / np.sqrt(4 * np.pi) * np.pi
    np.testing.assert_allclose(rest + mean, whole, rtol=0.02)


@pytest.mark.parametrize(
    "edit",
    [
        Edit(main_light=0.25),
        Edit(main_light_to=(-40, 30)),
        Edit(turn=(30, -20, 10)),
        Edit(tint=(1.2, 1, 0.7), stops=1.5),
        Edit(neutral=0.3),
    ],
)
def test_an_edit_changes_panorama_and_lamps_alike(made: Environment, edit: Edit) -> None:
    edited = made.edited(edit)
    assert holds_its_power_once(edited)
    gain = np.array(edit.tint) * 2**edit.stops * (1 - edit.neutral)
    first = LAMPS[0].flux * gain * edit.main_light
    toward = LAMPS[0].direction if edit.main_light_to is None else direction_of(*edit.main_light_to)
    (found,) = [x for x in edited.lamps if x.flux == pytest.approx(first, rel=1e-6)]
    assert found.direction == pytest.approx(edit.new_from_old @ toward, abs=1e-6)
    others = draw_lamps([x for x in edited.lamps if x is not found], edited.height)
    peak = edited.radiance[tuple(np.argwhere(draw_lamps([found], edited.height)[..., 1] > 0)[0])]
    assert (peak > edited.ambient.max((0, 1))).all() or others.any()


def test_the_tilt_that_the_json_says_makes_the_light_level(made: Environment) -> None:
    tilt = Tilt(*np.radians([-25.0, 8.0]), "a test")
    level = made.edited(Edit(turn=(0.0, np.degrees(tilt.pitch_rad), np.degrees(tilt.roll_rad))))
    for lamp, before in zip(level.lamps, made.lamps, strict=True):
        assert lamp.direction[1] == pytest.approx(before.direction @ tilt.up, abs=1e-6)


def test_a_turned_light_keeps_its_lamps_small(made: Environment) -> None:
    turned = made.turned(world_from_camera(0.3, 0.2, 0.1))
    assert numbers(turned.lamps)[:, 3:] == pytest.approx(numbers(LAMPS)[:, 3:])
    assert holds_its_power_once(turned)
    assert turned.ambient.max() < 0.5
