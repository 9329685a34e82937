"""Made-up detail for the directions that no photo saw, so that reflections look like a place.

The network's light is smooth. A small library holds how real places differ from their own smooth
light: ratios without lamps, of public-domain panoramas. The place whose smooth light is nearest to
the estimate's is turned to fit, and the estimate multiplied by its ratios; what that changes at low
frequencies is divided out again, so that the light stays the estimate's and looks like a place.
"""

from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from io import BytesIO
from typing import Literal

import numpy as np
from jaxtyping import Float, Float32, UInt8
from PIL import Image

from deeplight.camera_response import LUMINANCE
from deeplight.estimators.surroundings import enlarged, kept_power, power_of
from deeplight.mappings import latlong, resample

FILE = "detail.npz"
DETAIL_ROWS = 128
ROWS = 16
"""Rows of the smooth light that places are compared by and that stays the estimate's."""
LARGEST_RATIO = 6.0
"""A detail is at most this much brighter or darker than what lies around it."""
_DARKEST, _BRIGHTEST = 0.02, 20.0  # of the median: beyond it lamps would set the smooth light
_SEEN_COUNTS = 3.0  # what the photo shows counts for more than what is estimated
_COLOUR_COUNTS = 0.5
_STRAY = 1e-4

Kind = Literal["any", "indoor", "outdoor"]
Fill = Literal["photo", Kind]
"""What the directions that no photo saw are filled with: the photo's own rows going on
(`estimators.continuation`), or a place of the library. None leaves them smooth."""


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


def filled(
    rest: Float32[np.ndarray, "height width 3"],
    seen: Float32[np.ndarray, "height width"],
    kind: Kind = "any",
) -> tuple[Float32[np.ndarray, "height width 3"], str]:
    """A smooth panorama with the detail of the place that fits it best, and that place's name.

    Power and smooth light are kept, channel by channel. What the photo shows only helps to choose:
    the detail goes over all directions, and the caller puts the photo back.

    Args:
        rest: the estimate without its lamps, the photo in it.
        seen: what of it the photo shows.
        kind: of place; the smooth light alone says it of seven photos in ten only.
    """
    shown = resample.shrink(seen[..., None], ROWS, 2 * ROWS)
    place, columns, flip = best_place(smooth_of(rest), shown, kind)
    detail = place.detail()[:, ::-1] if flip else place.detail()
    detail = np.roll(detail, columns * (DETAIL_ROWS // ROWS), axis=1)
    height = len(rest)
    ratio = np.exp(enlarged(detail, height) if height >= DETAIL_ROWS else _reduced(detail, height))
    rich = rest * ratio.astype(np.float32)
    before, after = (resample.shrink(v, ROWS, 2 * ROWS) for v in (rest, rich))
    rich *= enlarged((before / np.maximum(after, _STRAY)).astype(np.float32), height)
    return kept_power(rich, power_of(rest)), place.name


def best_place(
    smooth: Float[np.ndarray, "rows columns 3"],
    seen: Float[np.ndarray, "rows columns 1"],
    kind: Kind = "any",
) -> tuple[LibraryPlace, int, bool]:
    """The place nearest to a smooth light, by how many columns to turn it, and whether mirrored."""
    weight = latlong.solid_angles(ROWS, 2 * ROWS)[..., None] * (1 + _SEEN_COUNTS * seen)
    wanted = _comparable(smooth, weight)
    best: tuple[float, LibraryPlace, int, bool] | None = None
    for place in library():
        if kind not in ("any", place.kind):
            continue
        for flip in (False, True):
            own = place.smooth[:, ::-1] if flip else place.smooth
            for columns in range(2 * ROWS):
                turned = _comparable(np.roll(own, columns, axis=1), weight)
                off = float((((turned - wanted) ** 2) * weight).sum())
                if best is None or off < best[0]:
                    best = off, place, columns, flip
    assert best is not None, "a library has places"
    return best[1:]


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


def _comparable(
    smooth: Float[np.ndarray, "rows columns 3"], weight: Float[np.ndarray, "rows columns 1"]
) -> Float[np.ndarray, "rows columns 3"]:
    """Luminance and colour apart, without the mean and of one length.

    Brightness, white balance and contrast do not matter then; an estimate has too little of that.
    """
    centred = smooth - (smooth * weight).sum((0, 1)) / weight.sum()
    luminance = centred.mean(-1, keepdims=True)
    both = luminance + _COLOUR_COUNTS * (centred - luminance)
    result: np.ndarray = both / max(float(np.sqrt((both**2 * weight).sum())), 1e-9)
    return result


def _reduced(
    detail: Float32[np.ndarray, "height width 3"], height: int
) -> Float32[np.ndarray, "rows columns 3"]:
    return resample.shrink(detail, height, 2 * height).astype(np.float32)
