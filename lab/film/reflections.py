"""What the spheres show: the scene, each other, the rig and its holder.

Every sphere has its own surroundings. Where a ray from it meets something near, that shows a
reflection of the place blurred as its material blurs (`World.glossy`): light is followed to
the second bounce and not further, and near things cast no shadow on each other.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from deeplight import brdf
from deeplight.frames import Directions, Rotation, turned
from deeplight.lighting import LIGHTING_SIZE, Lighting
from deeplight.mappings import latlong, mirror_ball, resample
from deeplight.reflectance import analytic_basis
from deeplight.relight import relight
from deeplight.sphere import SPHERES
from lab.film.parts import Points, Thing, first_hits
from lab.film.rig import FilmRig
from lab.film.world import MATERIALS, World

CROP = 256  # pixels along a mirror's crop, from which film and truth are made
_SMOOTH = 32  # of the other two, which blur the light more than that
_LIGHT = {"diffuse": 32, "matte_silver": 64}
_ENVIRONMENT = (128, 256)  # rows and columns of a sphere's surroundings

Crop = Float[np.ndarray, "crop crop 3"]
Place = tuple[Rotation, Float[np.ndarray, "3"]]  # world_from_camera and metres


@dataclass(frozen=True, eq=False)
class Nearby:
    """Which of some rays meet something near, and what that shows of the place.

    Attributes:
        ray: index of the ray.
        direction: where to look it up in `World.glossy`, camera frame.
        material: which of its maps.
        colour: reflectivity.
    """

    ray: Int[np.ndarray, "hits"]
    direction: Directions
    material: Int[np.ndarray, "hits"]
    colour: Float[np.ndarray, "hits 3"]

    def radiance(self, world: World, pose: Rotation) -> Float[np.ndarray, "hits 3"]:
        """What the near things show, the camera being held at `pose`."""
        result = np.empty((len(self.ray), 3), np.float32)
        for number in range(len(MATERIALS)):
            some = self.material == number
            if some.any():
                directions = turned(self.direction[some], pose)
                result[some] = resample.sample_latlong(world.glossy[number], directions)
        return result * self.colour


def nearby(things: list[Thing], origins: Points, directions: Directions) -> Nearby:
    """Follow rays, camera frame, to the first of `things` in their way."""
    index, distance = first_hits(things, origins, directions)
    ray = np.flatnonzero(index >= 0)
    points = origins[ray] + distance[ray, None] * directions[ray]
    looked = np.zeros((len(ray), 3))
    material = np.zeros(len(ray), int)
    colour = np.zeros((len(ray), 3), np.float32)
    for number, thing in enumerate(things):
        some = index[ray] == number
        normals, way = thing.shape.normals(points[some]), directions[ray[some]]
        mirrored = way - 2 * (way * normals).sum(-1, keepdims=True) * normals
        looked[some] = normals if thing.material == "diffuse" else mirrored
        material[some] = MATERIALS.index(thing.material)
        colour[some] = thing.colour
    return Nearby(ray, looked.astype(np.float32), material, colour)


class Reflections:
    """The spheres of one rig in one place; everything that a clip does not change is kept."""

    def __init__(self, world: World, rig: FilmRig, alone: bool = False) -> None:
        """Set up.

        Args:
            world: the place.
            rig: the rig.
            alone: leave out everything near: each sphere sees the place only.
        """
        self.world, self.rig = world, rig
        self._middle = np.mean([rig.centres_m[name] for name in SPHERES], axis=0)
        self._directions = latlong.directions(*_ENVIRONMENT).reshape(-1, 3)
        self._bins = {size: _Bins(size) for size in {LIGHTING_SIZE, *_LIGHT.values()}}
        self._upsample = linear_upsampling(CROP, _SMOOTH)
        self._things = {name: [] if alone else rig.seen_by(name) for name in SPHERES}
        self._near = {name: self._around(name) for name in _LIGHT}
        self._mirror = _Mirror(rig, self._things["mirror"], world)

    def surroundings(self, place: Place) -> Float[np.ndarray, "texels 3"]:
        """The place from the middle of the rig, camera frame, without anything near."""
        pose, position = place
        directions = turned(self._directions, pose)
        seen = self.world.seen(position + pose @ self._middle, directions)
        return self.world.radiance(seen, min(2, len(self.world.levels) - 1))

    def crops(self, places: list[Place]) -> dict[str, Crop]:
        """Radiance of every sphere while the camera was at `places`; meaningless off the disc."""
        middle = places[len(places) // 2]
        around = self.surroundings(middle)
        crops = {name: self._smooth(name, around, middle[0]) for name in _LIGHT}
        crops["mirror"] = self._mirror.crop(places)
        return {name: crops[name] for name in SPHERES}

    def lighting(self, place: Place) -> Float[np.ndarray, "size size 3"]:
        """Light that arrives at the rig, on the network's mirror ball, without anything near."""
        return self._bins[LIGHTING_SIZE].ball(self.surroundings(place))

    def _around(self, name: str) -> Nearby:
        origins = np.broadcast_to(self.rig.centres_m[name], self._directions.shape)
        return nearby(self._things[name], origins, self._directions.astype(float))

    def _smooth(self, name: str, around: Float[np.ndarray, "texels 3"], pose: Rotation) -> Crop:
        near = self._near[name]
        around = around.copy()
        around[near.ray] = near.radiance(self.world, pose)
        light = Lighting(self._bins[_LIGHT[name]].ball(around))
        basis = analytic_basis(name, self.rig.view(name, _SMOOTH), light.size)
        small = relight(basis, light).reshape(-1, 3)[mirror_ball.nearest_lit(_SMOOTH)]
        planes = small.reshape(_SMOOTH, _SMOOTH, 3).transpose(2, 0, 1)
        large: np.ndarray = self._upsample @ planes @ self._upsample.T
        return np.ascontiguousarray(large.transpose(1, 2, 0), np.float32)


