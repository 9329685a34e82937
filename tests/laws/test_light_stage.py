"""From photographs under single lights to a basis: what must hold whatever the sphere."""

from pathlib import Path

import numpy as np
import pytest

from deeplight.camera_response import CameraResponse
from deeplight.frames import looking_at
from deeplight.io.light_stage_file import StageLights, write_lights
from deeplight.light_stage.lobe import basis_weights, light_shares, lobe_weights, uncovered_share
from deeplight.light_stage.measure import Measured, MeasureSettings, measure
from deeplight.light_stage.picture import made_up_light
from deeplight.mappings import mirror_ball
from deeplight.reflectance import analytic_basis
from deeplight.relight import relight
from deeplight.sphere import PAPER_RIG, SphereView
from lab.light_stage.run import LightStage, lights_of, rings, write_light_stage

TINY = LightStage(("matte_silver", "diffuse"), photo_px=48, spacing_deg=18.0, supersample=2)
RESPONSE = CameraResponse()


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("stage")
    write_light_stage(folder, TINY)
    return folder


@pytest.fixture(scope="module")
def measured(stage: Path) -> Measured:
    return measure(stage, MeasureSettings())


def l1(a: np.ndarray, b: np.ndarray, mask: np.ndarray) -> float:
    first, second = (RESPONSE.pixel_from_radiance(r) for r in (a, b))
    return float(np.abs(first - second)[mask].mean())


def test_the_papers_spacing_gives_rings_of_even_density() -> None:
    lights = rings(12.0)
    equator = lights[np.abs(lights[:, 1]) < 1e-9]
    assert len(equator) == 30  # 12 degrees apart, section 3.3
    np.testing.assert_allclose(np.linalg.norm(lights, axis=1), 1)
    shares = light_shares(lights)
    assert shares.sum() == pytest.approx(4 * np.pi, rel=1e-4)
    assert np.quantile(shares, 0.9) < 1.4 * np.quantile(shares, 0.1)


@pytest.mark.parametrize("passes", [1, 2, 3])
def test_white_light_stays_white_however_the_lights_lie(passes: int, unit_vectors) -> None:
    """Photographs that are all alike give a basis of that value: trap no. 4."""
    lights = unit_vectors(150)  # random: dense here, sparse there
    weights = basis_weights(np.full((2, 150), 0.3 / np.pi), lights, 16, passes)
    np.testing.assert_allclose(weights.sum(axis=1), 0.3 * 4, rtol=1e-3)
    directions = unit_vectors(50)
    np.testing.assert_allclose(lobe_weights(directions, lights, passes).sum(axis=1), 1, atol=1e-4)


def test_uneven_lights_give_a_lambertian_its_reflectivity() -> None:
    """The twin of the density: twice the lights on one side must not count twice."""
    even = rings(15.0)
    lights = np.concatenate([even, even[even[:, 0] > 0.2] + [0, 0.02, 0]])
    lights /= np.linalg.norm(lights, axis=1, keepdims=True)
    normals = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 0, 1.0]])
    photographs = np.maximum(normals @ lights.T, 0) / np.pi
    weights = basis_weights(photographs, lights, 32)
    np.testing.assert_allclose(weights.sum(axis=1), 1, atol=0.01)
    counted_twice = photographs.mean(axis=1) * 4 * np.pi
    assert abs(counted_twice[0] - 1) > 0.1


def test_a_second_pass_gives_back_what_the_lobe_blurs() -> None:
    lights = rings(12.0)
    wanted = np.maximum(rings(7.0)[:, 2], 0) ** 8
    errors = [
        np.abs(
            lobe_weights(rings(7.0), lights, passes) @ (np.maximum(lights[:, 2], 0) ** 8) - wanted
        )
        for passes in (1, 2)
    ]
    assert errors[1].max() < 0.4 * errors[0].max()


