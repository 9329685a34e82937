"""A film frame obeys geometry and light: outlines, reflections, crops, texture, troubles."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from deeplight import brdf
from deeplight.camera import PinholeCamera
from deeplight.camera_response import decode, encode
from deeplight.frames import looking_at, world_from_camera
from deeplight.lighting import Lighting
from deeplight.mappings import latlong, resample
from deeplight.relight import relight_rig
from deeplight.simulate.phone import CameraAutomatics, develop
from deeplight.sphere import PAPER_RIG, SPHERES, SphereView
from lab.film.clip import Clip, FilmFrame
from lab.film.overlay import finger_in_picture, holder_in_picture, sphere_patch
from lab.film.parts import Ball, Box, Rod, Thing, first_hits
from lab.film.picture import FrameMaker
from lab.film.recipe import TROUBLES, FilmRecipe
from lab.film.reflections import Reflections
from lab.film.rig import draw_rig, ellipse_px
from lab.film.scenery import Scenery, doubled
from lab.film.tag import CODES_36H11, tag_cells
from lab.film.world import FLOOR_M, World, build_world, noise_tile

PLAIN = CameraAutomatics(0.45, 0.0, 0.1, 1.0, 0.0, (0.0, 0.0, 0.0), 0.5, 2.2, 0.0, 0.0, 1e-12, 95)
SMALL = FilmRecipe(size=180, seconds=0.1, vary_rig=False)
CAMERA = PinholeCamera(270, 480, float(np.radians(66)))
LEVEL = (world_from_camera(0.4), np.zeros(3))


def panorama(height: int = 64) -> np.ndarray:
    """A blue sky over a brown floor, with a sun of a few texels behind the camera of yaw 0."""
    d = latlong.directions(height, 2 * height)
    sky = np.where(d[..., 1:2] > 0, [0.4, 0.6, 1.0], [0.3, 0.2, 0.1])
    glow = np.exp(60 * (d @ np.array([0.1, 0.3, 0.95]) - 1))[..., None]
    return (sky * (1 + 0.3 * np.sin(9 * d[..., :1])) + 10 * glow).astype(np.float32)


@lru_cache(maxsize=1)
def world() -> World:
    return build_world(panorama(), "outdoor")


@lru_cache(maxsize=2)
def reflections(alone: bool = False) -> Reflections:
    return Reflections(world(), draw_rig(np.random.default_rng(0), vary=False), alone)


@lru_cache(maxsize=1)
def maker() -> FrameMaker:
    rig = draw_rig(np.random.default_rng(0), vary=False)
    return FrameMaker(rig, CAMERA, world(), PLAIN)


# ---- geometry


@pytest.mark.parametrize("seed", range(4))
def test_outline_is_where_rays_graze_the_sphere(seed: int) -> None:
    """The ellipse of the truth against rays traced to the ball, one for each of many places."""
    rig = draw_rig(np.random.default_rng(seed))
    for name in SPHERES:
        (x, y), (major, minor), angle_deg = ellipse_px(rig.view(name, 32), CAMERA)
        turn = np.radians(angle_deg)
        around = np.linspace(0, 2 * np.pi, 40)
        ball = Ball(rig.centres_m[name], rig.radius_m)
        for scale, inside in ((0.998, True), (1.002, False)):
            a, b = scale * major * np.cos(around), scale * minor * np.sin(around)
            column = x + a * np.cos(turn) - b * np.sin(turn)
            row = y - (a * np.sin(turn) + b * np.cos(turn))
            ray = through(row, column)
            assert (np.isfinite(ball.hit(np.zeros_like(ray), ray)) == inside).all()


def through(row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Directions through places of the picture, from the camera's own rays by interpolation."""
    half_width, half_height = CAMERA.tangents
    x = ((column + 0.5) / CAMERA.width * 2 - 1) * half_width
    y = (1 - (row + 0.5) / CAMERA.height * 2) * half_height
    ray = np.stack([x, y, -np.ones_like(x)], -1)
    return ray / np.linalg.norm(ray, axis=-1, keepdims=True)


