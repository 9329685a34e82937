"""Spherical harmonics and the dominant light against brute force."""

import numpy as np
import pytest

from deeplight import frames, harmonics
from deeplight.lighting import Lighting
from deeplight.mappings import latlong, mirror_ball

DIRECTIONS = mirror_ball.pixel_directions(32).reshape(-1, 3)
SOLID_ANGLE = mirror_ball.solid_angles(32).reshape(-1, 1)

# Largest difference of a clamped cosine and its expansion to order 2, as a share of the light's
# power: 3/32, at a grazing surface (Ramamoorthi and Hanrahan 2001 quote 9 %).
BOUND = 3 / 32


def brute_irradiance(lighting: Lighting, normals: np.ndarray) -> np.ndarray:
    cosine = np.maximum(normals @ DIRECTIONS.T, 0)
    return cosine @ (SOLID_ANGLE * lighting.radiance.reshape(-1, 3))


def lobe(direction: np.ndarray, power: float = 10.0, ambient: float = 0.1) -> Lighting:
    """Even light and one ball pixel of sun."""
    radiance = np.full((32 * 32, 3), ambient, np.float32)
    pixel = mirror_ball.pixel_of_directions(direction[None], 32)
    radiance[pixel] += (power / SOLID_ANGLE[pixel]).astype(np.float32)
    return Lighting(radiance.reshape(32, 32, 3))


@pytest.fixture
def decades(rng: np.random.Generator) -> Lighting:
    """Light of four decades in every pixel."""
    return Lighting(np.exp(rng.normal(-1, 1.5, (32, 32, 3))).astype(np.float32))


def test_basis_is_orthonormal() -> None:
    values = harmonics.basis(latlong.directions(256, 512).astype(float)).reshape(-1, 9)
    gram = (values * latlong.solid_angles(256, 512).reshape(-1, 1)).T @ values
    np.testing.assert_allclose(gram, np.eye(9), atol=1e-4)


def test_order_and_signs_are_pinned() -> None:
    """1, y, z, x, xy, yz, 3z^2-1, xz, x^2-y^2 with positive constants: values at (2, 3, 6) / 7."""
    x, y, z = 2 / 7, 3 / 7, 6 / 7
    want = [
        0.282095,
        0.488603 * y,
        0.488603 * z,
        0.488603 * x,
        1.092548 * x * y,
        1.092548 * y * z,
        0.315392 * (3 * z * z - 1),
        1.092548 * x * z,
        0.546274 * (x * x - y * y),
    ]
    np.testing.assert_allclose(harmonics.basis(np.array([x, y, z])), want, atol=1e-5)


def test_higher_orders_are_orthonormal_and_follow_the_same_signs() -> None:
    values = harmonics.basis(latlong.directions(256, 512).astype(float), 4).reshape(-1, 25)
    gram = (values * latlong.solid_angles(256, 512).reshape(-1, 1)).T @ values
    np.testing.assert_allclose(gram, np.eye(25), atol=1e-3)
    x, y, z = 2 / 7, 3 / 7, 6 / 7
    got = harmonics.basis(np.array([x, y, z]), 4)
    np.testing.assert_allclose(got[:9], harmonics.basis(np.array([x, y, z])), atol=1e-12)
    want = {
        9: 0.590044 * y * (3 * x * x - y * y),
        12: 0.373176 * z * (5 * z * z - 3),
        15: 0.590044 * x * (x * x - 3 * y * y),
        16: 2.503343 * x * y * (x * x - y * y),
        20: 0.105786 * (35 * z**4 - 30 * z * z + 3),
    }
    np.testing.assert_allclose(got[list(want)], list(want.values()), atol=1e-5)


def test_turning_coefficients_is_turning_the_light(rng: np.random.Generator) -> None:
    new_from_old = frames.world_from_camera(0.4, 0.7, -0.3)
    old = rng.normal(size=(25, 3))
    new = harmonics.turning(new_from_old, 4) @ old
    seen = frames.turned(DIRECTIONS.astype(float), new_from_old)
    expected = harmonics.basis(DIRECTIONS.astype(float), 4) @ old
    np.testing.assert_allclose(harmonics.basis(seen, 4) @ new, expected, atol=1e-10)
    back = frames.turned(DIRECTIONS.astype(float), new_from_old.T)
    assert np.abs(harmonics.basis(back, 4) @ new - expected).max() > 0.5  # the other way round


