"""What precomputed transfer must obey: furnaces, known shadows, turns, sums done otherwise."""

from dataclasses import replace

import numpy as np
import pytest

from deeplight import brdf, harmonics
from deeplight.compose import shapes
from deeplight.compose.mesh import Mesh
from deeplight.frames import normalised, rotation
from deeplight.transfer.clusters import clustered
from deeplight.transfer.ground import Ground
from deeplight.transfer.precompute import Transfer, TransferSettings, precompute
from deeplight.transfer.rays import hemisphere

pytestmark = pytest.mark.needs("embreex")


FLOATING = TransferSettings(samples=256, bounces=0, glossy=None, ground=None, longest_edge=1.0)
STANDING = replace(FLOATING, ground=Ground(size=16, reflectivity=0.3))
WHITE = np.zeros((25, 3))
WHITE[0] = np.sqrt(4 * np.pi)


def made(shape: tuple[np.ndarray, ...], settings: TransferSettings) -> Transfer:
    return precompute([Mesh(*shape)], settings)[0]


@pytest.fixture(scope="module")
def ball() -> Transfer:
    return made(shapes.ball(16), replace(FLOATING, glossy=0.5))


@pytest.fixture(scope="module")
def bunny() -> Transfer:
    return made(shapes.bunny(16), replace(STANDING, bounces=1))


@pytest.fixture
def light(rng: np.random.Generator) -> np.ndarray:
    """Light of order 4 that is nowhere below 0."""
    directions = normalised(rng.normal(size=(4000, 3)))
    lobes = np.exp(4 * (directions @ normalised(np.array([0.6, 0.7, -0.4])) - 1))
    values = harmonics.basis(directions, 4)
    return values.T @ (lobes[:, None] * [3.0, 2.0, 1.0] + 0.5) * (4 * np.pi / 4000)


def test_a_white_convex_object_in_white_light_is_white(ball: Transfer) -> None:
    np.testing.assert_allclose(ball.diffuse @ WHITE, 1, atol=1e-5)
    aside = normalised(np.cross(ball.normals, [0.3, 0.5, 0.8]))
    for degrees in (0, 30, 60, 75):
        tilt = np.radians(degrees)
        eyes = ball.normals * np.cos(tilt) + aside * np.sin(tilt)
        np.testing.assert_allclose(ball.glossy_radiance(WHITE, eyes), 0.5, rtol=0.03)
    hollow = made(shapes.bunny(12), FLOATING)  # what shades itself is not
    assert (hollow.diffuse @ WHITE)[:, 0].min() < 0.8


def test_light_that_is_never_lost_leaves_everything_white() -> None:
    """Object and ground reflect all: after many bounces nothing is dark, wherever it lies."""
    lossless = replace(STANDING, diffuse=1.0, ground=Ground(16, 1.6, 1.0), samples=128)
    few, many = (made(shapes.bunny(10), replace(lossless, bounces=n)) for n in (0, 12))
    above = many.vertices[:, 1] > 0.1  # no light gets under the flat bottom on the plane
    light, direct = ((one.diffuse @ WHITE)[above, 0] for one in (many, few))
    assert np.quantile(light, 0.05) > 0.98
    assert light.min() > 0.8
    assert light.max() < 1.01
    assert np.mean(many.shadow(WHITE)) > np.mean(few.shadow(WHITE)) + 0.1
    assert np.quantile(direct, 0.05) < 0.3


def test_an_open_plane_reflects_its_reflectivity() -> None:
    corners = np.array([[-1.0, 0, -1], [-1, 0, 1], [1, 0, 1], [1, 0, -1]])
    plane = made((corners, np.array([[0, 1, 2], [0, 2, 3]])), FLOATING)
    np.testing.assert_allclose(plane.diffuse_radiance(WHITE), 0.345, rtol=1e-5)


def test_a_convex_object_has_the_irradiance_of_harmonics(ball: Transfer, light: np.ndarray) -> None:
    order_2 = light[:9].astype(np.float32)
    want = 0.345 / np.pi * harmonics.irradiance(order_2, ball.normals)
    np.testing.assert_allclose(ball.diffuse_radiance(order_2), np.maximum(want, 0), atol=1e-4)
    mirrored = order_2 * np.where(np.arange(9) == 3, -1, 1)[:, None]
    assert np.abs(ball.diffuse_radiance(mirrored) - want).max() > 0.05


def test_a_ball_throws_the_shadow_that_geometry_gives() -> None:
    """A ball of radius r on the plane hides (r / D)^3 of white light, D its centre's distance."""
    settings = replace(STANDING, samples=512)
    shadow = made(shapes.ball(20), settings).shadow(WHITE)[..., 0].ravel()
    assert settings.ground is not None
    across = np.linalg.norm(settings.ground.points, axis=1)
    far = across > 0.15  # closer in, the ball's few triangles show

    def hidden(radius: float) -> np.ndarray:
        return (radius / np.hypot(across, radius)) ** 3

    np.testing.assert_allclose(shadow[far], 1 - hidden(0.5)[far], atol=0.02)
    assert np.abs(shadow - 1 + hidden(0.4))[far].max() > 0.06