def test_drawn_sphere_has_the_area_and_centre_of_its_ellipse() -> None:
    rig = draw_rig(np.random.default_rng(3))
    for name in SPHERES:
        patch = sphere_patch(rig, name, CAMERA)
        (x, y), (major, minor), _ = ellipse_px(rig.view(name, 32), CAMERA)
        alpha = patch.alpha[..., 0]
        assert alpha.sum() == pytest.approx(np.pi * major * minor, rel=2e-3)
        row, column = np.mgrid[patch.rows, patch.columns]
        centroid = (row * alpha).sum() / alpha.sum(), (column * alpha).sum() / alpha.sum()
        np.testing.assert_allclose(centroid, (y, x), atol=0.03)


def test_ellipse_is_as_flat_as_the_cosine_says() -> None:
    """A small ball off the axis: 1 / cos of its angle from the axis."""
    rig = draw_rig(np.random.default_rng(0), vary=False)
    for name in SPHERES:
        view = replace(rig.view(name, 32), angular_radius_rad=1e-3)
        _, (major, minor), _ = ellipse_px(view, CAMERA)
        assert major / minor == pytest.approx(1 / view.ball_from_camera[2, 2], rel=1e-4)


def test_rays_meet_surfaces_where_they_are() -> None:
    rng = np.random.default_rng(5)
    tilt = looking_at(np.array([0.2, 0.1, -1.0]))
    shapes = [
        Ball(np.array([0.0, 0.0, -1.0]), 0.3),
        Rod(np.array([-0.3, 0.1, -1.0]), np.array([0.3, -0.1, -1.2]), 0.1),
        Box(np.array([0.1, 0.0, -1.0]), np.array([0.3, 0.2, 0.1]), tilt),
    ]
    rays = looking_around(rng, 4000)
    origins = np.zeros_like(rays)
    for shape in shapes:
        distance = shape.hit(origins, rays)
        met = np.isfinite(distance)
        assert 100 < met.sum() < 3500
        points = distance[met, None] * rays[met]
        normals = shape.normals(points)
        assert ((normals * rays[met]).sum(-1) < 1e-6).all()  # it faces the ray
        # Just outside along the normal the way back is free; just inside it is not.
        assert np.isinf(shape.hit(points + 1e-4 * normals, normals)).all()
        assert np.isfinite(shape.hit(points + 1e-4 * normals, -normals)).all()
    index, _ = first_hits([Thing(s, "diffuse", (1, 1, 1)) for s in shapes], origins, rays)
    assert set(index) == {-1, 0, 1, 2}


def looking_around(rng: np.random.Generator, count: int) -> np.ndarray:
    plane = np.column_stack([rng.uniform(-0.6, 0.6, (count, 2)), -np.ones(count)])
    return plane / np.linalg.norm(plane, axis=-1, keepdims=True)


def test_a_step_moves_what_is_near_more_than_what_is_far() -> None:
    down, ahead = np.array([[0.0, -1.0, 0.0]]), np.array([[0.0, 0.0, -1.0]])
    step = np.array([0.5, 0.0, 0.0])
    under = world().seen(step, down)[0]
    np.testing.assert_allclose(under, np.array([0.5, -FLOOR_M, 0]) / np.hypot(0.5, FLOOR_M))
    far = world().seen(step, ahead)[0]
    assert abs(far[0]) < abs(under[0]) / 5
    np.testing.assert_allclose(world().seen(np.zeros(3), ahead), ahead, atol=1e-12)


# ---- light


def test_white_world_gives_the_reflectivities() -> None:
    """The furnace, everything near left out."""
    white = build_world(np.ones((64, 128, 3), np.float32), "outdoor")
    crops = Reflections(white, draw_rig(np.random.default_rng(0), vary=False), alone=True).crops(
        [LEVEL]
    )
    mask = reflections().rig.view("mirror", 256).mask()
    for name, crop in crops.items():
        np.testing.assert_allclose(crop[mask], brdf.REFLECTIVITY[name], rtol=0.006)


