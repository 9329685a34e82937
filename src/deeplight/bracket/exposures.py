"""How much light each photograph of a bracket let in: from its EXIF data, or as given."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from jaxtyping import Float32

from deeplight.errors import ConfigError, ImageFileError
from deeplight.io.exif import Exif, exif_directories, number
from deeplight.io.image_file import opened
from deeplight.io.photo_decoders import MAX_PHOTO_PIXELS
from deeplight.io.photograph import read_photograph
from deeplight.io.radiance import is_floating_point

_SECONDS = (0x829A, "ExposureTime", "Exif:ExposureTime")
_STOP = (0x829D, "FNumber", "Exif:FNumber")
_SENSITIVITY = (0x8827, "Exif:PhotographicSensitivity", "Exif:ISOSpeedRatings")
_BRIGHTER = 1.02  # least factor between neighbouring exposures that counts as growing


@dataclass(frozen=True, eq=False)
class Exposure:
    """One photograph.

    Attributes:
        pixels: values as stored, 0 to 1, upright; linear if `linear`.
        amount: light it let in: seconds times ISO / 100 over the squared f-number.
        focal_px: focal length in pixels, None where EXIF does not say.
    """

    path: Path
    pixels: Float32[np.ndarray, "height width 3"]
    linear: bool
    amount: float
    focal_px: float | None


def read_frames(paths: Sequence[Path], times: Sequence[float] = ()) -> list[Exposure]:
    """Read a bracket, darkest exposure first.

    Args:
        times: exposure of each photo in the order of `paths`, relative or in seconds; left out,
            EXIF says it.

    Raises:
        OSError, ImageFileError: a file cannot be read, or says nothing of its exposure.
        ConfigError: another number of times, photos of several sizes, or ones that do not grow
            brighter with their exposure.
    """
    if times and len(times) != len(paths):
        raise ConfigError(
            f"{len(paths)} exposure times", f"{len(times)}", "give one for each photo"
        )
    if times and min(times) <= 0:
        raise ConfigError("exposure times over 0", f"{min(times)}", "correct it")
    frames = [_frame(path, times[number] if times else None) for number, path in enumerate(paths)]
    shapes = {frame.pixels.shape for frame in frames}
    if len(shapes) > 1:
        got = ", ".join(f"{width} x {height}" for height, width, _ in sorted(shapes))
        raise ConfigError("photos of one size", got, "give one bracket from one camera")
    ordered = sorted(frames, key=lambda frame: frame.amount)
    _check_growing(ordered)
    return ordered


def exposure_amount(path: Path) -> float:
    """Light that a photo let in, from its EXIF data: seconds * ISO / 100 / f-number^2.

    Raises:
        OSError, ImageFileError: it cannot be read, or says nothing of its exposure.
    """
    seconds, stop, iso = (_number(path, *names) for names in (_SECONDS, _STOP, _SENSITIVITY))
    if not seconds > 0:
        do = "give --times, one for each photo"
        raise ImageFileError("an exposure time in the EXIF data", f"{path} without one", do)
    # A lens or sensor that EXIF says nothing of is taken to be the same in all photos.
    return seconds * (iso or 100) / 100 / (stop or 1.0) ** 2


def _number(path: Path, tag: int, *names: str) -> float:
    """An EXIF entry by its tag, or by the name it has in an EXR; 0 where there is none."""
    value = exif_directories(path).camera.get(tag)
    found = number(value[0] if isinstance(value, tuple) and value else value)
    if found is not None:
        return found
    with opened(path, MAX_PHOTO_PIXELS) as file:
        spec = file.spec()
        return max(spec.get_float_attribute(name) for name in names)


def _frame(path: Path, time: float | None) -> Exposure:
    pixels = read_photograph(path, gamma=1)
    amount = exposure_amount(path) if time is None else time
    with opened(path, MAX_PHOTO_PIXELS) as file:
        width, height = file.spec().width, file.spec().height
        linear = is_floating_point(file)
    exif = Exif(
        focal_length_35mm_mm=_number(path, 0xA405, "Exif:FocalLengthIn35mmFilm"),
        focal_length_mm=_number(path, 0x920A, "Exif:FocalLength"),
        focal_plane_x_resolution=_number(path, 0xA20E, "Exif:FocalPlaneXResolution"),
        focal_plane_unit=int(_number(path, 0xA210, "Exif:FocalPlaneResolutionUnit") or 2),
        original_width=int(_number(path, 0xA002, "Exif:PixelXDimension")),
    )
    return Exposure(path, pixels, linear, amount, exif.focal_length_px(width, height))


def _check_growing(frames: Sequence[Exposure]) -> None:
    """Photos whose times were given in another order than the photos do not grow brighter."""
    for darker, brighter in pairwise(frames):
        if brighter.amount < darker.amount * _BRIGHTER:
            got = f"{darker.path.name} and {brighter.path.name} with the same"
            raise ConfigError("photos of different exposures", got, "leave one out")
        low, high = darker.pixels, brighter.pixels
        top = 1.0 if not darker.linear else float(max(low.max(), high.max()))
        usable = (low > 0.02 * top) & (high < 0.97 * top)
        if usable.mean() < 1e-4:
            continue  # nothing is well exposed in both; the merge reports gaps
        if np.median(high[usable] - low[usable]) <= 0:
            got = f"{brighter.path.name}, darker than {darker.path.name}"
            do = "give the times in the order of the photos, or check their EXIF data"
            raise ConfigError("photos that grow brighter with their exposure", got, do)
