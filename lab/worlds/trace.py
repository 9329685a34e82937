"""A made-up place as panoramas: each group of lights traced once, then mixed for every mood."""

from typing import Any

import numpy as np
from jaxtyping import Float, Float32

from deeplight.compose.denoise import denoised
from deeplight.compose.mitsuba_variant import mitsuba
from deeplight.mappings import cube, latlong
from lab.worlds.world import Dome, Gains, LightGroup, Sun, Surface, World

BOUNCES = 6
ROUNDS = 2  # of denoising
FLATNESS = 0.15  # metres a neighbour may be away, over the distance, to count
SUN_RADIUS_RAD = 0.0046
AOVS = "albedo:albedo,normal:sh_normal,position:position"

Cube = Float[np.ndarray, "6 size size channels"]
Panorama = Float32[np.ndarray, "height width 3"]


def panoramas(world: World, height: int, samples: int, seed: int) -> dict[str, Panorama]:
    """The panorama of each mood, `height` x 2 `height`, in the units of the lights.

    Args:
        samples: paths through each pixel of the cube that the panorama is made from.
    """
    mi = mitsuba("scalar")
    size = max(8, round(height / 2))
    faces = {
        name: _traced(mi, world, name, size, samples, seed + number)
        for number, name in enumerate(world.groups)
    }
    return {mood: _mixed(world, faces, gains, height) for mood, gains in world.moods.items()}


def _mixed(world: World, faces: dict[str, np.ndarray], gains: Gains, height: int) -> Panorama:
    """Light is additive: the groups' panoramas times the mood's gains."""
    total = np.zeros((height, 2 * height, 3))
    directions = latlong.directions(height, 2 * height)
    for name, gain in gains.items():
        seen, clear = faces[name][..., :3], faces[name][..., 3]
        total += _look_up(seen, directions) * np.array(gain)
        for light in world.groups[name].lights:
            if isinstance(light, Sun):
                total += _disc(light, clear, height) * np.array(gain)
    return total.astype(np.float32)


def _disc(sun: Sun, clear: np.ndarray, height: int) -> np.ndarray:
    """The sun itself, as bright as its irradiance says, where nothing stands before it."""
    towards = np.array([sun.direction])
    (face,), (row,), (column,) = cube.position(towards, clear.shape[1])
    at = (round(float(row)), round(float(column)))
    directions = latlong.directions(height, 2 * height)
    radius = max(SUN_RADIUS_RAD, np.pi / height)
    inside = (directions @ towards[0]) > np.cos(radius)
    solid_angle = (inside * latlong.solid_angles(height, 2 * height)).sum()
    free = clear[(face, *np.clip(at, 0, clear.shape[1] - 1))]
    return np.asarray(inside[..., None] * (sun.irradiance * free / max(solid_angle, 1e-9)))


def _look_up(faces: Cube, directions: np.ndarray) -> np.ndarray:
    """Bilinear within each face."""
    size = faces.shape[1]
    face, row, column = cube.position(directions, size)
    row, column = (np.clip(at, 0, size - 1) for at in (row, column))
    top, left = (np.minimum(at.astype(int), size - 2) for at in (row, column))
    down, right = (row - top)[..., None], (column - left)[..., None]
    upper, lower = (
        faces[face, r, left] * (1 - right) + faces[face, r, left + 1] * right
        for r in (top, top + 1)
    )
    result: np.ndarray = upper * (1 - down) + lower * down
    return result


def _traced(mi: Any, world: World, group: str, size: int, samples: int, seed: int) -> np.ndarray:
    """Radiance under one group as six faces; a fourth channel marks where nothing was met."""
    scene = mi.load_dict(_scene(mi, world, group))
    faces = []
    for number, name in enumerate(cube.FACES):
        camera = mi.load_dict(_camera(mi, world, name, size))
        image = np.array(mi.render(scene, sensor=camera, spp=samples, seed=6 * seed + number))
        faces.append(_cleaned(image.astype(np.float64), np.array(world.eye)))
    return np.stack(faces)


