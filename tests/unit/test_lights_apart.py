"""Lights apart from the environment: in every format the two together are the whole, once."""

import json
import re

import numpy as np
import pytest

from deeplight.cli.main import main
from deeplight.environment import Environment
from deeplight.errors import ConfigError
from deeplight.formats.files import FORMATS, write_environment
from deeplight.frames import normalised
from deeplight.io.environment_file import read_environment
from deeplight.io.radiance import read_hdr, write_exr
from deeplight.lamp import Lamp, draw_lamps
from deeplight.mappings import latlong, resample

SPEC = write_environment.__annotations__["spec"]
LAMPS = (
    Lamp(normalised(np.array([0.5, 0.8, 0.3])), np.array([3.0, 2.6, 2.0]), 0.08),
    Lamp(normalised(np.array([-0.6, 0.4, -0.7])), np.array([0.8, 0.9, 1.2]), 0.05),
)


@pytest.fixture(scope="module")
def environment() -> Environment:
    """A gradient with two lamps, and a photo that shows a part of it."""
    up = latlong.directions(128, 256)[..., 1:2]
    seen = (latlong.directions(128, 256)[..., 2] < -0.9).astype(np.float32)
    return Environment((0.2 + 0.1 * up) * np.ones(3) + draw_lamps(LAMPS, 128), seen)


def flux_of(radiance: np.ndarray) -> np.ndarray:
    return np.einsum("ij,ijc->c", latlong.solid_angles(*radiance.shape[:2]), radiance)


def irradiance_of(radiance: np.ndarray, normals: np.ndarray) -> np.ndarray:
    weights = latlong.solid_angles(*radiance.shape[:2])[..., None]
    directions = latlong.directions(*radiance.shape[:2]).reshape(-1, 3)
    return np.maximum(normals @ directions.T, 0) @ (radiance * weights).reshape(-1, 3)


def test_the_lamps_are_found_and_with_the_rest_they_are_the_whole(environment):
    assert len(environment.lamps) == 2
    for found, drawn in zip(environment.lamps, LAMPS, strict=True):
        assert found.direction @ drawn.direction > np.cos(np.radians(1))
        assert found.flux == pytest.approx(drawn.flux, rel=0.05)
        assert found.angular_radius_rad == pytest.approx(drawn.angular_radius_rad, rel=0.25)
    whole = flux_of(environment.ambient) + sum(lamp.flux for lamp in environment.lamps)
    assert whole == pytest.approx(flux_of(environment.radiance), rel=1e-4)
    assert environment.ambient.max() < 0.5


def test_an_even_world_has_only_its_main_light():
    even = Environment(np.full((32, 64, 3), 0.4))
    assert even.lamps == ()
    assert even.main_light.irradiance.max() < 1e-6


def split(environment, path) -> tuple[np.ndarray, list[tuple[np.ndarray, np.ndarray]]]:
    """The environment without lights, and direction and irradiance of each, in our frame."""
    text = path.read_text()
    if path.suffix == ".json":
        record = json.loads(text)
        assert record["lamps"]["in_environment"] is False
        lights = [(x["direction"], x["irradiance"]) for x in record["lamps"]["lamps"]]
        return read_hdr(path.with_suffix(".exr")), lights
    if path.suffix == ".js":
        assert "lightsApart = true" in text
        lights = json.loads(re.search(r"lights = (\[.*\]);", text)[1])
        exr, quarter = path.with_suffix(".three.exr"), -1
    else:
        assert 'APART = json.loads("true")' in text
        lights = json.loads(re.search(r'loads\("""(.*)"""', text)[1])
        exr, quarter = path.with_suffix(".blender.exr"), -1
    turned = read_hdr(exr)
    rest = np.roll(turned, -quarter * turned.shape[1] // 4, axis=1)
    return rest, [(x["direction"], x["irradiance"]) for x in lights]


@pytest.mark.parametrize("name", ["light.json", "light.js", "light.py"])
def test_rest_and_lights_give_the_whole_irradiance_once(environment, tmp_path, name):
    write_environment(environment, SPEC(tmp_path / name, lamps_apart=True))
    rest, lights = split(environment, tmp_path / name)
    normals = latlong.directions(6, 12).reshape(-1, 3)
    both = irradiance_of(rest, normals)
    for direction, irradiance in lights:
        both = both + np.maximum(normals @ np.array(direction), 0)[:, None] * np.array(irradiance)
    whole = irradiance_of(environment.radiance, normals)
    assert np.abs(both - whole).mean() < 0.02 * whole.mean()
    twice = both + irradiance_of(draw_lamps(LAMPS, 128), normals)  # the twin: counted twice
    assert np.abs(twice - whole).mean() > 0.2 * whole.mean()


def test_without_being_asked_the_environment_holds_everything(environment, tmp_path):
    write_environment(environment, SPEC(tmp_path / "light.js"))
    assert "lightsApart = false" in (tmp_path / "light.js").read_text()
    turned = read_hdr(tmp_path / "light.three.exr")
    np.testing.assert_array_equal(np.roll(turned, 64, axis=1), environment.radiance)


@pytest.mark.parametrize("apart", [True, False])
def test_a_lighting_file_comes_back_whole_either_way(environment, tmp_path, apart):
    path = tmp_path / "light.json"
    write_environment(environment, SPEC(path, size=128, lamps_apart=apart))
    again = read_environment(path)
    assert flux_of(again.radiance) == pytest.approx(flux_of(environment.radiance), rel=1e-3)
    normals = latlong.directions(6, 12).reshape(-1, 3)
    before, after = (irradiance_of(e.radiance, normals) for e in (environment, again))
    assert np.abs(before - after).max() < 0.02 * before.mean()
    assert (again.seen > 0.5).mean() == pytest.approx((environment.seen > 0.5).mean(), rel=0.1)


def test_gltf_has_a_light_for_each_lamp(environment, tmp_path):
    write_environment(environment, SPEC(tmp_path / "light.gltf"))
    document = json.loads((tmp_path / "light.gltf").read_text())
    lights = document["extensions"]["KHR_lights_punctual"]["lights"]
    assert len(lights) == 2
    assert document["scenes"][0]["nodes"] == [0, 1]
    for node, lamp in zip(document["nodes"], LAMPS, strict=True):
        x, y, z, w = node["rotation"]
        shines = -np.array(  # the third column of the quaternion's matrix, -Z
            [2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)]
        )
        assert -shines @ lamp.direction > np.cos(np.radians(1))


