"""What must hold of every composite: rendered small, with Mitsuba's scalar variant."""

from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest
from PIL import Image

from deeplight.camera import PinholeCamera
from deeplight.compose import materials
from deeplight.compose.compose import ComposeSettings, Item, compose
from deeplight.compose.composite import RESPONSE, composite
from deeplight.compose.ground import Viewpoint
from deeplight.compose.mesh import load, standing
from deeplight.compose.mitsuba_variant import mitsuba
from deeplight.compose.scene import (
    ImageWindow,
    Scene,
    Solid,
    Texture,
    irradiance_on_plane,
    mitsuba_scene,
    sensor,
)
from deeplight.compose.surface import surface_of
from deeplight.compose.trace import MOST_BOUNCES, Layers, Quality, trace
from deeplight.frames import normalised, turned
from deeplight.mappings import latlong

pytestmark = pytest.mark.needs("mitsuba")


TINY = Quality(samples=16, shadow_samples=24, shadow_pixels=700)
VIEW = Viewpoint(PinholeCamera(64, 48, np.radians(50)), 1.0, np.radians(-30))
DIRECTIONS = latlong.directions(32, 64)
WHITE = np.ones((32, 64, 3), np.float32)


def solid(material: str = "diffuse", size: float = 0.35, view: Viewpoint = VIEW) -> Solid:
    return Solid(standing(load("sphere"), view.point(32, 30), size), material)


def scene(light: np.ndarray, material: str = "diffuse", albedo: float = 0.4) -> Scene:
    return Scene(VIEW, light.astype(np.float32), [solid(material)], np.full(3, albedo))


def sun(towards: tuple[float, float, float], view: Viewpoint = VIEW) -> np.ndarray:
    """Faint light from everywhere and a lamp in a direction of the world, seen by the camera."""
    axis = view.world_from_camera.T @ normalised(np.array(towards, float))
    return (0.05 + 40 * (DIRECTIONS @ axis > 0.99)[..., None] * np.ones(3)).astype(np.float32)


def over_object(layers: Layers) -> np.ndarray:
    """Mean radiance of the object."""
    return layers.radiance.sum((0, 1)) / layers.cover.sum()


def half(layers: Layers, side: str) -> np.ndarray:
    """Mean radiance of the object's left or right half."""
    columns = np.arange(layers.cover.shape[1])[None]
    middle = (layers.cover * columns).sum() / layers.cover.sum()
    keep = (columns < middle) if side == "left" else (columns > middle)
    return (layers.radiance * keep[..., None]).sum((0, 1)) / (layers.cover * keep).sum()


def inside_the_scene(true: Scene, samples: int = 256) -> np.ndarray:
    """Radiance of the whole picture, object and plane together, straight from Mitsuba."""
    mi = mitsuba("scalar")
    loaded = mitsuba_scene(mi, true)
    camera = sensor(mi, VIEW, ImageWindow.over((0, 0, 64, 48), 1.0))
    path = mi.load_dict({"type": "path", "max_depth": MOST_BOUNCES + 1})
    return np.array(mi.render(loaded, sensor=camera, integrator=path, seed=9, spp=samples))[..., :3]


def encoded(radiance: np.ndarray) -> np.ndarray:
    return RESPONSE.pixel_from_radiance(radiance.astype(np.float32))


def blocks(picture: np.ndarray) -> np.ndarray:
    """Means over 4 x 4 pixels below the horizon, against noise."""
    return picture[8:].reshape(10, 4, 16, 4, 3).mean((1, 3))


def test_a_composite_under_the_true_light_is_the_object_inside_the_scene() -> None:
    """Within 0.006 of pixel values on average, mostly the noise of the two renderings."""
    directions = latlong.directions(64, 128)
    towards = VIEW.world_from_camera.T @ normalised(np.array([-1, 1.2, 0.3]))
    light = 0.3 * np.array([0.7, 0.9, 1.0]) + 6 * (directions @ towards > 0.93)[..., None]
    albedo = np.array([0.5, 0.4, 0.3])
    plane = albedo * irradiance_on_plane(light, VIEW) / np.pi
    light, plane = (values * (0.5 / plane.max()) for values in (light.astype(np.float32), plane))
    pixel = RESPONSE.pixel_from_radiance(np.tile(plane, (48, 64, 1)))
    photo = np.round(pixel * 255).astype(np.uint8)
    item = Item("sphere", "diffuse", (32, 30), 0.35)
    settings = ComposeSettings(Quality(64, 64, 4000), "scalar", blur=False, grain=False)
    result = compose(photo, light, VIEW, [item], settings)
    assert result.scene.albedo == pytest.approx(albedo, rel=0.02)
    true = replace(result.scene, albedo=albedo)
    difference = blocks(result.composite.pixels / 255 - encoded(inside_the_scene(true)))
    assert np.abs(difference).mean() < 0.006
    assert np.abs(difference).max() < 0.03
    # The twin: a shadow on the other side would be found.
    flipped = inside_the_scene(replace(true, light=light[:, ::-1]), samples=64)
    wrong = blocks(result.composite.pixels / 255 - encoded(flipped))
    assert np.abs(wrong).mean() > 0.015
    assert np.abs(wrong).max() > 0.2