def _cleaned(image: np.ndarray, eye: np.ndarray) -> np.ndarray:
    """The grain averaged away between neighbours on one surface; textures stay sharp.

    What falls on a surface is smooth, what it reflects of it is not: only the first is averaged.
    """
    radiance, albedo, normal, position = np.split(image, (3, 6, 9), axis=-1)
    met = (np.abs(normal).sum(-1) > 0.5).astype(float)
    surface = met * (albedo.max(-1) > 0.01)  # lights have no albedo, and stay as they are
    distance = np.linalg.norm(position - eye, axis=-1, keepdims=True)
    features = np.concatenate([normal, position / np.maximum(distance, 0.1) / FLATNESS], -1) * 0.3
    falls = radiance / np.maximum(albedo, 0.01) * surface[..., None]
    limit = 8 * np.median(falls[surface > 0], axis=0) if surface.any() else np.inf
    falls = np.minimum(falls, np.maximum(limit, _around(falls)))  # paths of little chance
    for _ in range(ROUNDS):
        falls = denoised(falls, surface, features * surface[..., None])
    cleaned = np.where(surface[..., None] > 0, falls * np.maximum(albedo, 0.01), radiance)
    return np.concatenate([cleaned, 1 - met[..., None]], -1)


def _around(values: np.ndarray) -> np.ndarray:
    """The second largest of a pixel and its four neighbours."""
    padded = np.pad(values, [(1, 1), (1, 1), (0, 0)], mode="edge")
    height, width = values.shape[:2]
    shifts = ((1, 1), (0, 1), (2, 1), (1, 0), (1, 2))
    stacked = np.stack([padded[r : r + height, c : c + width] for r, c in shifts])
    return np.asarray(np.sort(stacked, axis=0)[-2])


def _camera(mi: Any, world: World, face: str, size: int) -> dict[str, Any]:
    """A quarter-circle view of one face of the cube."""
    directions = cube.directions(2)[cube.FACES.index(face)]
    forward = directions.mean((0, 1))
    up = directions[0].mean(0) - forward
    eye = np.array(world.eye)
    look = mi.ScalarTransform4f().look_at(
        origin=eye.tolist(), target=(eye + forward).tolist(), up=(up / np.linalg.norm(up)).tolist()
    )
    film = {"type": "hdrfilm", "width": size, "height": size, "rfilter": {"type": "box"}}
    sampler = {"type": "independent"}
    return {"type": "perspective", "fov": 90, "to_world": look, "film": film, "sampler": sampler}


def _scene(mi: Any, world: World, group: str) -> dict[str, Any]:
    """The place with one group shining and the others switched off."""
    path = {"type": "path", "max_depth": BOUNCES}
    scene: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "aov", "aovs": AOVS, "path": path},
    }
    things = [*world.surfaces, *world.groups[group].lights]
    for name, other in world.groups.items():
        if name != group:
            things += _unlit(other, group)
    for number, thing in enumerate(things):
        scene[f"thing{number}"] = _described(mi, thing)
    return scene


def _unlit(group: LightGroup, shining: str) -> list[Surface]:
    return list(group.unlit.get(shining, group.unlit.get("", ())))


def _described(mi: Any, thing: Surface | Sun | Dome) -> dict[str, Any]:
    """A surface or a light as Mitsuba takes it."""
    if isinstance(thing, Sun):
        towards = [-part for part in thing.direction]
        light = {"type": "rgb", "value": [thing.irradiance] * 3}
        return {"type": "directional", "direction": towards, "irradiance": light}
    if isinstance(thing, Dome):
        bitmap = mi.Bitmap(np.ascontiguousarray(thing.radiance, np.float32))
        # Mitsuba's panoramas have +Z in the centre and +X to the left; ours -Z and +X right.
        turn = mi.ScalarTransform4f().rotate([0, 1, 0], 180)
        return {"type": "envmap", "bitmap": bitmap, "to_world": turn}
    kinds = {"box": "cube", "panel": "rectangle", "ball": "sphere"}
    local = np.eye(4)
    if thing.form != "ball":  # Mitsuba's reach from -1 to 1, ours from 0 to 1
        local[[0, 1], [0, 1]] = 0.5
        local[[0, 1], [3, 3]] = 0.5
    if thing.form == "box":
        local[2, 2] = local[2, 3] = 0.5
    shape = {
        "type": kinds[thing.form],
        "to_world": mi.ScalarTransform4f(thing.world_from_shape @ local),
    }
    paint = {"type": "rgb", "value": thing.paint[0, 0].tolist()}
    if thing.paint.shape[:2] != (1, 1):
        upright = thing.paint[::-1]  # Mitsuba counts v downwards
        bitmap = mi.Bitmap(np.ascontiguousarray(upright, np.float32))
        paint = {"type": "bitmap", "bitmap": bitmap, "raw": True}
    if thing.glows:
        black = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
        return shape | {"bsdf": black, "emitter": {"type": "area", "radiance": paint}}
    coated = {"type": "plastic", "diffuse_reflectance": paint, "nonlinear": True}
    bsdf = coated if thing.gloss else {"type": "diffuse", "reflectance": paint}
    return shape | {"bsdf": {"type": "twosided", "bsdf": bsdf}}
