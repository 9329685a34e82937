"""Equations 1 and 2: linear in the light, true to flips and rotations."""

from collections.abc import Callable

import numpy as np
import pytest

from deeplight import frames
from deeplight.lighting import Lighting
from deeplight.mappings import latlong
from deeplight.reflectance import analytic_basis, rig_bases
from deeplight.relight import relight, relight_rig
from deeplight.sphere import PAPER_RIG, SPHERES, SphereView

TURN = frames.world_from_camera(0.7, 0.4, -0.2)


@pytest.fixture
def random_light(rng: np.random.Generator) -> Callable[[], Lighting]:
    """Light with a dynamic range of some five decades."""
    return lambda: Lighting(np.exp(rng.normal(-1, 2, (32, 32, 3))).astype(np.float32))


def smooth(directions: np.ndarray) -> np.ndarray:
    """A smooth, coloured panorama with no symmetry; (..., 3) radiance of directions."""
    lobes = np.array([[0.3, 0.8, -0.5], [-0.9, 0.1, 0.2], [0.1, -0.7, 0.6]])
    lobes /= np.linalg.norm(lobes, axis=1, keepdims=True)
    return (0.2 + np.exp(3 * (directions @ lobes.T - 1))).astype(np.float32)


def smooth_light(camera_from_world: np.ndarray | None = None) -> Lighting:
    return Lighting.from_latlong(smooth(latlong.directions(512, 1024)), camera_from_world)


def turned_view(view: SphereView, new_from_old: np.ndarray) -> SphereView:
    return SphereView(view.ball_from_camera @ new_from_old.T, view.angular_radius_rad, view.size)


def test_white_light_renders_the_reflectivities() -> None:
    spheres = relight_rig(PAPER_RIG, Lighting(np.ones((32, 32, 3), np.float32)))
    for name, reflectivity in zip(SPHERES, (0.827, 0.644, 0.345), strict=True):
        mask = PAPER_RIG.views[name].mask()
        np.testing.assert_allclose(spheres[name][mask], reflectivity, rtol=0.005)
        assert (spheres[name][PAPER_RIG.views[name].alpha() == 0] == 0).all()


def test_relight_is_linear(random_light) -> None:
    a, b = random_light(), random_light()
    mixed = relight_rig(PAPER_RIG, Lighting(0.3 * a.radiance + 2 * b.radiance))
    of_a, of_b = relight_rig(PAPER_RIG, a), relight_rig(PAPER_RIG, b)
    for name in SPHERES:
        want = 0.3 * of_a[name] + 2 * of_b[name]
        np.testing.assert_allclose(mixed[name], want, rtol=1e-4, atol=1e-5)


def test_colours_do_not_mix(random_light) -> None:
    radiance = np.array(random_light().radiance)
    radiance[..., 1] = 0
    for sphere in relight_rig(PAPER_RIG, Lighting(radiance)).values():
        assert (sphere[..., 1] == 0).all()


def test_equation_2_is_equation_1_of_e_to_the_q(rng: np.random.Generator) -> None:
    """A mirror pixel in the paper's frame is 0.827 e^Q."""
    log_radiance = rng.normal(0, 2, (32, 32, 3)).astype(np.float32)
    view = SphereView()
    rendered = relight(analytic_basis("mirror", view), Lighting.from_log_radiance(log_radiance))
    want = 0.827 * np.exp(log_radiance)
    np.testing.assert_allclose(rendered[view.mask()], want[view.mask()], rtol=1e-5)


@pytest.mark.parametrize("name", SPHERES)
def test_flipping_the_photo_flips_the_crops(name: str, random_light) -> None:
    """u -> -u: the mirrored rig in mirrored light is the flipped crop, to rounding."""
    light = random_light()
    flipped = relight_rig(PAPER_RIG.mirrored(), light.mirrored())[name]
    want = relight_rig(PAPER_RIG, light)[name][:, ::-1]
    mask = PAPER_RIG.views[name].mask()
    np.testing.assert_allclose(flipped[mask], want[mask], rtol=2e-4, atol=1e-4 * want.max())


@pytest.mark.parametrize("name", SPHERES)
def test_flipping_only_the_light_is_not_a_flipped_crop(name: str, random_light) -> None:
    """The twin: the spheres' own frames must change sides too."""
    light = random_light()
    wrong = relight_rig(PAPER_RIG, light.mirrored())[name]
    want = relight_rig(PAPER_RIG, light)[name][:, ::-1]
    if name == "matte_silver":  # in the middle of the frame: its own mirror image
        np.testing.assert_allclose(wrong, want, rtol=1e-3, atol=1e-3 * want.max())
        return
    mask = PAPER_RIG.views[name].mask()
    assert np.abs(wrong - want)[mask].mean() > 0.02 * want[mask].mean()


