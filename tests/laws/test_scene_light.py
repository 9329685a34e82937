"""A photo in the light estimated from it: nothing lost, nothing seen twice, no seam and no star."""

from dataclasses import replace

import numpy as np
import pytest

from deeplight.camera import PinholeCamera
from deeplight.camera_response import LUMINANCE, CameraResponse
from deeplight.estimators.environment import SceneLight, assemble
from deeplight.estimators.lamps import (
    OWN_COLOUR,
    OWN_RADIUS_RAD,
    clipped_areas,
    excess_of,
    find_lamps,
)
from deeplight.estimators.projection import ImagePlane, project_photo
from deeplight.estimators.surroundings import adapted, smooth_map
from deeplight.frames import normalised
from deeplight.lamp import Lamp, draw_lamps
from deeplight.lighting import Lighting
from deeplight.lobe import lobe_on_ball
from deeplight.mappings import latlong, mirror_ball, resample

HEIGHT = 128


@pytest.fixture(scope="module")
def estimate() -> Lighting:
    """A dim room with a broad light up to the right and noise, much as a network gives it."""
    directions = mirror_ball.pixel_directions(32)
    toward = normalised(np.array([0.6, 0.7, 0.4]))
    lobe = np.exp(6 * (directions @ toward - 1))[..., None] * [4.0, 3.5, 3.0]
    noise = np.random.default_rng(0).lognormal(0, 0.1, (32, 32, 1))
    return Lighting((0.2 + lobe) * noise)


def photo(height: int = 200, width: int = 120) -> np.ndarray:
    """A smooth, colourful photo without clipping."""
    y, x = np.mgrid[:height, :width] / np.array([height, width])[:, None, None]
    values = np.stack([130 + 80 * np.sin(9 * x), 110 + 70 * y, 100 + 60 * np.cos(7 * (x + y))], -1)
    return values.astype(np.uint8)


def plane_of(pixels: np.ndarray, fov_deg: float = 66) -> ImagePlane:
    return ImagePlane.centred(pixels.shape[0], pixels.shape[1], np.radians(fov_deg))


def flux_of(radiance: np.ndarray) -> np.ndarray:
    return np.einsum("ij,ijc->c", latlong.solid_angles(*radiance.shape[:2]), radiance)


def test_the_map_keeps_power_and_even_light(estimate):
    assert flux_of(smooth_map(estimate.radiance, HEIGHT)) == pytest.approx(estimate.power(), 1e-4)
    even = smooth_map(np.ones((32, 32, 3), np.float32), HEIGHT)
    assert even == pytest.approx(np.ones_like(even), abs=0.02)


def test_the_map_is_linear(estimate):
    double = smooth_map(2 * estimate.radiance, 64)
    assert double == pytest.approx(2 * smooth_map(estimate.radiance, 64), rel=1e-4)


def around_the_view(panorama: np.ndarray, radius_deg: float) -> np.ndarray:
    angle, radius = np.linspace(0, 2 * np.pi, 200, endpoint=False), np.radians(radius_deg)
    across = np.sin(radius)
    circle = np.stack([across * np.cos(angle), across * np.sin(angle)], -1)
    directions = np.column_stack([circle, np.full(200, -np.cos(radius))])
    return resample.sample_latlong(panorama, directions)[:, 0]


def test_lamps_near_each_other_are_one_in_their_middle(estimate):
    """12 degrees apart they are one of the same power, 25 degrees apart two."""
    own = [
        Lamp(normalised(np.array([np.sin(a), 0.3, np.cos(a)])), np.full(3, flux), 0.1)
        for a, flux in ((0.0, 3.0), (0.21, 1.0))
    ]
    far = replace(own[1], direction=normalised(np.array([np.sin(0.47), 0.3, np.cos(0.47)])))

    def found(lamps: list[Lamp]) -> tuple[Lamp, ...]:
        lobes = np.sum([lobe_on_ball(lamp) for lamp in lamps], axis=0)
        pixels = photo()
        projected = project_photo(pixels, plane_of(pixels), HEIGHT)
        return find_lamps(Lighting(0.3 + lobes), projected, lamps).lamps

    (one,), two = found(own), found([own[0], far])
    assert len(two) == 2
    assert one.luminous_flux == pytest.approx(sum(x.luminous_flux for x in two), rel=0.1)
    assert own[0].direction @ one.direction > own[1].direction @ one.direction > np.cos(0.2)


def test_no_star_straight_ahead():
    """Spokes of the rim become a smooth spot; without the smoothing they stay."""
    u, v = mirror_ball.grid(32)
    spokes = np.where(np.sin(8 * np.arctan2(v, u)) > 0, 2.0, 0.5)[..., None] * np.ones(3)
    smooth = around_the_view(smooth_map(spokes.astype(np.float32), HEIGHT), 15)
    plain = around_the_view(Lighting(spokes).latlong(HEIGHT), 15)
    assert np.ptp(np.log(smooth)) < 0.2
    assert np.ptp(np.log(plain)) > 0.6