def test_arcores_sign_negates_1_3_5_7() -> None:
    assert np.flatnonzero(harmonics.CONDON_SHORTLEY < 0).tolist() == [1, 3, 5, 7]


@pytest.mark.parametrize(("axis", "coefficient"), [((0, 1, 0), 1), ((0, 0, 1), 2), ((1, 0, 0), 3)])
def test_light_from_an_axis_fills_its_coefficient(axis, coefficient: int) -> None:
    coefficients = harmonics.spherical_harmonics(lobe(np.array(axis, float), ambient=0))
    assert coefficients[1:4].argmax(axis=0).tolist() == [coefficient - 1] * 3
    assert (coefficients[coefficient] > 0).all()
    opposite = harmonics.spherical_harmonics(
        lobe(-np.array(axis, float) + [0.01, 0.01, 0], ambient=0)
    )
    assert (opposite[coefficient] < 0).all()


def test_projection_is_the_integral_of_a_panorama() -> None:
    """Independent of the ball: a panorama's own sum, for the same light."""
    directions = latlong.directions(512, 1024)
    panorama = np.exp(2 * directions[..., [1, 2, 0]] - 1).astype(np.float32)
    values = harmonics.basis(directions).reshape(-1, 9)
    weight = latlong.solid_angles(512, 1024).reshape(-1, 1)
    want = (values * weight).T @ panorama.reshape(-1, 3)
    got = harmonics.spherical_harmonics(Lighting.from_latlong(panorama))
    np.testing.assert_allclose(got, want, atol=0.01 * np.abs(want).max())


def test_white_light_gives_irradiance_pi_everywhere(unit_vectors) -> None:
    coefficients = harmonics.spherical_harmonics(Lighting(np.ones((32, 32, 3), np.float32)))
    irradiance = harmonics.irradiance(coefficients, unit_vectors(500))
    np.testing.assert_allclose(irradiance, np.pi, rtol=0.01)


def test_irradiance_is_within_the_bound_of_brute_force(decades: Lighting, unit_vectors) -> None:
    normals = unit_vectors(500)
    got = harmonics.irradiance(harmonics.spherical_harmonics(decades), normals)
    want = brute_irradiance(decades, normals)
    assert (np.abs(got - want) <= BOUND * decades.power()).all()
    # Light that is spread out does far better than the bound: 1 to 2 % of the mean.
    assert (np.abs(got - want).mean(axis=0) < 0.02 * want.mean(axis=0)).all()


@pytest.mark.parametrize("towards", [(0, 0.3, 1), (1, 0.5, 0.2), (-0.5, 0.8, -0.3)])
def test_irradiance_of_a_lone_sun_is_within_the_bound(towards, unit_vectors) -> None:
    sun = lobe(np.array(towards) / np.linalg.norm(towards), ambient=0)
    normals = unit_vectors(2000)
    error = harmonics.irradiance(harmonics.spherical_harmonics(sun), normals) - brute_irradiance(
        sun, normals
    )
    worst = np.abs(error).max() / sun.power()[0]
    assert worst <= BOUND + 0.01  # and the sun's own ball pixel
    assert worst > 0.05  # the hardest light there is: the bound is no idle one


def test_turning_the_light_turns_band_1(decades: Lighting) -> None:
    turn = frames.world_from_camera(0.6, -0.3, 0.4)
    smooth = Lighting.from_latlong(decades.latlong(128), size=32)
    before, after = (
        harmonics.spherical_harmonics(light) for light in (smooth, smooth.rotated(turn))
    )
    xyz = [3, 1, 2]  # the band's coefficients in axis order
    scale = np.abs(before[0]).max()
    np.testing.assert_allclose(after[xyz], turn @ before[xyz], atol=0.01 * scale)
    np.testing.assert_allclose(after[0], before[0], rtol=0.01)
    np.testing.assert_allclose(  # rotations mix band 2 within itself
        np.linalg.norm(after[4:], axis=0), np.linalg.norm(before[4:], axis=0), atol=0.02 * scale
    )