def openexr_direction(u: float, v: float) -> np.ndarray:
    """OpenEXR's latlong map: longitude pi to -pi from left to right, 0 at +Z, pi/2 at +X."""
    longitude, latitude = np.pi * (1 - 2 * u), np.pi * (0.5 - v)
    across = np.cos(latitude)
    return np.array([across * np.sin(longitude), np.sin(latitude), across * np.cos(longitude)])


@pytest.mark.parametrize("suffix", [".usda", ".usdc"])
def test_usd_opens_with_the_lights_in_their_places(environment, tmp_path, suffix):
    usd = pytest.importorskip("pxr.Usd")
    from pxr import Gf, UsdGeom, UsdLux

    path = tmp_path / f"light{suffix}"
    write_environment(environment, SPEC(path))
    stage = usd.Stage.Open(str(path))
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    dome = UsdLux.DomeLight(stage.GetPrimAtPath("/deeplight/environment"))
    texture = dome.GetTextureFileAttr().Get()
    assert texture.resolvedPath.endswith("light.usd.exr")
    picture = read_hdr(texture.resolvedPath)
    for row, column in ((10, 30), (64, 100), (90, 200)):
        direction = openexr_direction((column + 0.5) / 256, (row + 0.5) / 128)
        ours = resample.sample_latlong(environment.ambient, direction[None])[0]
        np.testing.assert_allclose(picture[row, column], ours, rtol=1e-3)
    distant = [p for p in stage.Traverse() if p.IsA(UsdLux.DistantLight)]
    assert len(distant) == 2
    for prim, lamp in zip(distant, LAMPS, strict=True):
        light = UsdLux.DistantLight(prim)
        matrix = UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(0)
        shines = np.array(matrix.TransformDir(Gf.Vec3d(0, 0, -1)))
        assert -shines @ lamp.direction > np.cos(np.radians(1))
        assert light.GetNormalizeAttr().Get()
        irradiance = np.array(light.GetColorAttr().Get()) * light.GetIntensityAttr().Get()
        assert irradiance == pytest.approx(lamp.irradiance, rel=0.06)
        assert light.GetAngleAttr().Get() == pytest.approx(
            np.degrees(2 * lamp.angular_radius_rad), rel=0.25
        )


def test_apart_from_what_has_no_lights_is_refused(tmp_path):
    assert "usd" in FORMATS
    with pytest.raises(ConfigError, match="lamps-apart"):
        SPEC(tmp_path / "light.ktx2", lamps_apart=True)


def test_the_command_writes_a_stage(tmp_path, capsys):
    pytest.importorskip("pxr")
    write_exr(tmp_path / "in.exr", np.full((32, 64, 3), 0.5, np.float32))
    assert main(["convert", str(tmp_path / "in.exr"), "--out", str(tmp_path / "a.usda")]) == 0
    assert (tmp_path / "a.usda").read_text().startswith("#usda")
    assert "a.usd.exr" in capsys.readouterr().out


def test_a_stage_of_a_name_that_is_not_utf_8_is_refused(tmp_path, capsys):
    pytest.importorskip("pxr")
    write_exr(tmp_path / "in.exr", np.full((32, 64, 3), 0.5, np.float32))
    name = str(tmp_path / "a\udcff.usda")
    assert main(["convert", str(tmp_path / "in.exr"), "--out", name]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["in.exr"]