@pytest.mark.parametrize("name", ["diffuse", "matte_silver"])
def test_furnace_of_photographed_spheres(measured: Measured, name: str) -> None:
    """Perspective, noise, colour spread, dark room: within 1 % of the reflectivity."""
    sphere = measured.certificate.spheres[name]
    assert sphere.measured == pytest.approx(sphere.expected, rel=0.01)
    assert sphere.lowest > 0.85 * sphere.expected  # the ball is 36 px wide: its rim is blurred
    assert max(abs(c - 1) for c in sphere.colour) < 0.01
    assert measured.certificate.passes


@pytest.mark.parametrize("name", ["diffuse", "matte_silver"])
def test_a_photographed_sphere_is_relit_like_the_analytic_one(measured: Measured, name) -> None:
    basis = measured.bases[name]
    light = made_up_light(32)
    analytic = relight(analytic_basis(name, basis.view), light)
    mask = basis.view.mask()
    assert l1(relight(basis, light), analytic, mask) < 0.01
    assert l1(relight(basis, light)[:, ::-1], analytic, mask) > 0.03  # the twin: flipped


def far(folder: Path, gain: float) -> Path:
    """The same lights, stated as `gain` times as bright and far away, which is quicker to read."""
    lights = lights_of(TINY)
    assert lights.colours is not None
    described = StageLights(lights.files, lights.directions, lights.colours * gain, calibrated=True)
    write_lights(folder / f"{gain}.json", described)
    return folder / f"{gain}.json"


def test_half_the_stated_light_is_twice_the_basis(stage: Path, tmp_path: Path) -> None:
    fov = float(np.degrees(TINY.scene().camera.vertical_fov_rad))
    one, two = (
        measure(
            stage / "diffuse",
            MeasureSettings("diffuse", far(tmp_path, gain), fov_deg=fov, gamma=1.0),
        ).bases["diffuse"]
        for gain in (1.0, 0.5)
    )
    np.testing.assert_allclose(two.weights, 2 * one.weights, rtol=1e-4, atol=1e-9)


def test_one_given_reflectivity_scales_every_sphere(
    stage: Path, measured: Measured, tmp_path: Path
) -> None:
    how = MeasureSettings(lights=far(tmp_path, 3.0), reflectivity={"diffuse": 0.69})
    doubled = measure(stage, how)
    assert doubled.certificate.spheres["diffuse"].measured == pytest.approx(0.69)
    before, after = (m.certificate.spheres["matte_silver"].measured for m in (measured, doubled))
    assert after == pytest.approx(2 * before, rel=0.02)
    assert not doubled.certificate.passes  # silver of 1.29 is no silver


def test_missing_lights_below_are_reported() -> None:
    all_around, upper = rings(15.0), rings(15.0, lowest_deg=-20)
    assert uncovered_share(all_around) == 0
    assert 0.1 < uncovered_share(upper) < 0.4  # a cap below -45 degrees is 15 %


def test_a_turned_basis_is_that_of_the_turned_sphere() -> None:
    """The same sphere elsewhere in the picture, within the width of a pixel of light."""
    light = made_up_light(32)
    for name, most in (("diffuse", 0.002), ("matte_silver", 0.004)):
        rig_view = PAPER_RIG.views[name]
        straight = SphereView(np.eye(3), rig_view.angular_radius_rad)
        turned = analytic_basis(name, straight).turned(rig_view)
        wanted = relight(analytic_basis(name, rig_view), light)
        mask = rig_view.mask()
        assert l1(relight(turned, light), wanted, mask) < most
        assert l1(relight(analytic_basis(name, straight), light), wanted, mask) > 2 * most
        np.testing.assert_allclose(turned.furnace()[mask], wanted_furnace(name), rtol=0.005)


def wanted_furnace(name: str) -> float:
    return {"diffuse": 0.345, "matte_silver": 0.644}[name]


def test_turning_there_and_back_keeps_the_energy(unit_vectors) -> None:
    basis = analytic_basis("diffuse", SphereView(size=8))
    towards = unit_vectors(5) * [1, 0.3, 1]
    for direction in towards:
        there = basis.turned(SphereView(looking_at(direction), size=8))
        np.testing.assert_allclose(there.furnace(), basis.furnace(), rtol=1e-5)
        assert (there.weights[:, mirror_ball.coverage(32).ravel() == 0] == 0).all()