class _Mirror:
    """The mirror, traced pixel by pixel, each at the size of panorama that it averages over."""

    def __init__(self, rig: FilmRig, things: list[Thing], world: World) -> None:
        self._world = world
        self._centre = rig.centres_m["mirror"]
        view = rig.view("mirror", CROP)
        reflected = view.reflected()
        self._shown = np.flatnonzero(view.alpha().ravel() > 0)
        directions = reflected.reshape(-1, 3)[self._shown]
        origins = self._centre + rig.radius_m * view.normals().reshape(-1, 3)[self._shown]
        self._near = nearby(things, origins, directions)
        self._directions = directions.astype(np.float32)
        spread = _spread(reflected).ravel()[self._shown]
        level = np.log2(np.maximum(spread * len(world.levels[0]) / np.pi, 1e-3))
        self._level = np.clip(np.floor(level + 0.5), 0, len(world.levels) - 1).astype(int)
        self._level[self._near.ray] = -1

    def crop(self, places: list[Place]) -> Crop:
        """Mean radiance over the places; zero off the sphere."""
        total = np.zeros((len(self._shown), 3), np.float32)
        for pose, position in places:
            centre = position + pose @ self._centre
            for number in range(len(self._world.levels)):
                some = self._level == number
                directions = turned(self._directions[some], pose)
                seen = self._world.seen(centre, directions)
                total[some] += self._world.radiance(seen, number)
            total[self._near.ray] += self._near.radiance(self._world, pose)
        crop = np.zeros((CROP * CROP, 3), np.float32)
        crop[self._shown] = total * (brdf.REFLECTIVITY["mirror"] / len(places))
        return crop.reshape(CROP, CROP, 3)


class _Bins:
    """Area averages of a sphere's surroundings on the mirror ball, directions fixed."""

    def __init__(self, size: int) -> None:
        height, width = (2 * side for side in _ENVIRONMENT)  # split, so that no pixel is missed
        directions = latlong.directions(height, width)
        self._pixel = mirror_ball.pixel_of_directions(directions, size).ravel()
        self._weight = latlong.solid_angles(height, width).ravel()
        row, column = np.divmod(np.arange(height * width), width)
        self._texel = row // 2 * _ENVIRONMENT[1] + column // 2
        self._area = np.bincount(self._pixel, self._weight, size * size)
        self._size = size

    def ball(self, values: Float[np.ndarray, "texels 3"]) -> Float[np.ndarray, "size size 3"]:
        planes = [
            np.bincount(self._pixel, channel[self._texel] * self._weight, len(self._area))
            for channel in values.T
        ]
        mean = np.stack(planes, axis=-1) / np.maximum(self._area, 1e-12)[:, None]
        return mean.reshape(self._size, self._size, 3).astype(np.float32)


def linear_upsampling(large: int, small: int) -> Float[np.ndarray, "large small"]:
    """The matrix that interpolates `small` pixels to `large` linearly, held at both ends."""
    at = np.clip((np.arange(large) + 0.5) * (small / large) - 0.5, 0, small - 1)
    return interpolation(at, small)


def interpolation(at: Float[np.ndarray, "n"], size: int) -> Float[np.ndarray, "n size"]:
    """The matrix that reads values of an array of `size` at fractional places."""
    low = np.clip(np.floor(at).astype(int), 0, max(size - 2, 0))
    share = (at - low).astype(np.float32)
    matrix = np.zeros((len(at), size), np.float32)
    matrix[np.arange(len(at)), low] = 1 - share
    matrix[np.arange(len(at)), np.minimum(low + 1, size - 1)] += share
    return matrix


def _spread(directions: Float[np.ndarray, "n n 3"]) -> Float[np.ndarray, "n n"]:
    """Angle between neighbouring pixels' directions, the mean of both ways."""
    across = np.linalg.norm(np.gradient(directions, axis=1), axis=-1)
    down = np.linalg.norm(np.gradient(directions, axis=0), axis=-1)
    spread: np.ndarray = np.sqrt(across * down)
    return spread