def test_lamps_and_rest_are_the_estimate(estimate):
    excess = excess_of(estimate)
    assert excess.rest.power() + excess.flux.sum(0) == pytest.approx(estimate.power(), rel=1e-4)
    found = find_lamps(estimate, project_photo(photo(), plane_of(photo()), HEIGHT))
    lamps = sum(lamp.flux for lamp in found.lamps)
    whole = found.rest.power() + lamps + flux_of(found.areas)
    assert whole == pytest.approx(estimate.power(), rel=1e-4)
    (lamp,) = found.lamps
    off = np.degrees(np.arccos(lamp.direction @ normalised(np.array([0.6, 0.7, 0.4]))))
    assert off < 8


def test_a_networks_own_lamps_are_taken_and_not_counted_twice(estimate):
    """Two compact ones become lamps; a wide one stays in the map; the power is the estimate's."""
    own = [
        Lamp(normalised(np.array([0.7, 0.5, 0.6])), np.array([3.0, 2.5, 2.0]), 0.16),
        Lamp(normalised(np.array([-0.7, 0.6, 0.3])), np.array([1.5, 1.5, 2.0]), 0.05),
        Lamp(normalised(np.array([0.0, 0.2, 1.0])), np.array([2.0, 2.0, 2.0]), 0.5),
    ]
    ball = Lighting(0.2 * np.ones((32, 32, 3)) + sum(lobe_on_ball(lamp) for lamp in own))
    found = find_lamps(ball, project_photo(photo(), plane_of(photo()), HEIGHT), own)
    assert len(found.lamps) == 2
    for lamp, given in zip(found.lamps, own, strict=False):
        assert np.degrees(np.arccos(lamp.direction @ given.direction)) < 2
        assert lamp.luminous_flux == pytest.approx(given.luminous_flux, rel=0.03)
        # A wide lobe is the network's doubt, not the lamp's size.
        assert lamp.angular_radius_rad == min(given.angular_radius_rad, OWN_RADIUS_RAD)
    whole = found.rest.power() + sum(lamp.flux for lamp in found.lamps) + flux_of(found.areas)
    assert whole == pytest.approx(ball.power(), rel=1e-4)


def test_a_networks_lamps_get_one_colour_near_the_estimates():
    """A green and a violet lamp next to each other are one white light; all channels are kept."""
    tints = np.array([[0.6, 1.2, 0.7], [1.6, 0.7, 1.5]])
    own = [
        Lamp(normalised(np.array([0.7 - 0.3 * n, 0.9, 0.6])), 3 * tint / (tint @ LUMINANCE), 0.16)
        for n, tint in enumerate(tints)
    ]
    map_colour = np.array([0.22, 0.2, 0.17])
    ball = Lighting(map_colour * np.ones((32, 32, 3)) + sum(lobe_on_ball(lamp) for lamp in own))
    found = find_lamps(ball, project_photo(photo(), plane_of(photo()), HEIGHT), own)
    mean = sum(lamp.flux for lamp in own) / 6
    whole = ball.power() / (ball.power() @ LUMINANCE)
    for lamp in found.lamps:
        colour = lamp.flux / lamp.luminous_flux
        assert colour == pytest.approx(OWN_COLOUR * mean + (1 - OWN_COLOUR) * whole, rel=0.01)
    power = found.rest.power() + sum(lamp.flux for lamp in found.lamps) + flux_of(found.areas)
    assert power == pytest.approx(ball.power(), rel=1e-4)
    assert found.rest.radiance.min() >= 0


def test_even_light_has_no_lamp():
    even = Lighting(np.full((32, 32, 3), 0.5))
    found = find_lamps(even, project_photo(photo(), plane_of(photo()), HEIGHT))
    assert found.lamps == ()
    assert found.rest.power() == pytest.approx(even.power(), rel=1e-5)


@pytest.mark.parametrize("fov_deg", [20, 66, 120])
def test_the_photo_covers_its_solid_angle(fov_deg):
    camera = PinholeCamera(120, 200, float(np.radians(fov_deg)))
    seen = project_photo(photo(), plane_of(photo(), fov_deg), 256).seen
    share = (latlong.solid_angles(256, 512) * seen).sum() / (4 * np.pi)
    edge = 0.85 if fov_deg == 20 else 0.95  # a texel and a half fade out
    assert edge * camera.share_of_sphere < share < camera.share_of_sphere
    white = project_photo(np.full((200, 120, 3), 186, np.uint8), plane_of(photo(), fov_deg), 256)
    assert white.radiance[seen > 0] == pytest.approx((186 / 255) ** 2.2, rel=1e-4)