def test_the_shadow_lies_away_from_the_light(bunny: Transfer) -> None:
    toward = np.array([0.8, 0.6, 0])
    sun = harmonics.basis(toward, 4)[:, None] * np.ones(3) + WHITE * 0.1
    assert bunny.shadowed is not None
    x = bunny.shadowed.ground.points[:, 0].reshape(16, 16)
    shadow = bunny.shadow(sun)[..., 0]
    assert shadow[x < -0.3].min() < shadow[x > 0.3].min() - 0.1


def test_light_adds_up(bunny: Transfer, light: np.ndarray) -> None:
    both = bunny.diffuse_radiance(light + WHITE)
    np.testing.assert_allclose(
        both, bunny.diffuse_radiance(light) + bunny.diffuse_radiance(WHITE), atol=1e-3
    )
    twice = bunny.shadow(2 * light)
    np.testing.assert_allclose(twice, bunny.shadow(light), atol=1e-6)
    assert np.abs(bunny.shadow(light + WHITE) - twice).max() > 0.01  # a ratio does not


def test_turning_the_object_is_turning_the_light_back(bunny: Transfer, light: np.ndarray) -> None:
    """A quarter turn keeps the box, so that both are of one size."""
    turn = rotation("y", np.pi / 2)
    vertices, faces, normals = shapes.bunny(16)
    turned = made((vertices @ turn.T, faces, normals @ turn.T), replace(STANDING, bounces=1))
    old_light = harmonics.turning(turn.T, 4) @ light
    np.testing.assert_allclose(
        turned.diffuse_radiance(light), bunny.diffuse_radiance(old_light), atol=0.02
    )
    same = np.abs(turned.diffuse_radiance(light) - bunny.diffuse_radiance(light))
    assert same.max() > 0.1


def test_what_is_blocked_is_what_triangles_block(bunny: Transfer, light: np.ndarray) -> None:
    """The direct light of some vertices, summed over other rays, by another intersection."""
    direct = made(shapes.bunny(12), FLOATING)
    directions = hemisphere(1500).directions.astype(float)
    both = np.concatenate([directions, directions * [1, 1, -1]])
    solid_angles = np.tile(hemisphere(1500).solid_angles, 2)
    radiance = harmonics.basis(both, 4) @ light
    differences = []
    for vertex in range(5, len(direct.vertices), 40):
        normal = direct.normals[vertex].astype(float)
        cosine = np.maximum(both @ normal, 0)
        seen = cosine > 0
        start = direct.vertices[vertex] + 2e-4 * normal
        free = np.ones(len(both))
        free[seen] = ~blocked(start, both[seen], direct.vertices[direct.triangles].astype(float))
        want = 0.345 / np.pi * (cosine * free * solid_angles) @ radiance
        got = direct.diffuse_radiance(light)[vertex]
        bare = 0.345 / np.pi * (cosine * solid_angles) @ radiance
        differences.append([np.abs(got - want).max(), np.abs(got - bare).max()])
    assert np.max(differences, axis=0)[0] < 0.025
    assert np.max(differences, axis=0)[1] > 0.1  # without blocking it would not agree


def blocked(start: np.ndarray, directions: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Whether rays meet any triangle: signs of volumes."""
    a, b, c = (corners[:, i] - start for i in range(3))
    planes = np.stack([np.cross(a, b), np.cross(b, c), np.cross(c, a)])
    sides = np.einsum("rk,ptk->ptr", directions, planes)
    inside = (sides > 0).all(0) | (sides < 0).all(0)
    volume = np.einsum("tk,tk->t", a, np.cross(b, c))[:, None]
    return np.asarray((inside & (volume * sides.sum(0) > 0)).any(0))


def test_gloss_is_the_reflectance_integrated(ball: Transfer, light: np.ndarray) -> None:
    fine = hemisphere(6000)
    both = np.concatenate([fine.directions, fine.directions * np.float32([1, 1, -1])]).astype(float)
    solid_angles = np.tile(fine.solid_angles, 2)
    rows = np.arange(0, len(ball.normals), 25)
    normals = ball.normals.astype(float)
    eyes = normalised(normals + 0.8 * np.cross(normals, [0.3, 0.5, 0.8]))

    def integrated(roughness: float) -> np.ndarray:
        n_l, n_v = normals[rows] @ both.T, (normals * eyes)[rows].sum(1, keepdims=True)
        lobes = brdf.rough_specular(n_l, n_v, eyes[rows] @ both.T, roughness) * solid_angles
        lobes /= lobes.sum(1, keepdims=True)
        return np.asarray(0.5 * lobes @ harmonics.basis(both, 4) @ light)

    got = ball.glossy_radiance(light, eyes)[rows]
    np.testing.assert_allclose(got, integrated(0.3), atol=0.04)
    assert np.abs(got - integrated(0.6)).max() > 0.15


def test_more_components_hold_matrices_better(rng: np.random.Generator) -> None:
    few = rng.normal(size=(3, 9, 9)).astype(np.float32)
    matrices = np.einsum("nk,kij->nij", rng.normal(size=(200, 3)), few).astype(np.float32)
    normals = normalised(rng.normal(size=(200, 3)))
    errors = []
    for components in (1, 3):
        kept = clustered(matrices, normals, 1, components).expanded
        errors.append(float(np.abs(kept - matrices).max()))
    assert errors[1] < 1e-4
    assert errors[0] > 0.5
