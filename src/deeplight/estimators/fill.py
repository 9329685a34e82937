"""Made-up detail for the directions that no photo saw, so that reflections look like a place.

The network's light is smooth. A small library holds how real places differ from their own smooth
light: ratios without lamps, of public-domain panoramas. The place whose smooth light is nearest to
the estimate's is turned to fit, its horizon level, and the estimate multiplied by its ratios; what
that changes at low frequencies is divided out again, so that the light stays the estimate's and
looks like a place.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from io import BytesIO
from typing import Literal, get_args

import numpy as np
from jaxtyping import Float, Float32, Int, UInt8
from PIL import Image

from deeplight.camera_response import LUMINANCE
from deeplight.errors import ConfigError
from deeplight.estimators.projection import ProjectedPhoto
from deeplight.estimators.surroundings import enlarged, hidden_kept
from deeplight.frames import Rotation, turned
from deeplight.mappings import latlong, resample

FILE = "detail.npz"
DETAIL_ROWS = 128
ROWS = 16
"""Rows of the smooth light that places are compared by and that stays the estimate's."""
LARGEST_RATIO = 6.0
"""A detail is at most this much brighter or darker than what lies around it."""
SURE = 0.75
"""From this chance on a photo counts as taken in a room, or as not; chosen on validation places."""
_DARKEST, _BRIGHTEST = 0.02, 20.0  # of the median: beyond it lamps would set the smooth light
_SEEN_COUNTS = 3.0  # what the photo shows counts for more than what is estimated
_COLOUR_COUNTS = 0.5
_STRAY = 1e-4

Kind = Literal["any", "indoor", "outdoor"]
Chosen = Literal["photo", Kind]
"""What the directions that no photo saw are filled with: the photo's own rows going on
(`estimators.continuation`), and over them, unless it is "photo", the detail of a place of the
library. None leaves them smooth."""
Fill = Literal["auto", Chosen]
"""The same, or "auto": the network says of what kind the place is (`chosen`)."""


@dataclass(frozen=True, eq=False)
class LibraryPlace:
    """One panorama of the library.

    Attributes:
        name: of the panorama.
        kind: "indoor" or "outdoor".
        smooth: ln of its light at `ROWS` rows.
        picture: JPEG of ln of its detail's ratio; see `picture_of`.
    """

    name: str
    kind: str
    smooth: Float32[np.ndarray, "rows columns 3"]
    picture: bytes

    def detail(self) -> Float32[np.ndarray, "height width 3"]:
        """ln of its radiance over its smooth light."""
        with Image.open(BytesIO(self.picture)) as picture:
            levels = np.asarray(picture.convert("RGB"), np.float32)
        return ((levels - 128) * (np.log(LARGEST_RATIO) / 127)).astype(np.float32)


def chosen(fill: Fill | None, heads: Mapping[str, float]) -> Chosen | None:
    """What "auto" stands for, by what a network says besides light: "photo" if it is not sure.

    Raises:
        ConfigError: there is no such filling.
    """
    if fill not in (None, *get_args(Fill)):
        raise ConfigError(f"fill of {', '.join(get_args(Fill))} or None", repr(fill), "correct it")
    if fill != "auto":
        return fill
    indoors = heads.get("indoors", 0.5)
    if max(indoors, 1 - indoors) < SURE:
        return "photo"
    return "indoor" if indoors > 0.5 else "outdoor"


