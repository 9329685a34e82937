"""One object in a simulated photo under some light: rendered once, kept by what it is made of."""

import hashlib
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
from PIL import Image

from deeplight.camera import BACKGROUND_FRACTION, PinholeCamera
from deeplight.camera_response import LUMINANCE
from deeplight.compose import (
    compose,
    composite,
    denoise,
    ground,
    look,
    materials,
    mesh,
    scene,
    surface,
    trace,
)
from deeplight.dataset import Example
from deeplight.frames import turned
from deeplight.io.atomic import replacing
from deeplight.simulate.phone import PHONES

STANDS = (0.5, 0.74)  # of the kept photo's width and height
QUALITY = trace.Quality(samples=16, shadow_samples=10, shadow_pixels=16_000, fine=4)
ENGINE = "scalar"  # works everywhere, so that pictures can be kept and compared
LATLONG_HEIGHT = 128
DENOISE_PX = 1.5
ONE_SIDED = 0.15  # a shadow whose centre is nearer to the object, in object sizes, has no side
TILE = (0.10, 0.50, 0.90, 0.82)  # left, top, right, bottom of what a picture of a case shows


@dataclass(frozen=True, eq=False)
class Picture:
    """What is measured of a composite; each over the whole photo.

    Attributes:
        tile: pixels, around the object only.
        object: the object's pixel values, blurred against the noise of few samples.
        cover: share of each pixel that it hides.
        shadow: luminance of the factor on the surface; 1 under the object.
        side: where the shadow lies, seen from the object on the plane, in its sizes; nan if
            nowhere.
    """

    tile: np.ndarray
    object: np.ndarray
    cover: np.ndarray
    shadow: np.ndarray
    side: np.ndarray


def picture(
    folder: Path, example: Example, latlong: np.ndarray, material: str, scale: int, seed: int = 0
) -> Picture:
    """Give the bunny in the photo under a panorama; from `folder` if it was rendered before."""
    photo = full_frame(example, scale)
    height, width, _ = photo.shape
    kept = height * BACKGROUND_FRACTION
    item = compose.Item("bunny", material, (STANDS[0] * width, STANDS[1] * kept), turn_deg=20)
    settings = compose.ComposeSettings(
        QUALITY, ENGINE, texture=False, blur=False, grain=False, seed=seed
    )
    view = viewpoint(example, height, width)
    words = f"{view} {item} {settings} {version('mitsuba')} {SOURCES}"
    meshes = [array for part in mesh.load(item.object) for array in (part.vertices, part.faces)]
    path = folder / f"{_sha256([words.encode(), photo, latlong, *meshes])}.npz"
    if not path.is_file():
        made = _measured(compose.compose(photo, latlong, view, [item], settings), len(photo))
        with replacing(path) as temporary, temporary.open("wb") as file:
            np.savez_compressed(file, **asdict(made))
    with np.load(path, allow_pickle=False) as stored:
        return Picture(**stored)


def full_frame(example: Example, scale: int) -> np.ndarray:
    """The background enlarged, and below it the part of the frame that was cut, continued."""
    background = Image.fromarray(example.background)
    size = (background.width * scale, background.height * scale)
    pixels = np.asarray(background.resize(size, Image.Resampling.BICUBIC))
    rows = round(size[1] / BACKGROUND_FRACTION) - size[1]
    return np.concatenate([pixels, np.repeat(pixels[-1:], rows, axis=0)])


def viewpoint(example: Example, height: int, width: int) -> ground.Viewpoint:
    """The camera as it was held, from the pose the example records.

    A family of phones notes each take's view with the frame; of one phone its name says it.
    """
    details = example.meta.details
    up = np.array(details["world_from_camera"]).T @ [0.0, 1.0, 0.0]
    fov_rad = details.get("view_fov_rad") or PHONES[example.meta.camera].vertical_fov_rad
    camera = PinholeCamera(width, height, fov_rad)
    pitch, roll = float(np.arcsin(-up[2])), float(np.arctan2(up[0], up[1]))
    return ground.Viewpoint(camera, pitch_rad=pitch, roll_rad=roll)


def tile(frame: np.ndarray) -> np.ndarray:
    """The part of a picture around the object."""
    rows, columns = round(len(frame) * BACKGROUND_FRACTION), frame.shape[1]
    left, top, right, bottom = TILE
    across = slice(round(left * columns), round(right * columns))
    return frame[round(top * rows) : round(bottom * rows), across]


def _measured(made: compose.Composed, height: int) -> Picture:
    layers, pixels = made.composite.layers, made.composite.pixels
    both = look.blurred(np.concatenate([layers.radiance, layers.cover[..., None]], -1), DENOISE_PX)
    values = composite.RESPONSE.pixel_from_radiance(both[..., :3] / np.maximum(both[..., 3:], 1e-3))
    factor = np.where(layers.cover > 0, 1.0, layers.shadow @ LUMINANCE)
    over_photo = []
    for values_of_crop, outside in ((values, 0), (layers.cover, 0), (factor, 1)):
        whole = np.full((height, pixels.shape[1], *values_of_crop.shape[2:]), outside, np.float32)
        left, top, right, bottom = layers.crop
        whole[top:bottom, left:right] = values_of_crop
        over_photo.append(whole)
    pixels_over, cover_over, factor_over = over_photo
    return Picture(tile(pixels), pixels_over, cover_over, factor_over, _shadow_side(made))


def _shadow_side(made: compose.Composed) -> np.ndarray:
    layers, view = made.composite.layers, made.scene.viewpoint
    left, top, right, bottom = layers.crop
    rays = turned(view.camera.rays()[top:bottom, left:right], view.world_from_camera)
    down = np.minimum(rays[..., 1:2], -1e-6)
    points = rays * (-view.height_m / down)
    low, high = made.scene.box
    away = (points - (low + high) / 2)[..., [0, 2]] / float((high - low).max())
    lost = np.maximum(1 - layers.shadow @ LUMINANCE, 0) * (layers.cover == 0)
    distance = -view.height_m / down[..., 0]  # a pixel far away covers more ground
    weight = lost * distance**2 / -down[..., 0] * (np.linalg.norm(away, axis=-1) < 3)
    if weight.sum() <= 0:
        return np.full(2, np.nan)
    side = (weight[..., None] * away).sum((0, 1)) / weight.sum()
    return side if np.linalg.norm(side) > ONE_SIDED else np.full(2, np.nan)


def _sha256(parts: list[bytes | np.ndarray]) -> str:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part if isinstance(part, bytes) else np.ascontiguousarray(part).data)
    return digest.hexdigest()


# What renders and measures: with other code, other pictures. Meshes count by themselves. Read once,
# so that a change while a run goes on counts for the next.
_CODE = (compose, composite, denoise, ground, look, materials, scene, surface, trace)
SOURCES = _sha256(
    [Path(str(file)).read_bytes() for file in (__file__, *(m.__file__ for m in _CODE))]
)