def test_neighbours_rig_and_holder_are_reflected() -> None:
    """They darken the white world's mirror where they stand, and nothing else."""
    white = build_world(np.ones((64, 128, 3), np.float32), "outdoor")
    rig = draw_rig(np.random.default_rng(0), vary=False)
    mirror = Reflections(white, rig).crops([LEVEL])["mirror"]
    mask = rig.view("mirror", 256).mask()
    darker = (mirror[..., 1] < 0.99 * brdf.REFLECTIVITY["mirror"]) & mask
    assert 0.02 < darker.sum() / mask.sum() < 0.3
    right, left = darker[:, 160:].sum(), darker[:, :96].sum()
    assert right > 2 * left  # the paper's mirror is the leftmost: neighbours stand to its right


def test_mirror_shows_what_is_behind_the_camera_upright() -> None:
    pose = world_from_camera(0.0)
    crop = reflections(alone=True).crops([(pose, np.zeros(3))])["mirror"]
    brightest = np.unravel_index(crop.sum(-1).argmax(), crop.shape[:2])
    direction = reflections().rig.view("mirror", 256).reflected()[brightest]
    assert direction @ np.array([0.1, 0.3, 0.95]) > 0.97  # the sun
    blue = crop[..., 2] / crop.sum(-1).clip(1e-6)
    assert blue[60, 128] > 0.4 > blue[200, 128]  # sky above, floor below


def test_matte_spheres_are_the_relit_surroundings() -> None:
    """Against light averaged from the panorama by other code, without parallax."""
    far = replace(world(), dome_m=1e6, floor_m=1e6)
    pose = world_from_camera(0.0, 0.5)
    ball = resample.ball_from_latlong(panorama(), 64, pose.T)
    crops = Reflections(far, reflections().rig, alone=True).crops([(pose, np.zeros(3))])
    wanted = relight_rig(PAPER_RIG, Lighting(ball))
    for name in ("diffuse", "matte_silver"):
        mask = PAPER_RIG.views[name].mask()
        got = resample.shrink(crops[name], 32, 32)
        np.testing.assert_allclose(got[mask].mean(0), wanted[name][mask].mean(0), rtol=0.05)


def test_texture_leaves_brightness_alone() -> None:
    tile = noise_tile(3)
    assert abs(tile.mean()) < 1e-4
    assert abs(tile).max() <= 1.1
    white = build_world(np.ones((64, 128, 3), np.float32), "indoor")
    scenery = Scenery(white, PinholeCamera(540, 960, 1.15), LEVEL[0], tile)
    picture = scenery.picture([LEVEL])
    assert picture.mean() == pytest.approx(1, abs=0.02)
    assert 0.05 < picture.std() < 0.4
    plain = build_world(np.ones((64, 128, 3), np.float32), "indoor", texture=0.0)
    flat = Scenery(plain, PinholeCamera(540, 960, 1.15), LEVEL[0], tile).picture([LEVEL])
    np.testing.assert_allclose(flat, 1, rtol=1e-4)


def test_scenery_shows_the_panorama_in_perspective() -> None:
    smooth = build_world(panorama(256), "outdoor", texture=0.0)
    pose = world_from_camera(2.0, -0.2, 0.1)
    place = np.array([0.5, 0.1, -0.3])
    scenery = Scenery(smooth, CAMERA, world_from_camera(1.6), noise_tile(3))
    got = scenery.picture([(pose, place)]).transpose(1, 2, 0)
    rays = PinholeCamera(135, 240, CAMERA.vertical_fov_rad).rays()
    wanted = smooth.radiance(smooth.seen(place, rays @ pose.T))
    assert np.abs(got - wanted).mean() < 0.01 * wanted.mean()
    turned = smooth.radiance(smooth.seen(place, rays[::-1] @ pose.T))
    assert np.abs(got - turned).mean() > 0.1 * wanted.mean()


def test_doubling_keeps_ramps_and_sums() -> None:
    ramp = np.arange(20, dtype=np.float32)[None, :, None].repeat(6, 2)
    twice = doubled(ramp)[0]
    np.testing.assert_allclose(twice[1:-1, 2], (np.arange(1, 39) + 0.5) / 2 - 0.5, atol=1e-5)
    noise = np.random.default_rng(0).uniform(size=(1, 24, 18)).astype(np.float32)
    assert doubled(noise).mean() == pytest.approx(noise.mean(), rel=0.02)


# ---- frames