def test_mirrored_light_is_the_light_of_the_flipped_panorama() -> None:
    panorama = smooth(latlong.directions(512, 1024))
    flipped = Lighting.from_latlong(panorama[:, ::-1])
    want = Lighting.from_latlong(panorama).mirrored()
    np.testing.assert_allclose(flipped.radiance, want.radiance, rtol=1e-3)


@pytest.mark.parametrize("name", SPHERES)
def test_turning_light_and_sphere_together_leaves_the_crop(name: str) -> None:
    in_rig = PAPER_RIG.views[name]
    view = SphereView(in_rig.ball_from_camera, in_rig.angular_radius_rad, size=16)
    want = relight(analytic_basis(name, view), smooth_light())
    got = relight(analytic_basis(name, turned_view(view, TURN)), smooth_light(TURN))
    error = np.abs(got - want)[view.mask()] / want[view.mask()]
    assert error.mean() < 0.01
    # The mirror shows single pixels of light, up to 40 degrees wide where they lie on the rim.
    assert error.max() < {"mirror": 0.5, "matte_silver": 0.05, "diffuse": 0.005}[name]


@pytest.mark.parametrize("name", SPHERES)
def test_turning_the_light_alone_changes_the_crop(name: str) -> None:
    """The twin of the law above."""
    view = PAPER_RIG.views[name]
    basis = rig_bases(PAPER_RIG)[name]
    want, got = relight(basis, smooth_light()), relight(basis, smooth_light(TURN))
    assert (np.abs(got - want)[view.mask()] / want[view.mask()]).mean() > 0.05


def test_turning_the_light_is_turning_the_panorama() -> None:
    turned, direct = smooth_light().rotated(TURN), smooth_light(TURN)
    mask = SphereView().mask()
    error = np.abs(turned.radiance - direct.radiance)[mask] / direct.radiance[mask]
    assert error.mean() < 0.01
    assert error.max() < 0.2  # rim pixels are wide


def test_turning_there_and_back() -> None:
    light = smooth_light()
    back = light.rotated(TURN).rotated(TURN.T)
    mask = SphereView().mask()
    error = np.abs(back.radiance - light.radiance)[mask] / light.radiance[mask]
    assert error.mean() < 0.015
    np.testing.assert_allclose(back.power(), light.power(), rtol=1e-3)


def test_a_full_turn_in_quarters_comes_home() -> None:
    light = smooth_light()
    quarter = frames.rotation("y", np.pi / 2)
    turned = light
    for _ in range(4):
        turned = turned.rotated(quarter)
    mask = SphereView().mask()
    error = np.abs(turned.radiance - light.radiance)[mask] / light.radiance[mask]
    assert error.mean() < 0.03


def test_light_from_one_side_lights_that_side() -> None:
    """End to end, without any formula: right is right and up is up on every sphere."""
    directions = latlong.directions(256, 512)
    view = SphereView(size=16)
    bases = {name: analytic_basis(name, view) for name in SPHERES}
    for axis, (row, column) in {
        (1, 0, 0): (slice(None), slice(8, None)),
        (-1, 0, 0): (slice(None), slice(0, 8)),
        (0, 1, 0): (slice(0, 8), slice(None)),
        (0, -1, 0): (slice(8, None), slice(None)),
    }.items():
        lit = (directions @ np.array(axis, np.float32) > 0.8)[..., None]
        light = Lighting.from_latlong(np.repeat(lit, 3, axis=-1).astype(np.float32))
        for name in SPHERES:
            rendered = relight(bases[name], light)[..., 0]
            assert rendered[row, column].sum() > 0.75 * rendered.sum(), (axis, name)


@pytest.mark.parametrize("light_size", [16, 64])
def test_finer_or_coarser_light_gives_nearly_the_same_spheres(light_size: int) -> None:
    panorama = smooth(latlong.directions(512, 1024))
    want = relight_rig(PAPER_RIG, Lighting.from_latlong(panorama))
    got = relight_rig(PAPER_RIG, Lighting.from_latlong(panorama, size=light_size))
    for name, most in {"mirror": 0.05, "matte_silver": 0.01, "diffuse": 0.005}.items():
        mask = PAPER_RIG.views[name].mask()
        assert (np.abs(got[name] - want[name])[mask] / want[name][mask]).mean() < most
