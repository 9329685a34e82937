"""The three-sphere rig of a film: where everything is, in metres in the camera frame."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from deeplight.brdf import REFLECTIVITY
from deeplight.camera import PinholeCamera
from deeplight.frames import Rotation, looking_at, normalised, rotation
from deeplight.sphere import PAPER_RIG, SPHERES, SphereView
from lab.film.parts import Ball, Box, Rod, Thing

Point = Float[np.ndarray, "3"]

_UPRIGHT = np.eye(3)
_RADIUS_M, _DISTANCE_M = 0.04, 0.60  # of PAPER_RIG
_BELOW_M = 0.017  # from a sphere's lowest point to the middle of the bar
_BAR_M, _STALK_M, _TAG_M = 0.006, 0.004, 0.013  # radii, and half the plate's side
_TAG_UP_M = 0.02  # above the bar, which is often cut by the frame's lower edge
_METAL, _SKIN, _CLOTH, _PHONE = (0.22,) * 3, (0.38, 0.25, 0.19), (0.10, 0.10, 0.12), (0.03,) * 3


@dataclass(frozen=True, eq=False)
class FilmRig:
    """Spheres, what holds them, and who holds that.

    Attributes:
        name: as the truth calls it.
        centres_m: of the spheres, by name.
        radius_m: of every sphere.
        holder: stalks, bar and arm.
        bystanders: phone, hand and person, which only the spheres see.
        tag_id, plate: the tag on the bar, if there is one.
    """

    name: str
    centres_m: dict[str, Point]
    radius_m: float
    holder: tuple[Thing, ...]
    bystanders: tuple[Thing, ...]
    tag_id: int | None = None
    plate: Thing | None = None

    def view(self, name: str, size: int) -> SphereView:
        """The ideal camera aimed at a sphere."""
        centre = self.centres_m[name]
        angle = float(np.arcsin(self.radius_m / np.linalg.norm(centre)))
        return SphereView(looking_at(centre), angle, size)

    def seen_by(self, name: str) -> list[Thing]:
        """Everything that a sphere can reflect."""
        spheres = [
            Thing(Ball(centre, self.radius_m), other, (REFLECTIVITY[other],) * 3)
            for other, centre in self.centres_m.items()
            if other != name
        ]
        plate = [self.plate] if self.plate else []
        return [*spheres, *self.holder, *plate, *self.bystanders]


def draw_rig(
    rng: np.random.Generator,
    vary: bool = True,
    tag: bool = False,
    off_centre: float = 0.0,
    phone_from_person: Rotation = _UPRIGHT,
) -> FilmRig:
    """A rig as someone might have built it.

    Args:
        rng: decides the order of the materials, the distance and the tilt.
        vary: otherwise it is `PAPER_RIG`.
        tag: with an AprilTag on the bar.
        off_centre: how far to the side it hangs, in half widths of the picture.
        phone_from_person: how the one who holds it stands in the phone's frame.
    """
    order = list(SPHERES)
    directions = [-PAPER_RIG.views[name].ball_from_camera[2] for name in order]
    places = [_DISTANCE_M * direction for direction in directions]
    if vary:
        order = [order[n] for n in rng.permutation(3)]
        places = _drawn_places(rng)
    half_width = 0.42 * abs(places[1][2])
    places = [place + [off_centre * half_width, 0, 0] for place in places]
    centres = dict(zip(order, places, strict=True))
    plate = None
    if tag:
        below = _RADIUS_M + _BELOW_M - _TAG_UP_M
        middle = (places[0] + places[1]) / 2 - [0, below, 0]
        middle = middle + normalised(-middle) * (_BAR_M + 0.001)
        half = np.array([_TAG_M, _TAG_M, 0.001])
        plate = Thing(Box(middle, half, looking_at(middle)), "diffuse", (0.5,) * 3)
    name = "drawn" if vary else PAPER_RIG.name
    tag_id = int(rng.integers(4)) if tag else None
    return FilmRig(
        name, centres, _RADIUS_M, _holder(places), _bystanders(phone_from_person), tag_id, plate
    )


def _drawn_places(rng: np.random.Generator) -> list[Point]:
    """Three places along a straight, slightly tilted bar, left to right."""
    distance = rng.uniform(0.5, 0.7)
    middle = -PAPER_RIG.views["matte_silver"].ball_from_camera[2] + rng.normal(0, 0.006, 3)
    bar = rotation("z", rng.normal(0, 0.02)) @ rotation("y", rng.normal(0, 0.04))[:, 0]
    spacing = distance * 0.219 * rng.uniform(0.95, 1.02)
    return [distance * normalised(middle) + step * spacing * bar for step in (-1, 0, 1)]


def _holder(places: list[Point]) -> tuple[Thing, ...]:
    feet = [place - [0, _RADIUS_M + _BELOW_M, 0] for place in places]
    rods = [Rod(feet[0], feet[1], _BAR_M), Rod(feet[1], feet[2], _BAR_M)]
    tops = [place - [0, 0.9 * _RADIUS_M, 0] for place in places]
    rods += [Rod(top, foot, _STALK_M) for top, foot in zip(tops, feet, strict=True)]
    rods.append(Rod(feet[1], np.array([0.0, -0.13, -0.02]), _BAR_M))
    return tuple(Thing(rod, "diffuse", _METAL) for rod in rods)


def _bystanders(phone_from_person: Rotation) -> tuple[Thing, ...]:
    """Phone, hand and the person who holds it, behind the camera's pinhole."""
    phone = Box(np.array([0.0, -0.05, 0.012]), np.array([0.038, 0.078, 0.004]), np.eye(3))
    hand = Rod(np.array([-0.045, -0.10, 0.03]), np.array([0.045, -0.10, 0.03]), 0.03)
    around = phone_from_person
    arm = Rod(around @ [0.05, -0.13, 0.05], around @ [0.20, -0.40, 0.35], 0.04)
    body = Rod(around @ [0.0, -0.35, 0.45], around @ [0.0, -1.0, 0.40], 0.17)
    head = Ball(around @ [0.0, 0.05, 0.45], 0.10)
    return (
        Thing(phone, "diffuse", _PHONE),
        Thing(hand, "diffuse", _SKIN),
        Thing(arm, "diffuse", _CLOTH),
        Thing(body, "diffuse", _CLOTH),
        Thing(head, "diffuse", _SKIN),
    )


