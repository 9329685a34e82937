"""A photo, its light and some objects in; the photo with the objects in it out."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import radians

import numpy as np
from jaxtyping import Float, UInt8

from deeplight.compose.composite import Composite, composite
from deeplight.compose.floor import Spot, free_spots
from deeplight.compose.ground import Viewpoint
from deeplight.compose.look import NO_LOOK, Look, look_of
from deeplight.compose.materials import MATERIALS
from deeplight.compose.mesh import BUILT_IN, load, standing
from deeplight.compose.scene import Scene, Solid
from deeplight.compose.surface import ALBEDO_LIMITS, surface_of, texture_of
from deeplight.compose.trace import PREVIEW, Progress, Quality, trace
from deeplight.errors import ConfigError

SPAN = 0.30  # an object's default size: this part of the photo's shorter side
DEFAULT_ROW = 0.80  # where an object stands, from the top of what the network saw
WARNING = "warning: "  # what the notes of a composite begin with that may look absurd
_NOT_FREE = f"{WARNING}no free patch of floor was found: it may stand on something, give --at"
_UNSURE = (
    f"{WARNING}the camera's pitch is unsure, so it may stand on a wall or in the sky: give --pitch"
)


@dataclass(frozen=True)
class Item:
    """One object to put into the photo.

    Attributes:
        object: "bunny", "sphere", "pot" or a mesh file.
        material: of `MATERIALS`; None is the file's own, and diffuse for what is built in.
        at: (x, y) pixel of the photo where it stands; None is the lower middle.
        size_m: its longest side in metres; None makes it 30 % of the photo's shorter side.
        turn_deg: about the vertical, anticlockwise from above.
        up: the file's axis that points up.
    """

    object: str = "bunny"
    material: str | None = None
    at: tuple[float, float] | None = None
    size_m: float | None = None
    turn_deg: float = 0.0
    up: str = "y"

    def __post_init__(self) -> None:
        if self.material not in (None, *MATERIALS):
            expected = f"a material of {', '.join(MATERIALS)}"
            raise ConfigError(expected, f"{self.material}", "choose one of these")
        if self.material == "file" and self.object in BUILT_IN:
            do = "name another material"
            raise ConfigError("a material for a built-in object", "file", do)
        if self.size_m is not None and not 0 < self.size_m < 1e4:
            raise ConfigError("a size in metres above 0", f"{self.size_m}", "correct it")
        if self.up not in ("y", "z"):
            raise ConfigError("an up axis y or z", self.up, "choose one")


@dataclass(frozen=True)
class ComposeSettings:
    """How to render and match.

    Attributes:
        quality: rays.
        engine: see `engine.mitsuba`.
        light_from_below: keep the light's lower directions instead of the plane under the object.
        texture: let objects see the photo's own pixels on the plane, not one colour.
        blur, grain: give the objects the photo's.
        seed: of all random numbers.
    """

    quality: Quality = PREVIEW
    engine: str = "auto"
    light_from_below: bool = False
    texture: bool = True
    blur: bool = True
    grain: bool = True
    seed: int = 0


@dataclass(frozen=True, eq=False)
class Composed:
    """The result and what was decided on the way."""

    composite: Composite
    scene: Scene
    notes: tuple[str, ...] = field(default=())


def compose(
    photo: UInt8[np.ndarray, "height width 3"],
    light: Float[np.ndarray, "rows columns 3"],
    viewpoint: Viewpoint,
    items: Sequence[Item],
    settings: ComposeSettings = ComposeSettings(),
    kept_rows: float | None = None,
    progress: Progress = lambda done, total: None,
) -> Composed:
    """Put objects into a photo under its light.

    Args:
        photo: upright, gamma-encoded.
        light: latlong radiance in the camera frame, relative to the camera's white.
        viewpoint: the camera above the plane; its size must be the photo's.
        items: at least one.
        settings: how.
        kept_rows: lower end of what the network saw; the default place lies above it.
        progress: called with (rays done, rays in all).

    Raises:
        InputError: an item, a mesh or a place that cannot be used.
        OSError: a mesh file cannot be read.
    """
    height, width, _ = photo.shape
    if not items or (viewpoint.camera.width, viewpoint.camera.height) != (width, height):
        got = f"{len(items)} objects, a camera of {viewpoint.camera.width} pixels across"
        raise ConfigError(f"an object and a camera of {width} x {height}", got, "correct them")
    solids, notes = placed(viewpoint, items, kept_rows, photo)
    scene, more_notes = scene_of(photo, light, viewpoint, solids, settings)
    notes += more_notes
    picture = rendered(photo, scene, matched(photo, settings), settings, progress)
    return Composed(picture, scene, tuple(notes))


def placed(
    viewpoint: Viewpoint,
    items: Sequence[Item],
    kept_rows: float | None = None,
    photo: UInt8[np.ndarray, "height width 3"] | None = None,
) -> tuple[list[Solid], list[str]]:
    """Load the objects and stand them on the plane; also give the size and distance of each.

    Those without a place stand where the photo shows free floor near to the usual place.

    Raises:
        InputError: an item, a mesh or a place that cannot be used.
        OSError: a mesh file cannot be read.
    """
    camera = viewpoint.camera
    solids: list[Solid] = []
    low = min(kept_rows or camera.height, camera.height) * DEFAULT_ROW
    places, notes = _places(viewpoint, items, low, photo)
    for item, (x, y) in zip(items, places, strict=True):
        point = viewpoint.point(x, y)
        size = item.size_m or _default_size(viewpoint, point)
        meshes = standing(load(item.object, item.up), point, size, radians(item.turn_deg))
        solids.append(Solid(meshes, item.material or _own_material(item)))
        away = float(np.linalg.norm(point - [0, viewpoint.height_m, 0]))
        notes.append(f"{item.object}: {size:.3g} m at ({x:.0f}, {y:.0f}), {away:.3g} m away")
        if solids[-1].may_hold([0, viewpoint.height_m, 0]):
            notes.append(
                f"{WARNING}the camera may be inside {item.object}: make it smaller (--size)"
            )
        if any(mesh.finish.lost for mesh in meshes):
            notes.append(f"{item.object}: a texture or material could not be read, left out")
        more_notes = sorted({note for mesh in meshes for note in mesh.finish.notes})
        notes += [f"{item.object}: {note}" for note in more_notes]
    return solids, notes


def _places(
    viewpoint: Viewpoint,
    items: Sequence[Item],
    low: float,
    photo: UInt8[np.ndarray, "height width 3"] | None,
) -> tuple[list[tuple[float, float]], list[str]]:
    """Where each item stands, and what to say of it; `low` is the usual row."""
    camera = viewpoint.camera
    count = sum(item.at is None for item in items)
    usual = [(camera.width * (n + 1) / (len(items) + 1), low) for n in range(len(items))]
    places = [item.at or place for item, place in zip(items, usual, strict=True)]
    given = [_UNSURE] if any(i.at and viewpoint.may_be_above(*i.at) for i in items) else []
    if photo is None or not count:
        return places, given
    notes = [f"horizon at row {viewpoint.horizon_row:.0f} of {camera.height}"]
    spots = free_spots(photo, viewpoint, count, low)
    if not all(spot.free for spot in spots):
        unsure = given or [_UNSURE] * (not spots[0].sure)
        return places, [*notes, *(unsure or [_NOT_FREE])]
    notes.append("placed on a free patch of floor; --at puts it elsewhere")
    found = iter(spots)
    return [item.at or _at(next(found)) for item in items], notes + given


def _at(spot: Spot) -> tuple[float, float]:
    return spot.x, spot.y


def scene_of(
    photo: UInt8[np.ndarray, "height width 3"],
    light: Float[np.ndarray, "rows columns 3"],
    viewpoint: Viewpoint,
    solids: Sequence[Solid],
    settings: ComposeSettings,
) -> tuple[Scene, list[str]]:
    """The objects on the photo's own surface, and notes where its albedo had to be limited."""
    surface = surface_of(photo, light, viewpoint, solids)
    notes = []
    if not np.allclose(surface.albedo, surface.measured, rtol=0.02):
        share = ", ".join(f"{100 * a:.0f}" for a in surface.measured)
        limits = f"{100 * ALBEDO_LIMITS[0]:.0f} to {100 * ALBEDO_LIMITS[1]:.0f} %"
        notes.append(f"the surface would reflect {share} % of the light; limited to {limits}")
    texture = texture_of(photo, viewpoint, solids, surface) if settings.texture else None
    return Scene(viewpoint, light, solids, surface.albedo, texture), notes


