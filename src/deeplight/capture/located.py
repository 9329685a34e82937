"""What looking for the spheres gives: where they are, or why they were not found."""

from dataclasses import dataclass
from typing import Literal, Self

import numpy as np
from jaxtyping import Float, UInt8

from deeplight.capture.conic import Cone, Ellipse
from deeplight.errors import DataSetError, ShapeError
from deeplight.frames import looking_at, normalised
from deeplight.sphere import SPHERES, Rig, SphereView

PAPER_DIAMETER_M = 0.08  # of `sphere.PAPER_RIG`

Picture = UInt8[np.ndarray, "height width 3"]


@dataclass(frozen=True, eq=False)
class TagRig:
    """A rig with an AprilTag (family 36h11) on its bar.

    Attributes:
        tag_id: which tag.
        tag_size_m: length of the side of its black square.
        centres_m: centre of each sphere, in the tag's frame: origin in the tag's middle, +X to its
            right, +Y to its top, +Z out of its face.
        diameters_m: of each sphere.
    """

    tag_id: int
    tag_size_m: float
    centres_m: dict[str, Float[np.ndarray, "3"]]
    diameters_m: dict[str, float]

    def __post_init__(self) -> None:
        if set(self.centres_m) != set(SPHERES) or set(self.diameters_m) != set(SPHERES):
            raise ShapeError(f"the spheres {SPHERES}", f"{tuple(self.centres_m)}", "name all three")
        if min(self.tag_size_m, *self.diameters_m.values()) <= 0:
            raise ShapeError("sizes above 0", f"{self.tag_size_m}", "give metres")


@dataclass(frozen=True)
class LocateSettings:
    """How to look for the spheres.

    Attributes:
        diameter_m: of the three spheres; gives their distance.
        rig: a rig located before, which is verified, or where the spheres are next to a tag; None
            finds them by what stays in the frame while the world moves.
        name: what the located rig is called.
    """

    diameter_m: float = PAPER_DIAMETER_M
    rig: Rig | TagRig | None = None
    name: str = "located"

    def __post_init__(self) -> None:
        if not 0 < self.diameter_m < 10:
            raise ShapeError(
                "a diameter above 0 and below 10 m", f"{self.diameter_m}", "give metres"
            )


@dataclass(frozen=True, eq=False)
class Located:
    """The three spheres of a clip.

    Attributes:
        rig: the view of each.
        distance_m: from the camera to each centre.
        confidence: how sure place and name of each are, 0 to 1.
        ellipses: the outlines in the full frame.
        warnings: what a person should look at.
        method: what found them.
        overlay: a frame with outlines and names.
    """

    rig: Rig
    distance_m: dict[str, float]
    confidence: dict[str, float]
    ellipses: dict[str, Ellipse]
    warnings: tuple[str, ...]
    method: Literal["flow", "tag", "saved rig"]
    overlay: Picture


class NotLocated(DataSetError):  # noqa: N818 - it is the answer "not located"
    """The spheres of a clip were not found for sure.

    Attributes:
        overlay: the picture that shows why; None where no frame could be read.
    """

    def __init__(self, expected: str, got: str, do: str, overlay: Picture | None = None) -> None:
        self.overlay = overlay
        super().__init__(expected, got, do)

    def __reduce__(self) -> tuple[type[Self], tuple[str, str, str, Picture | None]]:  # type: ignore[override]
        return type(self), (self.expected, self.got, self.do, self.overlay)


def rig_of(cones: dict[str, Cone], name: str) -> Rig:
    """The rig whose spheres are seen in these cones, to a billionth.

    What is finer depends on how a machine adds up, and every worker shall give the same bytes.
    """
    views = {}
    for sphere in SPHERES:
        direction = normalised(cones[sphere].direction.round(9))
        radius_rad = round(float(cones[sphere].angular_radius_rad), 9)
        views[sphere] = SphereView(looking_at(direction), radius_rad)
    return Rig(name, views)


def cones_of(rig: Rig) -> dict[str, Cone]:
    """Where a rig's spheres are seen; the opposite of `rig_of`."""
    return {
        name: Cone(-view.ball_from_camera[2], view.angular_radius_rad)
        for name, view in rig.views.items()
    }


def moved_together(saved: dict[str, Cone], found: dict[str, Cone]) -> dict[str, Cone]:
    """The saved cones after the small move that most of the found ones agree on.

    A rig is rigid, so one outline that went astray does not count.
    """
    shift = np.median([found[n].direction - saved[n].direction for n in saved], axis=0)
    growth = float(
        np.median([found[n].angular_radius_rad / saved[n].angular_radius_rad for n in saved])
    )
    return {
        name: Cone(normalised(cone.direction + shift), cone.angular_radius_rad * growth)
        for name, cone in saved.items()
    }