def test_mirroring_the_light_negates_the_odd_in_x(decades: Lighting) -> None:
    there, mirrored = (
        harmonics.spherical_harmonics(decades),
        harmonics.spherical_harmonics(decades.mirrored()),
    )
    sign = np.array([1, 1, 1, -1, -1, 1, 1, -1, 1])[:, None]
    np.testing.assert_allclose(mirrored, sign * there, atol=1e-3)


def test_projection_is_linear(decades: Lighting) -> None:
    twice = Lighting(2 * decades.radiance)
    np.testing.assert_allclose(
        harmonics.spherical_harmonics(twice),
        2 * harmonics.spherical_harmonics(decades),
        rtol=1e-3,
        atol=1e-3,
    )


def test_a_sun_is_found_within_its_ball_pixel(unit_vectors) -> None:
    subpixels, inside = mirror_ball.subpixels(32, 6)
    for direction in unit_vectors(60):
        found = harmonics.dominant_light(lobe(direction))
        assert np.linalg.norm(found.direction) == pytest.approx(1, abs=1e-5)
        pixel = mirror_ball.pixel_of_directions(direction[None], 32)[0]
        seen = subpixels[pixel][inside[pixel]]
        span = np.arccos(np.clip((seen @ seen.T).min(), -1, 1))
        angle = np.arccos(np.clip(found.direction @ direction, -1, 1))
        assert angle <= span
        assert angle < np.radians(8) or direction[2] < -0.5  # wide pixels lie at the rim only


def test_a_suns_irradiance_and_share_are_its_own() -> None:
    found = harmonics.dominant_light(lobe(np.array([0.0, 0.6, 0.8]), power=10, ambient=0.1))
    np.testing.assert_allclose(found.irradiance, 10, rtol=0.02)
    assert found.share == pytest.approx(10 / (10 + 0.1 * 4 * np.pi), rel=0.02)


def test_a_lights_colour_is_kept() -> None:
    radiance = np.array(lobe(np.array([0.0, 0.6, 0.8])).radiance) * [1.0, 0.5, 0.25]
    found = harmonics.dominant_light(Lighting(radiance.astype(np.float32)))
    np.testing.assert_allclose(found.irradiance / found.irradiance[0], [1, 0.5, 0.25], rtol=1e-3)


@pytest.mark.parametrize("sun_power", [0.0, 1.0, 100.0])
def test_remainder_and_light_are_the_whole(decades: Lighting, sun_power: float) -> None:
    """E(remainder) + E(light) = E(environment) on a surface facing the light, exactly."""
    sun = lobe(np.array([0.5, 0.7, 0.3]) / np.sqrt(0.83), sun_power, 0)
    lighting = Lighting(decades.radiance + sun.radiance)
    found = harmonics.dominant_light(lighting)
    facing = found.direction[None].astype(float)
    whole = brute_irradiance(lighting, facing)[0]
    rest = brute_irradiance(found.remainder, facing)[0]
    np.testing.assert_allclose(rest + found.irradiance, whole, rtol=1e-3)
    assert (found.remainder.radiance <= lighting.radiance + 1e-6).all()
    assert 0 <= found.share < 1


def test_even_light_has_no_dominant_light() -> None:
    found = harmonics.dominant_light(Lighting(np.full((32, 32, 3), 0.5, np.float32)))
    assert found.share == pytest.approx(0, abs=1e-5)
    np.testing.assert_allclose(found.irradiance, 0, atol=1e-4)
    assert np.isfinite(found.direction).all()


def test_darkness_has_no_dominant_light_either() -> None:
    found = harmonics.dominant_light(Lighting(np.zeros((32, 32, 3), np.float32)))
    assert found.share == 0
    assert np.isfinite(found.direction).all()