def matched(photo: UInt8[np.ndarray, "height width 3"], settings: ComposeSettings) -> Look:
    """Measure the part of the photo's look that the settings ask for."""
    if not (settings.blur or settings.grain):
        return NO_LOOK
    look = look_of(photo)
    return Look(
        look.blur_px if settings.blur else NO_LOOK.blur_px,
        look.grain if settings.grain else NO_LOOK.grain,
    )


def rendered(
    photo: UInt8[np.ndarray, "height width 3"],
    scene: Scene,
    look: Look,
    settings: ComposeSettings,
    progress: Progress = lambda done, total: None,
) -> Composite:
    """Render a scene into its photo."""
    below, seed = settings.light_from_below, settings.seed
    layers = trace(scene, settings.quality, settings.engine, below, seed, progress)
    return composite(photo, layers, look, seed=seed)


def _default_size(viewpoint: Viewpoint, point: Float[np.ndarray, "3"]) -> float:
    camera = viewpoint.camera
    distance = float(np.linalg.norm(point - [0, viewpoint.height_m, 0]))
    focal_px = camera.height / 2 / camera.tangents[1]
    return SPAN * min(camera.width, camera.height) * distance / focal_px


def _own_material(item: Item) -> str:
    return "diffuse" if item.object in BUILT_IN else "file"
