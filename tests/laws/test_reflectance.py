"""The bases: white furnace, the paper's one-hot mirror, and each material's own signature."""

import numpy as np
import pytest

from deeplight import brdf, frames
from deeplight.mappings import mirror_ball
from deeplight.reflectance import ReflectanceBasis, analytic_basis, rig_bases
from deeplight.sphere import PAPER_RIG, SPHERES, SphereView

MEASURED = {"mirror": 0.827, "matte_silver": 0.644, "diffuse": 0.345}  # section 3.1


def test_reflectivities_are_the_papers() -> None:
    assert brdf.REFLECTIVITY == MEASURED


@pytest.mark.parametrize("light_size", [16, 32, 64])
@pytest.mark.parametrize("material", SPHERES)
def test_white_furnace(material: str, light_size: int) -> None:
    """White light renders the reflectivity in every masked pixel of the rig's own frames."""
    basis = rig_bases(PAPER_RIG, light_size)[material]
    furnace = basis.furnace()[basis.view.mask()]
    np.testing.assert_allclose(furnace, MEASURED[material], rtol=0.005)
    shown = basis.furnace()[basis.view.alpha() > 0]  # no dark rim in a composite
    np.testing.assert_allclose(shown, MEASURED[material], rtol=0.02)


@pytest.mark.parametrize("material", SPHERES)
def test_white_furnace_in_mirrored_and_far_tilted_frames(material: str) -> None:
    tilted = SphereView(frames.looking_at(np.array([0.8, -0.4, -1.0])), np.radians(15), 16)
    for view in (PAPER_RIG.mirrored().views[material], tilted):
        basis = analytic_basis(material, view)
        np.testing.assert_allclose(basis.furnace()[view.mask()], MEASURED[material], rtol=0.005)


@pytest.mark.parametrize("material", SPHERES)
def test_no_surface_gives_back_negative_light_and_nothing_shows_off_the_sphere(material) -> None:
    basis = rig_bases(PAPER_RIG)[material]
    assert (basis.weights >= 0).all()
    assert (basis.weights[basis.view.alpha().ravel() == 0] == 0).all()
    off_the_ball = mirror_ball.coverage(32).ravel() == 0
    assert (basis.weights[:, off_the_ball] == 0).all()


@pytest.mark.parametrize("size", [16, 32])
def test_mirror_is_one_hot_in_the_papers_frame(size: int) -> None:
    """Section 3.3: one-hot matrices scaled by the measured reflectivity."""
    basis = analytic_basis("mirror", SphereView(size=size), size)
    lit = mirror_ball.coverage(size).ravel() > 0
    want = np.diag(np.where(lit, 0.827, 0)).astype(np.float32)
    # A rim sliver may also see the pixel next to it; whole pixels see themselves alone.
    whole = SphereView(size=size).mask().ravel()
    np.testing.assert_allclose(basis.weights[whole], want[whole], atol=1e-7)
    assert (basis.weights.argmax(axis=1)[whole] == np.flatnonzero(whole)).all()


def test_mirror_in_a_spheres_frame_shows_the_light_it_reflects() -> None:
    """Where neither crop nor light is squeezed at a rim: the weights' mean direction."""
    view, weights = PAPER_RIG.views["mirror"], rig_bases(PAPER_RIG)["mirror"].weights
    reflected = view.reflected().reshape(-1, 3)
    facing = (view.normals() * view.views()).sum(-1).ravel() > 0.5
    plain = facing & (reflected[:, 2] > -0.5) & view.mask().ravel()
    mean = weights[plain] @ mirror_ball.pixel_directions(32).reshape(-1, 3)
    mean /= np.linalg.norm(mean, axis=1, keepdims=True)
    angle = np.degrees(np.arccos(np.clip((mean * reflected[plain]).sum(-1), -1, 1)))
    assert plain.sum() > 300
    assert angle.max() < 3.0


