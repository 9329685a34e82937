"""A photo, its light and some objects in; the photo with the objects in it out."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import radians

import numpy as np
from jaxtyping import Float, UInt8

from deeplight.errors import ConfigError
from deeplight.render.composite import Composite, composite, radiance_of
from deeplight.render.ground import Viewpoint
from deeplight.render.look import NO_LOOK, Look, look_of
from deeplight.render.materials import MATERIALS
from deeplight.render.mesh import BUILT_IN, load, standing
from deeplight.render.scene import Colour, Scene, Solid, irradiance_on_plane
from deeplight.render.trace import PREVIEW, Progress, Quality, trace

SPAN = 0.30  # an object's default size: this part of the photo's shorter side
ALBEDO_LIMITS = (0.03, 0.90)  # from fresh asphalt to fresh snow
DEFAULT_ROW = 0.80  # where an object stands, from the top of what the network saw
_PATCH = 0.8  # radius of the surface looked at for its albedo, in sizes of the object


@dataclass(frozen=True)
class Item:
    """One object to put into the photo.

    Attributes:
        object: "bunny", "sphere" or a mesh file.
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
class Settings:
    """How to render and match.

    Attributes:
        quality: rays.
        engine: see `engine.mitsuba`.
        light_from_below: keep the light's lower directions instead of the plane under the object.
        blur, grain: give the objects the photo's.
        seed: of all random numbers.
    """

    quality: Quality = PREVIEW
    engine: str = "auto"
    light_from_below: bool = False
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
    settings: Settings = Settings(),
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
        progress: told (rays done, rays in all).

    Raises:
        InputError: an item, a mesh or a place that cannot be used.
        OSError: a mesh file cannot be read.
    """
    height, width, _ = photo.shape
    if not items or (viewpoint.camera.width, viewpoint.camera.height) != (width, height):
        got = f"{len(items)} objects, a camera of {viewpoint.camera.width} pixels across"
        raise ConfigError(f"an object and a camera of {width} x {height}", got, "correct them")
    solids, notes = placed(viewpoint, items, kept_rows)
    albedo, measured = plane_albedo(photo, light, viewpoint, solids)
    if not np.allclose(albedo, measured, rtol=0.02):
        share = ", ".join(f"{100 * a:.0f}" for a in measured)
        limits = f"{100 * ALBEDO_LIMITS[0]:.0f} to {100 * ALBEDO_LIMITS[1]:.0f} %"
        notes.append(f"the surface would reflect {share} % of the light; limited to {limits}")
    scene = Scene(viewpoint, light, solids, albedo)
    picture = rendered(photo, scene, matched(photo, settings), settings, progress)
    return Composed(picture, scene, tuple(notes))


def placed(
    viewpoint: Viewpoint, items: Sequence[Item], kept_rows: float | None = None
) -> tuple[list[Solid], list[str]]:
    """Load the objects and stand them on the plane; also tell size and distance of each.

    Raises:
        InputError: an item, a mesh or a place that cannot be used.
        OSError: a mesh file cannot be read.
    """
    camera = viewpoint.camera
    solids, notes = [], []
    low = min(kept_rows or camera.height, camera.height) * DEFAULT_ROW
    for number, item in enumerate(items):
        x, y = item.at or (camera.width * (number + 1) / (len(items) + 1), low)
        point = viewpoint.point(x, y)
        size = item.size_m or _default_size(viewpoint, point)
        meshes = standing(load(item.object, item.up), point, size, radians(item.turn_deg))
        solids.append(Solid(meshes, item.material or _own_material(item)))
        away = float(np.linalg.norm(point - [0, viewpoint.height_m, 0]))
        notes.append(f"{item.object}: {size:.3g} m at ({x:.0f}, {y:.0f}), {away:.3g} m away")
    return solids, notes


def matched(photo: UInt8[np.ndarray, "height width 3"], settings: Settings) -> Look:
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
    settings: Settings,
    progress: Progress = lambda done, total: None,
) -> Composite:
    """Render a scene into its photo."""
    below, seed = settings.light_from_below, settings.seed
    layers = trace(scene, settings.quality, settings.engine, below, seed, progress)
    return composite(photo, layers, look, seed=seed)


def plane_albedo(
    photo: UInt8[np.ndarray, "height width 3"],
    light: Float[np.ndarray, "rows columns 3"],
    viewpoint: Viewpoint,
    solids: Sequence[Solid],
) -> tuple[Colour, Colour]:
    """Albedo of the surface the objects stand on, limited; and as measured.

    The median of the photo's own pixels around where they stand, over the light that falls there:
    albedo = pi x radiance / irradiance.
    """
    around = np.concatenate([_footprint(solid) for solid in solids])
    pixels = np.floor(viewpoint.pixels(around))
    height, width, _ = photo.shape
    seen = (pixels >= 0).all(1) & (pixels < [width, height]).all(1)  # false for nan
    columns, rows = pixels[seen].astype(int).T
    patch = photo[rows, columns][None] if len(rows) else photo[-1:, :]
    radiance = np.median(radiance_of(patch)[0], axis=0)
    irradiance = np.maximum(irradiance_on_plane(light, viewpoint), 1e-9)
    measured = np.pi * radiance / irradiance
    return np.clip(measured, *ALBEDO_LIMITS), measured


def _footprint(solid: Solid) -> Float[np.ndarray, "n 3"]:
    """Points of the plane around and below one object, evenly spread over a disc."""
    low, high = solid.vertices.min(0), solid.vertices.max(0)
    number = np.arange(600)
    radius = _PATCH * float((high - low).max()) * np.sqrt((number + 0.5) / 600)
    angle = number * np.pi * (3 - np.sqrt(5))
    disc = np.stack([radius * np.cos(angle), np.zeros(600), radius * np.sin(angle)], -1)
    centre: np.ndarray = (low + high) / 2 * [1, 0, 1]
    return centre + disc


def _default_size(viewpoint: Viewpoint, point: Float[np.ndarray, "3"]) -> float:
    camera = viewpoint.camera
    distance = float(np.linalg.norm(point - [0, viewpoint.height_m, 0]))
    focal_px = camera.height / 2 / camera.tangents[1]
    return SPAN * min(camera.width, camera.height) * distance / focal_px


def _own_material(item: Item) -> str:
    return "diffuse" if item.object in BUILT_IN else "file"