def frame(gain: float = 1.0) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray]:
    crops = reflections().crops([LEVEL])
    scenery = Scenery(world(), CAMERA, LEVEL[0], noise_tile(3)).picture([LEVEL])
    gains = np.full(3, gain)
    return maker().root(scenery, crops, LEVEL[0], gains), crops, gains


def test_crop_resampled_from_the_frame_is_the_true_crop() -> None:
    """The ideal camera's view of the noise-free frame, by plain interpolation."""
    root, crops, gains = frame()
    linear = np.clip(root.transpose(1, 2, 0) ** 2, 0, 1)
    true = maker().true_crops(root, crops, gains)
    rig = reflections().rig
    for number, name in enumerate(SPHERES):
        view = rig.view(name, 32)
        fine = PinholeCamera(128, 128, 2 * view.angular_radius_rad)
        row, column = CAMERA.pixel_of_directions(fine.rays() @ view.ball_from_camera)
        small = resample.shrink(bilinear(linear, row, column), 32, 32)
        mask = view.mask()
        error = np.abs(encode(small) - true[number] / 255)[mask].mean()
        flipped = np.abs(encode(small)[::-1] - true[number] / 255)[mask].mean()
        # A sphere is 56 pixels wide in this small frame: the mirror's details suffer.
        assert error < (0.02 if name == "mirror" else 0.003)
        assert flipped > 3 * error


def bilinear(values: np.ndarray, row: np.ndarray, column: np.ndarray) -> np.ndarray:
    top, left = np.floor(row).astype(int), np.floor(column).astype(int)
    down, right = (row - top)[..., None], (column - left)[..., None]
    upper = values[top, left] * (1 - right) + values[top, left + 1] * right
    lower = values[top + 1, left] * (1 - right) + values[top + 1, left + 1] * right
    return upper * (1 - down) + lower * down


def test_developing_is_the_phones() -> None:
    root, _, _ = frame(2.0)
    automatics = replace(PLAIN, gamma=2.3, contrast=0.1)
    rig = reflections().rig
    picture = FrameMaker(rig, CAMERA, world(), automatics).develop(root, np.random.default_rng(0))
    linear = root.transpose(1, 2, 0) ** 2
    wanted = develop(linear, np.ones(3, np.float32), automatics, 1, np.random.default_rng(0))
    assert np.abs(picture.astype(int) - wanted).max() <= 1


def test_noise_is_the_phones() -> None:
    automatics = replace(PLAIN, noise=2e-3)
    film = FrameMaker(reflections().rig, CAMERA, world(), automatics)
    for level in (0.1, 0.3):
        root = np.full((3, 120, 100), np.sqrt(level), np.float32)
        got = film.develop(root, np.random.default_rng(0)).std()
        linear = np.full((120, 100, 3), level, np.float32)
        ones = np.ones(3, np.float32)
        assert got == pytest.approx(
            develop(linear, ones, automatics, 4, np.random.default_rng(1)).std(), rel=0.1
        )


def test_holder_and_finger_cover_what_they_should() -> None:
    rig = draw_rig(np.random.default_rng(1), tag=True)
    holder = holder_in_picture(rig, CAMERA)
    lowest = max(sphere_patch(rig, name, CAMERA).rows.stop for name in SPHERES)
    assert holder.row.min() > 0.75 * CAMERA.height
    assert (holder.row > lowest - 20).mean() > 0.3
    finger = finger_in_picture(CAMERA, (420.0, 100.0), (430.0, -30.0), 12.0)
    at = {(r, c): a for r, c, a in zip(finger.row, finger.column, finger.alpha[:, 0], strict=True)}
    assert at[(420, 95)] == 1
    assert (300, 95) not in at
    assert not len(finger_in_picture(CAMERA, (420.0, -50.0), (430.0, -90.0), 12.0).row)
    hidden = maker().covered(finger)
    assert hidden["mirror"] > 0.2 > hidden["diffuse"] == 0.0


def test_tag_is_read_by_opencv() -> None:
    cv2 = pytest.importorskip("cv2")
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_APRILTAG_36h11)
    reader = cv2.aruco.ArucoDetector(family)
    for number in range(len(CODES_36H11)):
        cells = (tag_cells(number) * 255).astype(np.uint8)
        picture = np.pad(cells.repeat(12, 0).repeat(12, 1), 40, constant_values=200)
        _, found, _ = reader.detectMarkers(picture)
        assert found is not None
        assert found.ravel().tolist() == [number]
        _, found, _ = reader.detectMarkers(255 - picture)
        assert found is None