def test_the_environment_shows_the_photo(estimate):
    """Looked at with the photo's own camera, it is the photo, but for the feathered edge."""
    pixels = photo()
    panorama = assemble(estimate, pixels, plane_of(pixels), 256).environment.radiance
    rays = PinholeCamera(120, 200, float(np.radians(66))).rays()
    view = resample.sample_latlong(panorama, rays)[12:-12, 12:-12]
    true = CameraResponse().radiance_from_pixel(pixels.astype(np.float32) / 255)[12:-12, 12:-12]
    error = np.abs(view - true) / true
    assert np.median(error) < 0.01
    assert np.percentile(error, 97) < 0.05


def steepest(radiance: np.ndarray) -> float:
    """The largest step between neighbours as a screen shows it, 0 to 1."""
    shown = CameraResponse().pixel_from_radiance(radiance)
    shown = shown[16:-16]  # near the poles columns are no neighbours
    around = np.concatenate([shown, shown[:, :1]], axis=1)
    return float(max(np.abs(np.diff(shown, axis=0)).max(), np.abs(np.diff(around, axis=1)).max()))


@pytest.mark.parametrize("fov_deg", [20, 66, 120])
@pytest.mark.parametrize("level", [20, 240])
def test_no_hard_edge_anywhere(estimate, fov_deg, level):
    """A dark or a bright photo against another surround; without the fitting there is an edge."""
    pixels = np.full((200, 120, 3), level, np.uint8)
    scene = assemble(estimate, pixels, plane_of(pixels, fov_deg), 256)
    assert steepest(scene.rest) < 0.03
    plain = smooth_map(
        find_lamps(estimate, project_photo(pixels, plane_of(pixels), 256)).rest.radiance, 256
    )
    bare = plain + ((level / 255) ** 2.2 - plain) * scene.seen[..., None]
    assert steepest(bare) > 0.09


def test_far_from_the_photo_the_map_is_the_estimates(estimate):
    plain = smooth_map(estimate.radiance, HEIGHT)
    pixels = photo().astype(np.float32) / np.float32(255)
    changed = adapted(plain, pixels, plane_of(photo()))
    behind = latlong.directions(HEIGHT, 2 * HEIGHT)[..., 2] > 0
    np.testing.assert_array_equal(changed[behind], plain[behind])
    assert not np.allclose(changed, plain, rtol=0.05)


@pytest.mark.parametrize(("widths", "least"), [(1, 0.25), (2, 0.45), (3, 0.6)])
def test_a_dark_thing_in_a_corner_is_no_dark_cloud_outside(widths, least):
    """Beyond the photo it fades within about its own width, and nothing is darker than it."""
    plain = np.full((96, 192, 3), 0.3, np.float32)
    pixels = np.full((200, 120, 3), 0.3 ** (1 / 2.2), np.float32)
    pixels[:20, -20:] = 0.05
    plane = plane_of(pixels)
    changed = adapted(plain, pixels, plane)
    away = widths * plane.shorter / 6 / np.sqrt(2)
    beyond = normalised(np.array([[plane.right + away, plane.top + away, -1.0]]))
    (found,) = resample.sample_latlong(changed, beyond)
    assert least < found.min() / 0.3 < 0.9
    assert changed.min() > 0.05**2.2
    assert changed.max() < 0.3001


def test_a_clipped_spot_becomes_the_lamp(estimate):
    """The estimate's light lies near it, so there it is, as large as it shows."""
    directions = mirror_ball.pixel_directions(32)
    toward = normalised(np.array([0.15, 0.35, -1.0]))
    light = Lighting(0.1 + np.exp(12 * (directions @ toward - 1))[..., None] * np.ones(3) * 5)
    pixels = np.full((400, 240, 3), 60, np.uint8)
    rays = PinholeCamera(240, 400, float(np.radians(66))).rays()
    spot = normalised(np.array([0.1, 0.3, -1.0]))
    pixels[rays @ spot > np.cos(np.radians(2.5))] = 255
    scene = assemble(light, pixels, plane_of(pixels), 256)
    lamp = scene.lamps[0]
    assert np.degrees(np.arccos(lamp.direction @ spot)) < 0.3
    assert np.degrees(lamp.angular_radius_rad) == pytest.approx(2.5, abs=0.3)
    assert lamp.flux[0] > 0.5 * excess_of(light).flux.sum(0)[0]
    assert flux_of(scene.environment.radiance - scene.rest) == pytest.approx(
        sum(lamp.flux for lamp in scene.lamps), rel=1e-3
    )


