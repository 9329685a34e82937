"""Solid things near the camera: balls, rods and boxes, and where rays meet them first.

In the camera frame, metres. Used twice: for what the phone sees of the rig, and for what the
spheres reflect of the rig, the phone and its holder.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from deeplight.frames import Directions, dot, normalised

Distances = Float[np.ndarray, "n"]
Points = Float[np.ndarray, "n 3"]


@dataclass(frozen=True, eq=False)
class Ball:
    """A sphere."""

    centre_m: Float[np.ndarray, "3"]
    radius_m: float

    def hit(self, origins: Points, directions: Points) -> Distances:
        """Distance along each ray; inf where it misses."""
        towards = self.centre_m - origins
        along = dot(towards, directions)
        half = self.radius_m**2 - dot(towards, towards) + along**2
        distance = along - np.sqrt(np.maximum(half, 0))
        return np.where((half > 0) & (distance > 1e-6), distance, np.inf)

    def normals(self, points: Points) -> Points:
        """Outward normal at points of the surface."""
        return normalised(points - self.centre_m)


@dataclass(frozen=True, eq=False)
class Rod:
    """A round rod with round ends."""

    start_m: Float[np.ndarray, "3"]
    end_m: Float[np.ndarray, "3"]
    radius_m: float

    def hit(self, origins: Points, directions: Points) -> Distances:
        """Distance along each ray; inf where it misses."""
        axis = self.end_m - self.start_m
        length = float(np.linalg.norm(axis))
        axis = axis / length
        from_start = origins - self.start_m
        ray_axis, start_axis = directions @ axis, from_start @ axis
        across, offset = (
            directions - ray_axis[:, None] * axis,
            from_start - start_axis[:, None] * axis,
        )
        a, b = dot(across, across), dot(across, offset)
        half = b * b - a * (dot(offset, offset) - self.radius_m**2)
        distance = (-b - np.sqrt(np.maximum(half, 0))) / np.maximum(a, 1e-12)
        at = start_axis + distance * ray_axis
        side = np.where((half > 0) & (distance > 1e-6) & (at > 0) & (at < length), distance, np.inf)
        ends = [Ball(end, self.radius_m).hit(origins, directions) for end in self._ends()]
        return np.minimum(side, np.minimum(*ends))

    def normals(self, points: Points) -> Points:
        """Outward normal at points of the surface."""
        axis = self.end_m - self.start_m
        share = np.clip((points - self.start_m) @ axis / (axis @ axis), 0, 1)
        return normalised(points - (self.start_m + share[:, None] * axis))

    def _ends(self) -> tuple[np.ndarray, np.ndarray]:
        return self.start_m, self.end_m


@dataclass(frozen=True, eq=False)
class Box:
    """A box; `box_from_camera` turns camera directions into its own axes."""

    centre_m: Float[np.ndarray, "3"]
    half_size_m: Float[np.ndarray, "3"]
    box_from_camera: Float[np.ndarray, "3 3"]

    def hit(self, origins: Points, directions: Points) -> Distances:
        """Distance along each ray; inf where it misses."""
        start = (origins - self.centre_m) @ self.box_from_camera.T
        way = directions @ self.box_from_camera.T
        inverse = 1 / np.where(abs(way) < 1e-9, 1e-9, way)
        one, two = (-self.half_size_m - start) * inverse, (self.half_size_m - start) * inverse
        near, far = np.minimum(one, two).max(-1), np.maximum(one, two).min(-1)
        return np.where((near < far) & (near > 1e-6), near, np.inf)

    def normals(self, points: Points) -> Points:
        """Outward normal at points of the surface."""
        own = (points - self.centre_m) @ self.box_from_camera.T / self.half_size_m
        face = abs(own) >= abs(own).max(-1, keepdims=True)
        return normalised((face * np.sign(own)) @ self.box_from_camera)


@dataclass(frozen=True, eq=False)
class Thing:
    """A shape and what it is made of.

    Attributes:
        shape: where it is.
        material: of `world.MATERIALS`: how it reflects.
        colour: reflectivity of red, green and blue.
    """

    shape: Ball | Rod | Box
    material: str
    colour: tuple[float, float, float]


def first_hits(
    things: list[Thing], origins: Points, directions: Directions
) -> tuple[Int[np.ndarray, "n"], Distances]:
    """For each ray the index of the first thing in its way, -1 for none, and how far it is."""
    index = np.full(len(directions), -1)
    nearest = np.full(len(directions), np.inf)
    for number, thing in enumerate(things):
        distance = thing.shape.hit(origins, directions)
        closer = distance < nearest
        index[closer], nearest[closer] = number, distance[closer]
    return index, nearest