def test_diffuse_is_lamberts_cosine() -> None:
    """Against the cosine at the pixel's own normal, light pixel by light pixel."""
    view = PAPER_RIG.views["diffuse"]
    weights = rig_bases(PAPER_RIG)["diffuse"].weights
    mask = view.mask().ravel()
    normals = view.normals().reshape(-1, 3)[mask]
    whole = mirror_ball.coverage(32).ravel() > 0.999
    cosine = np.maximum(normals @ mirror_ball.pixel_directions(32).reshape(-1, 3)[whole].T, 0)
    want = 0.345 / np.pi * cosine * 16 / 1024
    error = np.abs(weights[mask][:, whole] - want)
    assert error.max() < 0.10 * want.max()  # rim pixels are wide
    assert error.mean() < 0.002 * want.max()


def test_matte_silver_peaks_near_the_mirror_direction_and_is_wider() -> None:
    view = PAPER_RIG.views["matte_silver"]
    weights = rig_bases(PAPER_RIG)["matte_silver"].weights
    facing = ((view.normals() * view.views()).sum(-1) > 0.7).ravel()
    light = mirror_ball.pixel_directions(32).reshape(-1, 3)
    peak = light[weights.argmax(axis=1)]
    cosine = (peak * view.reflected().reshape(-1, 3)).sum(-1)[facing]
    assert np.degrees(np.arccos(np.clip(cosine, -1, 1))).max() < 20
    assert ((weights > 1e-5).sum(axis=1)[facing] > 200).all()


def test_matte_silver_is_view_dependent_and_diffuse_is_not() -> None:
    """Seen from another side the same patch of silver shows other light (trap 4)."""
    near, far = SphereView(angular_radius_rad=np.radians(30), size=16), SphereView(size=16)
    for material, changes in (("matte_silver", True), ("diffuse", False)):
        n = analytic_basis(material, near).weights.reshape(16, 16, -1)
        f = analytic_basis(material, far).weights.reshape(16, 16, -1)
        # Two pixels, one in each crop, with the same normal.
        wanted = near.normals()[8, 12]
        row, column = np.unravel_index((far.normals() @ wanted).argmax(), (16, 16))
        difference = np.abs(n[8, 12] - f[row, column]).sum() / f[row, column].sum()
        assert (difference > 0.15) == changes, (material, difference)


def test_rough_specular_is_helmholtz_reciprocal(unit_vectors) -> None:
    """Swapping light and view swaps only the cosine: f(l, v) = f(v, l)."""
    light, view = (np.abs(unit_vectors(500)) + [0, 0, 0.05] for _ in range(2))
    light, view = (d / np.linalg.norm(d, axis=-1, keepdims=True) for d in (light, view))
    n_l, n_v, l_v = light[:, 2], view[:, 2], (light * view).sum(axis=1)
    there = brdf.rough_specular(n_l, n_v, l_v) / n_l
    back = brdf.rough_specular(n_v, n_l, l_v) / n_v
    np.testing.assert_allclose(there, back, rtol=1e-6)


def test_rough_specular_gives_back_at_most_what_it_gets(unit_vectors) -> None:
    """Single scattering loses light at grazing views, never makes any."""
    lights = unit_vectors(100_000)
    for tilt_deg, least in ((0, 0.86), (45, 0.84), (80, 0.72)):
        tilt = np.radians(tilt_deg)
        view = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
        weights = brdf.rough_specular(lights[:, 2], view[2:], lights @ view)
        albedo = weights.mean() * 4 * np.pi
        assert least < albedo < 1.0, (tilt_deg, albedo)


def test_a_basis_built_twice_is_the_same_object_in_memory() -> None:
    first, second = (rig_bases(PAPER_RIG)["diffuse"] for _ in range(2))
    assert first is second


def test_a_basis_from_photographs_is_accepted_as_any_other() -> None:
    view = SphereView(size=4)
    basis = ReflectanceBasis(np.full((16, 64), 1 / 64, np.float32), view, 8)
    np.testing.assert_allclose(basis.furnace(), 1)