# ---- clips


def clip(*troubles: str, **changes: object) -> Clip:
    return Clip(panorama(), "outdoor", replace(SMALL, **changes), troubles, [0, 1, 3])


@lru_cache(maxsize=1)
def untroubled() -> list[FilmFrame]:
    return list(clip().frames())


def test_troubles_trouble() -> None:
    """Each trouble, seen in the frames it makes."""
    plain = untroubled()
    by_gain = {t: next(clip(t).frames()).log_gain[1] for t in ("dark", "over_exposed")}
    assert by_gain["dark"] + 1 < plain[0].log_gain[1] < by_gain["over_exposed"] - 0.3
    rough = [
        np.diff(frame.pixels[:160].astype(int), axis=1).std()
        for frame in (plain[0], next(clip("low_texture").frames()))
    ]
    assert rough[0] > 1.1 * rough[1]
    assert next(clip("blur").frames()).motion_blur_px > 3 * plain[0].motion_blur_px
    uneven = [f.time_s for f in clip("variable_rate").frames()]
    assert np.ptp(np.diff(uneven)) > 0.003
    assert np.ptp(np.diff([f.time_s for f in plain])) < 1e-9
    assert next(clip("hlg10").frames()).pixels.dtype == np.uint16


def test_landscape_turns_frame_camera_and_spheres_together() -> None:
    sideways = clip("landscape")
    shown = next(sideways.frames())
    assert shown.pixels.shape[:2] == (sideways.camera.height, sideways.camera.width) == (180, 320)
    for name in SPHERES:
        centre = sideways.upright_from_phone @ sideways.rig.centres_m[name]
        (row,), (column,) = sideways.camera.pixel_of_directions(centre[None])
        before = sideways.phone_camera.pixel_of_directions(sideways.rig.centres_m[name][None])
        assert column > 0.75 * sideways.camera.width  # the rig hangs at the right
        np.testing.assert_allclose((row, column), (179 - before[1][0], before[0][0]), atol=1e-6)
    # Its crops are those of a camera that `looking_at` turns to the sphere in the upright frame.
    for number, name in enumerate(SPHERES):
        centre = sideways.upright_from_phone @ sideways.rig.centres_m[name]
        distance = np.linalg.norm(centre)
        view = SphereView(looking_at(centre), float(np.arcsin(0.04 / distance)))
        fine = PinholeCamera(128, 128, 2 * view.angular_radius_rad)
        row, column = sideways.camera.pixel_of_directions(fine.rays() @ view.ball_from_camera)
        pixels = decode(shown.pixels / 255.0)
        small = encode(resample.shrink(bilinear(pixels, row, column), 32, 32))
        got, mask = shown.crops[number] / 255, view.mask()
        error = np.abs(small - got)[mask].mean()
        if name == "matte_silver":
            assert error < 0.01 < np.abs(small - np.rot90(got))[mask].mean() / 2
        assert error < 0.03
    # Gravity is where the upright frame says: the sky is blue at the top.
    top, foot = shown.pixels[:30].mean((0, 1)), shown.pixels[-30:, :200].mean((0, 1))
    assert top[2] > top[0]
    assert foot[0] > foot[2]


def test_a_clip_is_decided_by_its_seed() -> None:
    one, two = untroubled()[0], next(clip().frames())
    np.testing.assert_array_equal(one.pixels, two.pixels)
    np.testing.assert_array_equal(one.crops, two.crops)
    other = next(Clip(panorama(), "outdoor", SMALL, (), [0, 2, 3]).frames())
    assert (other.pixels != one.pixels).mean() > 0.5


def test_troubles_come_after_the_first_third_one_or_two_each() -> None:
    recipe = FilmRecipe(clips=27, troubles=("all",))
    troubles = [recipe.troubles_of(n) for n in range(27)]
    assert troubles[:9] == [()] * 9
    assert [t[0] for t in troubles[9:21]] == list(TROUBLES)
    assert all(len(set(t)) == len(t) == 2 for t in troubles[21:])