@pytest.mark.parametrize("azimuth_deg", [10, 80, 150, 225, 300])
def test_the_shadow_falls_away_from_the_sun(azimuth_deg: float) -> None:
    azimuth = np.radians(azimuth_deg)
    towards = (np.sin(azimuth), 1.0, -np.cos(azimuth))
    layers = trace(scene(sun(towards)), TINY, "scalar")
    left, top, right, bottom = layers.crop
    rays = turned(VIEW.camera.rays()[top:bottom, left:right], VIEW.world_from_camera)
    points = rays * (-VIEW.height_m / np.minimum(rays[..., 1:2], -1e-6))
    away = (points - VIEW.point(32, 30))[..., [0, 2]]
    lost = (1 - layers.shadow.mean(-1)).clip(0) * (layers.cover == 0)
    lost *= np.linalg.norm(away, axis=-1) < 1
    side = (lost[..., None] * away).sum((0, 1))
    cosine = side @ [-towards[0], -towards[2]] / np.linalg.norm(side)
    assert cosine > np.cos(np.radians(45))  # what hides behind the ball turns it a little


def test_a_perfect_object_on_a_perfect_plane_in_a_white_world_vanishes(monkeypatch) -> None:
    monkeypatch.setattr(materials, "REFLECTIVITY", MappingProxyType({"diffuse": 1.0}))
    layers = trace(scene(WHITE, albedo=1.0), TINY, "scalar")
    assert over_object(layers) == pytest.approx(1, abs=0.03)
    assert layers.shadow[layers.cover == 0].mean() == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize("material", ["diffuse", "silver", "mirror"])
def test_white_light_from_everywhere_gives_the_reflectivity(material: str) -> None:
    white_below = trace(scene(WHITE, material), TINY, "scalar", light_from_below=True)
    wanted = materials.REFLECTIVITY[material]
    assert over_object(white_below) == pytest.approx(wanted, rel=0.02)


@pytest.mark.parametrize("roll_deg", [0, 15])
def test_a_red_light_from_the_left_reddens_the_left_side(roll_deg: float) -> None:
    left = (DIRECTIONS[..., 0] < -0.6)[..., None]
    light = 0.1 + left * np.array([3.0, 0.0, 0.0])
    view = replace(VIEW, roll_rad=np.radians(roll_deg))
    red = replace(scene(light), viewpoint=view, solids=[solid(view=view)])
    lit = trace(red, TINY, "scalar")
    assert half(lit, "left")[0] > 2 * half(lit, "right")[0]
    assert half(lit, "left")[2] < 0.3 * half(lit, "left")[0]
    flipped = trace(replace(red, light=red.light[:, ::-1]), TINY, "scalar")
    assert half(flipped, "right")[0] > 2 * half(flipped, "left")[0]


def test_only_ratios_of_lengths_matter() -> None:
    small = scene(sun((1, 1, 0)))
    large_view = replace(VIEW, height_m=10.0)
    meshes = standing(load("sphere"), large_view.point(32, 30), 3.5)
    large = replace(small, viewpoint=large_view, solids=[Solid(meshes, "diffuse")])
    one, ten = trace(small, TINY, "scalar"), trace(large, TINY, "scalar")
    assert one.crop == ten.crop
    assert np.abs(one.cover - ten.cover).max() < 0.3  # a ray on the rim may go either way
    assert np.abs(one.shadow - ten.shadow).mean() < 0.003


def test_light_from_below_is_the_surfaces_unless_switched() -> None:
    green_below = WHITE * 0.2
    down = (VIEW.world_from_camera[1] @ DIRECTIONS.reshape(-1, 3).T).reshape(32, 64) < -0.1
    green_below[down] = [0, 5, 0]
    dark_plane = scene(green_below, albedo=0.05)
    kept = over_object(trace(dark_plane, TINY, "scalar", light_from_below=True))
    replaced = over_object(trace(dark_plane, TINY, "scalar"))
    assert kept[1] > 4 * kept[0]
    assert replaced[1] == pytest.approx(replaced[0], rel=0.05)


