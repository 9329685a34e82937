"""A made-up place: surfaces, groups of lights that are rendered apart, and moods that mix them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from jaxtyping import Float

Texture = Float[np.ndarray, "rows columns 3"]
Point = tuple[float, float, float]
Gains = Mapping[str, Point]

Form = Literal["box", "panel", "ball"]


@dataclass(frozen=True, eq=False)
class Surface:
    """One shape and what it is painted with.

    Attributes:
        form: box: the unit cube; panel: the square of side 1 in x and y; ball: of radius 1 about 0.
        world_from_shape: an affine map, metres; +Y is up.
        paint: linear albedo as a texture; of a light, its radiance.
        gloss: whether a clear coat lies over it.
        glows: whether it is a light.
    """

    form: Form
    world_from_shape: Float[np.ndarray, "4 4"]
    paint: Texture
    gloss: bool = False
    glows: bool = False


@dataclass(frozen=True, eq=False)
class Sun:
    """A distant light: unit direction towards it, irradiance on a surface that faces it."""

    direction: Point
    irradiance: float


@dataclass(frozen=True, eq=False)
class Dome:
    """Light from far away all around, as a latlong panorama."""

    radiance: Float[np.ndarray, "rows columns 3"]


@dataclass(frozen=True, eq=False)
class LightGroup:
    """Lights that shine together.

    Attributes:
        lights: what shines.
        unlit: what stands in their place while another group shines, by that group's name;
            "" for every group that is not named.
    """

    lights: Sequence[Surface | Sun | Dome]
    unlit: Mapping[str, Sequence[Surface]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class World:
    """A place.

    Attributes:
        scene: "indoor" or "outdoor".
        eye: where the panorama is seen from.
        surfaces: everything that does not shine.
        groups: lights by name.
        moods: how bright each group is, by mood and group; one panorama each.
    """

    scene: str
    eye: Point
    surfaces: Sequence[Surface]
    groups: Mapping[str, LightGroup]
    moods: Mapping[str, Gains]


def box(lowest: Point, highest: Point, paint: Texture, gloss: bool = False) -> Surface:
    """A box with its edges along the axes."""
    matrix = np.eye(4)
    matrix[[0, 1, 2], [0, 1, 2]] = np.subtract(highest, lowest)
    matrix[:3, 3] = lowest
    return Surface("box", matrix, paint, gloss)


def turned_box(
    centre: Point, size: Point, yaw_rad: float, paint: Texture, gloss: bool = False
) -> Surface:
    """A box that stands upright, turned about the vertical."""
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    turn = np.array([[cosine, 0, sine], [0, 1, 0], [-sine, 0, cosine]])
    matrix = np.eye(4)
    matrix[:3, :3] = turn * np.array(size)
    matrix[:3, 3] = np.array(centre) - matrix[:3, :3] @ np.full(3, 0.5)
    return Surface("box", matrix, paint, gloss)


def panel(
    corner: Point, across: Point, up: Point, paint: Texture, gloss: bool = False,
    glows: bool = False,
) -> Surface:  # fmt: skip
    """A parallelogram; it is seen, and shines, from the side of across x up."""
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1] = across, up
    matrix[:3, 2] = np.cross(across, up)
    matrix[:3, 3] = corner
    return Surface("panel", matrix, paint, gloss, glows)


def ball(centre: Point, radius: float, paint: Texture, glows: bool = False) -> Surface:
    """A sphere."""
    matrix = np.diag([radius, radius, radius, 1.0])
    matrix[:3, 3] = centre
    return Surface("ball", matrix, paint, glows=glows)


def direction_towards(azimuth_rad: float, elevation_rad: float) -> Point:
    """A unit direction; azimuth turns from +X to +Z."""
    level = float(np.cos(elevation_rad))
    return (
        level * float(np.cos(azimuth_rad)),
        float(np.sin(elevation_rad)),
        level * float(np.sin(azimuth_rad)),
    )