def detailed(
    smooth: Float32[np.ndarray, "rows columns 3"],
    photo: ProjectedPhoto,
    level_from_camera: Rotation,
    kind: Kind = "any",
) -> tuple[Float32[np.ndarray, "128 256 3"], str]:
    """Smooth surroundings with the detail of the place that fits them best, and that place's name.

    The smooth light stays, and the power of what the photo does not show, channel by channel. The
    photo only helps to choose: the detail goes over all directions, and the caller puts it back.

    Args:
        smooth: the estimate without its lamps, camera frame.
        photo: what of the place is known.
        level_from_camera: the camera's tilt, so that horizons lie level.
        kind: of place.
    """
    place, columns, flip = best_place(*_level(smooth, photo, level_from_camera), kind)
    detail = _detail_of(place)[:, ::-1] if flip else _detail_of(place)
    detail = np.roll(detail, columns * (DETAIL_ROWS // ROWS), axis=1)
    texels = turned(latlong.directions(DETAIL_ROWS, 2 * DETAIL_ROWS), level_from_camera)
    ratio = resample.sample_latlong(detail, texels)
    plain = enlarged(smooth, DETAIL_ROWS)
    rich = plain * np.exp(ratio, out=ratio)
    before, after = (resample.shrink(v, ROWS, 2 * ROWS) for v in (plain, rich))
    rich *= enlarged(before / np.maximum(after, _STRAY), DETAIL_ROWS)
    return hidden_kept(rich, plain, photo), place.name


@lru_cache(maxsize=4)  # the next photo is often of the same place
def _detail_of(place: LibraryPlace) -> Float32[np.ndarray, "height width 3"]:
    return place.detail()


def _level(
    smooth: Float32[np.ndarray, "height width 3"], photo: ProjectedPhoto, from_camera: Rotation
) -> tuple[Float32[np.ndarray, "16 32 3"], Float32[np.ndarray, "16 32"]]:
    """ln radiance with the photo in it, horizon level, and how much of it is seen."""
    texels = turned(latlong.directions(4 * ROWS, 8 * ROWS), from_camera.T)
    light = resample.sample_latlong(smooth, texels)
    seen = latlong.nearest(photo.seen, texels)
    is_seen = seen > 0
    shown = latlong.nearest(photo.radiance, texels[is_seen])
    light[is_seen] += (shown - light[is_seen]) * seen[is_seen][:, None]
    return smooth_of(light), resample.shrink(seen[..., None], ROWS, 2 * ROWS)[..., 0]


def best_place(
    smooth: Float[np.ndarray, "rows columns 3"],
    seen: Float[np.ndarray, "rows columns"],
    kind: Kind = "any",
) -> tuple[LibraryPlace, int, bool]:
    """The place nearest to a smooth light, by how many columns to turn it, and whether mirrored.

    Nearest is the largest correlation over the sphere, seen directions counting for more. So
    brightness, white balance and contrast do not matter; an estimate has too little of that.
    """
    weight = latlong.solid_angles(ROWS, 2 * ROWS) * (1 + _SEEN_COUNTS * seen)
    weight = (weight / weight.sum()).astype(np.float32)
    wanted = _less_colour(smooth)
    wanted -= (wanted * weight).sum((1, 2), keepdims=True)
    numbers, maps = _maps(kind)
    turns = _turns()
    alike = (maps @ (wanted * weight).reshape(3, -1)[:, turns]).sum(0)
    weights = weight.ravel()[turns]
    spread = (maps**2).sum(0) @ weights - ((maps @ weights) ** 2).sum(0)
    alike /= np.sqrt(np.maximum(spread, 1e-12))
    number, columns = divmod(int(alike.argmax()), 2 * ROWS)
    return library()[numbers[number]], columns, number >= len(numbers) // 2


@lru_cache(maxsize=3)
def _maps(kind: Kind) -> tuple[list[int], Float32[np.ndarray, "3 maps texels"]]:
    """Places by their number in the library, and their smooth light to compare; mirrored ones
    come after all others."""
    numbers = [n for n, place in enumerate(library()) if kind in ("any", place.kind)]
    smooth = np.stack([_less_colour(library()[number].smooth) for number in numbers], axis=1)
    both = np.concatenate([smooth, smooth[..., ::-1]], axis=1)
    return 2 * numbers, both.reshape(3, 2 * len(numbers), -1)


@lru_cache(maxsize=1)
def _turns() -> Int[np.ndarray, "texels turns"]:
    """Where each texel comes to lie when a panorama is turned by each number of columns."""
    row, column, turn = np.ogrid[:ROWS, : 2 * ROWS, : 2 * ROWS]
    at: np.ndarray = row * 2 * ROWS + (column + turn) % (2 * ROWS)
    return at.reshape(-1, 2 * ROWS)


def _less_colour(
    logs: Float32[np.ndarray, "rows columns 3"],
) -> Float32[np.ndarray, "3 rows columns"]:
    """Channels whose sum of squares counts colour less than luminance."""
    luminance = logs.mean(-1, keepdims=True)
    return np.moveaxis(luminance + np.float32(_COLOUR_COUNTS) * (logs - luminance), -1, 0)


def smooth_of(radiance: Float[np.ndarray, "height width 3"]) -> Float32[np.ndarray, "16 32 3"]:
    """ln of a panorama's light at `ROWS` rows, lamps limited."""
    return resample.shrink(_limited_log(radiance), ROWS, 2 * ROWS)


def picture_of(radiance: Float[np.ndarray, "height width 3"]) -> UInt8[np.ndarray, "128 256 3"]:
    """A panorama's detail in 8 bits: 128 is its smooth light, 255 `LARGEST_RATIO` times that."""
    logs = resample.shrink(_limited_log(radiance), DETAIL_ROWS, 2 * DETAIL_ROWS)
    detail = logs - enlarged(resample.shrink(logs, ROWS, 2 * ROWS), DETAIL_ROWS)
    levels = 128 + detail * (127 / np.log(LARGEST_RATIO))
    return np.floor(levels.clip(0, 255) + 0.5).astype(np.uint8)


@lru_cache(maxsize=1)
def library() -> tuple[LibraryPlace, ...]:
    """The places that come with the package; `python -m lab.detail_library` makes them."""
    path = resources.files("deeplight") / "weights" / FILE
    with np.load(BytesIO(path.read_bytes()), allow_pickle=False) as stored:
        ends = np.cumsum(stored["sizes"])
        content = stored["pictures"].tobytes()
        return tuple(
            LibraryPlace(str(name), str(kind), smooth.astype(np.float32), content[end - size : end])
            for name, kind, smooth, size, end in zip(
                *(stored[key] for key in ("names", "kinds", "smooth", "sizes")), ends, strict=True
            )
        )


def _limited_log(
    radiance: Float[np.ndarray, "height width 3"],
) -> Float32[np.ndarray, "height width 3"]:
    median = max(float(np.median(radiance @ LUMINANCE)), 1e-9)
    limited = np.clip(radiance / median, _DARKEST, _BRIGHTEST)
    return np.log(limited).astype(np.float32)