def test_a_texture_is_upright_and_unmirrored(tmp_path: Path) -> None:
    """A glTF board that faces the camera: red above left, green above right, blue below."""
    trimesh = pytest.importorskip("trimesh")
    picture = np.zeros((8, 8, 3), np.uint8)
    picture[:4, :4, 0], picture[:4, 4:, 1], picture[4:, :, 2] = 255, 255, 255
    corners = np.array([[-1, 0, 0], [1, 0, 0], [1, 2, 0], [-1, 2, 0]], float)
    material = trimesh.visual.material.PBRMaterial(
        baseColorTexture=Image.fromarray(picture), roughnessFactor=1.0, metallicFactor=0.0
    )
    visual = trimesh.visual.TextureVisuals(
        np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float), material=material
    )
    board = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], visual=visual, process=False)
    (tmp_path / "board.glb").write_bytes(board.export(file_type="glb"))
    meshes = standing(load(str(tmp_path / "board.glb")), VIEW.point(32, 34), 0.5)
    painted = replace(scene(WHITE, albedo=0.05), solids=[Solid(meshes, "file")])
    layers = trace(painted, TINY, "scalar")
    inside = np.argwhere(layers.cover > 0.99)
    (top, left), (bottom, right) = inside.min(0), inside.max(0)
    third = max((bottom - top) // 3, 1)
    upper, lower = slice(top, top + third), slice(bottom - third, bottom + 1)
    sides = slice(left, left + third), slice(right - third, right + 1)
    seen = [
        layers.radiance[rows, columns].mean((0, 1)).argmax()
        for rows in (upper, lower)
        for columns in sides
    ]
    assert seen == [0, 1, 2, 2]


def test_what_nothing_changes_keeps_its_bytes() -> None:
    photo = np.random.default_rng(0).integers(0, 256, (48, 64, 3), np.uint8)
    settings = ComposeSettings(TINY, "scalar")
    result = compose(photo, sun((1, 1, 0)), VIEW, [Item("sphere", None, (32, 30), 0.2)], settings)
    layers = result.composite.layers
    left, top, right, bottom = layers.crop
    touched = np.zeros((48, 64), bool)
    shadow = (np.abs(layers.shadow - 1) > 1e-3).any(-1)
    touched[top:bottom, left:right] = (layers.cover > 0) | shadow
    assert 20 < touched.sum() < 0.8 * touched.size
    assert (result.composite.pixels == photo)[~touched].all()
    assert (result.composite.pixels != photo)[touched].any()


def test_a_scene_without_objects_is_the_photo() -> None:
    photo = np.random.default_rng(0).integers(0, 256, (48, 64, 3), np.uint8)
    empty = Scene(VIEW, WHITE, [], np.full(3, 0.5))
    assert (composite(photo, trace(empty, TINY, "scalar")).pixels == photo).all()


def test_the_planes_albedo_is_the_photos_pixels_over_the_light() -> None:
    light = sun((0.3, 1, 0.2))
    radiance = np.array([0.2, 0.1, 0.05]) * irradiance_on_plane(light, VIEW) / np.pi
    light = (light * (0.3 / radiance.max())).astype(np.float32)
    radiance = (radiance * (0.3 / radiance.max())).astype(np.float32)
    photo = np.tile(np.round(RESPONSE.pixel_from_radiance(radiance) * 255), (48, 64, 1))
    surface = surface_of(photo.astype(np.uint8), light, VIEW, [solid()])
    assert surface.albedo == pytest.approx([0.2, 0.1, 0.05], rel=0.06)
    dim = surface_of(photo.astype(np.uint8), light / 20, VIEW, [solid()])
    assert dim.measured == pytest.approx([4, 2, 1], rel=0.06)
    assert dim.albedo.max() == pytest.approx(0.9)


def test_white_light_falls_on_the_plane_as_pi() -> None:
    assert irradiance_on_plane(WHITE, VIEW) == pytest.approx(np.pi, rel=2e-3)


def test_a_mirror_on_a_patterned_floor_is_the_mirror_inside_the_scene() -> None:
    """The floor it reflects is the photo's; the twin, a floor of one colour, is far off."""
    steps = np.linspace(-1, 1, 64)
    red, blue = (np.where(steps * sign > 0, 0.7, 0.1) for sign in (-1, 1))
    pattern = np.zeros((64, 64, 3), np.float32)
    pattern[..., 0], pattern[..., 2] = red, blue  # red on the left
    pattern[..., 1] = np.where(np.sin(9 * steps) > 0, 0.6, 0.1)[:, None]  # rows across
    item, light = Item("sphere", "mirror", (32, 26), 0.35), WHITE * 0.5
    centre = (0.0, float(VIEW.point(32, 26)[2]))
    bare = Scene(VIEW, light, [], np.full(3, 0.4), Texture(centre, 2.0, pattern))
    photo = np.round(encoded(inside_the_scene(bare, 64)) * 255).astype(np.uint8)
    errors = []
    for texture in (True, False):
        settings = ComposeSettings(TINY, "scalar", texture=texture, blur=False, grain=False)
        found = compose(photo, light, VIEW, [item], settings)
        true = inside_the_scene(replace(found.scene, texture=bare.texture), 64)
        left, top, right, bottom = found.composite.layers.crop
        inner = found.composite.layers.cover > 0.99
        inner[: int(np.argwhere(inner)[:, 0].mean())] = False  # the upper half shows the sky
        difference = found.composite.pixels / 255 - encoded(true)
        errors.append(np.abs(difference[top:bottom, left:right][inner]).mean())
    assert errors[0] < 0.04, errors
    assert errors[1] > 2 * errors[0], errors