def test_clipped_pixels_have_at_least_the_estimates_light():
    bright = Lighting(np.full((32, 32, 3), 7.0))
    white = np.full((200, 120, 3), 255, np.uint8)
    scene = assemble(bright, white, plane_of(white), HEIGHT)
    assert scene.rest.min() > 6.9
    grey = np.full((200, 120, 3), 128, np.uint8)
    assert assemble(bright, grey, plane_of(grey), HEIGHT).rest.min() < 0.3


def test_flipping_the_photo_flips_the_environment(estimate):
    pixels = photo()
    scene = assemble(estimate, pixels, plane_of(pixels), 64)
    flipped = assemble(estimate.mirrored(), pixels[:, ::-1], plane_of(pixels), 64)
    assert flipped.rest[:, ::-1] == pytest.approx(scene.rest, rel=0.02, abs=1e-3)
    assert flipped.lamps[0].direction * [-1, 1, 1] == pytest.approx(
        scene.lamps[0].direction, abs=0.01
    )


def test_connected_parts_are_numbered_apart():
    mask = np.zeros((32, 64), np.float32)
    mask[4:8, 55:62] = 1
    spiral = [(r, 30) for r in range(20, 30)] + [(29, c) for c in range(20, 31)]
    for row, column in [*spiral, *((r, 20) for r in range(18, 30))]:
        mask[row, column] = 1
    mask[12, 40] = mask[13, 41] = 1  # touching at a corner
    areas = clipped_areas(mask)
    assert sorted(int(area.mask.sum()) for area in areas) == [2, 28, 31]


def test_a_drawn_lamp_is_not_in_the_rest(estimate):
    scene = assemble(estimate, photo(), plane_of(photo()), HEIGHT)
    lamp = scene.lamps[0]
    assert isinstance(lamp, Lamp)
    whole = scene.environment.radiance
    assert whole - draw_lamps(scene.lamps, HEIGHT) == pytest.approx(scene.rest, abs=1e-3)
    assert scene.rest.max() < 0.2 * whole.max()


def test_soft_lamps_keep_their_place_and_leave_the_photo_alone(estimate):
    """What is not sure of its direction is a glow around it; a lamp that the photo shows stays."""
    scene = assemble(estimate, photo(), plane_of(photo()), HEIGHT)
    shown = Lamp(np.array([0.0, 0.0, -1.0]), np.ones(3), 0.03)
    both = replace(scene, lamps=(*scene.lamps, shown))
    soft = both.softened(0.6)
    assert soft.lamps == (shown,)
    inside = scene.seen > 0.999
    np.testing.assert_allclose(soft.rest[inside], scene.rest[inside], atol=1e-5)
    size = HEIGHT, 2 * HEIGHT
    glow = (soft.rest - scene.rest).mean(-1) * latlong.solid_angles(*size)
    middle = normalised(np.einsum("hw,hwk->k", glow, latlong.directions(*size)).astype(float))
    assert np.degrees(np.arccos(middle @ scene.lamps[0].direction)) < 3
    assert both.softened(0.01).lamps == both.lamps  # they are wider than that


@pytest.mark.parametrize("radius_deg", [8, 25, 55])
@pytest.mark.parametrize("towards", [(0.6, 0.7, 0.4), (0.55, 0.15, -1.0)])
def test_what_faces_a_softened_lamp_is_as_bright_as_it_was(towards, radius_deg):
    """At every width, and where the photo cuts a part of the glow off; kept flux would not do."""
    pixels = photo()
    seen = project_photo(pixels, plane_of(pixels), HEIGHT).seen
    lamp = Lamp(normalised(np.array(towards)), np.array([3.0, 2.0, 1.0]), 0.06)
    scene = SceneLight(np.zeros((HEIGHT, 2 * HEIGHT, 3), np.float32), (lamp,), seen)
    assert latlong.nearest(seen, lamp.direction[None])[0] < 0.5  # the photo does not show it
    glow = scene.softened(np.radians(radius_deg)).rest
    cosine = np.maximum(latlong.directions(HEIGHT, 2 * HEIGHT) @ lamp.direction, 0)
    facing = flux_of(glow * cosine[..., None])
    assert facing == pytest.approx(lamp.irradiance, rel=1e-3)
    assert flux_of(glow) == pytest.approx(lamp.flux, rel=0.4)
    if radius_deg > 20:  # the twin: kept flux would leave it darker
        same_flux = facing * lamp.flux / flux_of(glow)
        assert (same_flux < 0.98 * lamp.irradiance).all()


@pytest.mark.parametrize("height", [64, 100, 128])
def test_what_is_seen_is_the_same_part_of_the_sphere_in_64_rows(height):
    seen = project_photo(photo(), plane_of(photo()), height)
    share = (seen.seen * latlong.solid_angles(height, 2 * height)).sum()
    coarse = (seen.seen_in_64_rows * latlong.solid_angles(64, 128)).sum()
    assert coarse == pytest.approx(share, rel=0.01)