def ellipse_px(
    view: SphereView, camera: PinholeCamera
) -> tuple[tuple[float, float], tuple[float, float], float]:
    """The sphere's outline in the picture: centre (x, y), semi-axes and angle.

    The cone around the sphere's direction, cut by the picture plane. x right and y down, 0.0 at
    the first pixel's centre; the angle is the major axis's, in degrees, anticlockwise from x as
    one sees it.
    """
    axis, cosine = -view.ball_from_camera[2], np.cos(view.angular_radius_rad)
    cone = np.outer(axis, axis) - cosine**2 * np.eye(3)
    focal = camera.height / 2 / camera.tangents[1]
    # Rays through (right, up) of the picture's middle, in pixels: (right, up, -focal).
    conic = cone * np.outer([1, 1, -focal], [1, 1, -focal])
    square, linear, constant = conic[:2, :2], conic[:2, 2], conic[2, 2]
    middle = np.linalg.solve(square, -linear)
    values, vectors = np.linalg.eigh(square / -(constant + linear @ middle))
    axes = 1 / np.sqrt(abs(values))
    major = vectors[:, axes.argmax()]
    angle = float(np.degrees(np.arctan2(major[1], major[0])))
    centre = (
        middle[0] + (camera.width - 1) / 2,
        (camera.height - 1) / 2 - middle[1],
    )
    return (
        (float(centre[0]), float(centre[1])),
        (float(axes.max()), float(axes.min())),
        (angle + 90) % 180 - 90,
    )
