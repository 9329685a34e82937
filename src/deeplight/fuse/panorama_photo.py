"""A phone's own panorama as views: equirectangular or cylindrical.

GPano metadata say which, and how much of the sphere it shows. An iPhone writes none: its EXIF data
say only that it is a panorama (CustomRendered 6). It is a cylinder swept with the phone held
upright, as high as the long side of an ordinary picture; that gives its width in degrees. One that
is taller than wide was swept from the floor upwards, the phone lying: the same cylinder, turned.

What such a picture shows is cut into ordinary pictures whose rotations are exact, because the
network and everything else here work on pictures of an ordinary camera.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from math import atan, ceil, pi, radians, tan
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import UInt8

from deeplight.camera import TRAINED_VERTICAL_FOV_RAD, PinholeCamera
from deeplight.errors import ImageFileError
from deeplight.frames import Rotation, rotation, turned, world_from_camera
from deeplight.io.exif import DIAGONAL_35MM_MM, exif_directories, number

PROJECTIONS = ("equirectangular", "cylindrical")
_LOOKED_AT = 2**18  # bytes of a file in which XMP data are looked for
_NUMBER = rb'GPano:%s(?:="|>)\s*([-\w.]+)'
_VIEW_ROWS, _STEP_RAD = 384, radians(30)
_LEAST_SHOWN = 0.99  # of a view's pixels that the panorama must show
_WIDEST = TRAINED_VERTICAL_FOV_RAD
_CUSTOM_RENDERED, _FOCAL_35MM = 0xA401, 0xA405
_IS_PANORAMA = 6  # Apple's value of CustomRendered; the standard has 0 and 1
_USUAL_35MM = 26.0  # of phones' main cameras
_LONG_SIDE = 0.8  # of a 4:3 picture's diagonal
_STANDING = rotation("z", -pi / 2)  # what stands from the same picture lying on its left side


@dataclass(frozen=True)
class PanoramaFacts:
    """What GPano metadata say.

    Attributes:
        projection: of `PROJECTIONS`.
        full_width, full_height: of the whole sphere, pixels.
        left, top: where the picture lies in it.
    """

    projection: str
    full_width: int
    full_height: int
    left: int
    top: int


def is_panorama(path: Path) -> bool:
    """Whether a photo's metadata call it a panorama."""
    return _value(path, b"ProjectionType") in PROJECTIONS or _swept_35mm(path) is not None


def panorama_notes(path: Path, height: int, width: int) -> tuple[str, ...]:
    """What had to be assumed of a panorama of this size."""
    if _value(path, b"ProjectionType") in PROJECTIONS:
        return ()
    if _swept_35mm(path) is None:
        return ("twice as wide as high: taken for a whole sphere, equirectangular",)
    across, along = sorted((height, width))
    degrees = 360 * along / _facts(path, across, along).full_width
    side = "high" if height > width else "wide"
    return (f"panorama without GPano data: taken for a cylinder {degrees:.0f} degrees {side}",)


def _swept_35mm(path: Path) -> float | None:
    """The 35 mm focal length of a panorama swept by an iPhone, None if the photo is none."""
    camera = exif_directories(path).camera
    if number(camera.get(_CUSTOM_RENDERED)) != _IS_PANORAMA:
        return None
    return number(camera.get(_FOCAL_35MM)) or _USUAL_35MM


def panorama_frames(
    path: Path, pixels: UInt8[np.ndarray, "rows columns 3"]
) -> Iterator[tuple[UInt8[np.ndarray, "height width 3"], float, Rotation]]:
    """Cut a panorama into pictures: pixels, vertical field of view, world_from_camera.

    Args:
        path: for its metadata.
        pixels: what the file shows, upright.

    Raises:
        OSError, ImageFileError: its metadata cannot be read, or contradict it.
    """
    if _value(path, b"ProjectionType") not in PROJECTIONS and pixels.shape[0] > pixels.shape[1]:
        for view, fov, turn in panorama_frames(path, np.rot90(pixels)):
            upright, rows = np.ascontiguousarray(np.rot90(view, -1)), len(view)
            height = 2 * atan(tan(fov / 2) * len(upright) / rows)
            yield upright, height, _STANDING @ turn @ _STANDING.T
        return
    facts = _facts(path, *pixels.shape[:2])
    finest = round(_VIEW_ROWS * 2 * pi / TRAINED_VERTICAL_FOV_RAD)
    if facts.full_width > finest:  # averaged first, so that looking up leaves nothing out
        scale = finest / facts.full_width
        size = (max(1, round(pixels.shape[1] * scale)), max(1, round(pixels.shape[0] * scale)))
        pixels = np.asarray(
            cv2.resize(np.ascontiguousarray(pixels), size, interpolation=cv2.INTER_AREA)
        )
        facts = _facts(path, *pixels.shape[:2])
    around = ceil(2 * pi / _STEP_RAD)
    found = False
    rings = ((0.0, radians(20)), (radians(42), _WIDEST), (radians(-42), _WIDEST))
    poles = ((pi / 2, _WIDEST), (-pi / 2, _WIDEST))
    for pitch, narrowest in (*rings, *poles):
        for k in range(1 if abs(pitch) == pi / 2 else around):
            turn = world_from_camera(-2 * pi * k / around, pitch)
            for fov in np.arange(_WIDEST, narrowest - 1e-6, -radians(8)):
                camera = PinholeCamera(_VIEW_ROWS * 9 // 16, _VIEW_ROWS, float(fov))
                view, shown = _cut(pixels, facts, camera, turn)
                if shown >= _LEAST_SHOWN:
                    found = True
                    yield view, camera.vertical_fov_rad, turn
                    break
    if not found:
        got = f"{path}, which shows less than one view"
        raise ImageFileError("a panorama wider than a photo", got, "give it as a plain photo")


def _facts(path: Path, height: int, width: int) -> PanoramaFacts:
    projection, focal_35mm = _value(path, b"ProjectionType"), _swept_35mm(path)
    if projection not in PROJECTIONS and focal_35mm is not None:
        focal = height * focal_35mm / (_LONG_SIDE * DIAGONAL_35MM_MM)
        whole = max(width, round(2 * pi * focal))
        return PanoramaFacts("cylindrical", whole, height, (whole - width) // 2, 0)
    return _gpano(path, height, width, projection or "equirectangular")


def _gpano(path: Path, height: int, width: int, projection: str) -> PanoramaFacts:
    def entry(name: bytes, default: int) -> int:
        text = _value(path, name)
        try:
            return default if text is None else int(float(text))
        except ValueError:
            return default

    own_width = entry(b"CroppedAreaImageWidthPixels", width)
    own_height = entry(b"CroppedAreaImageHeightPixels", height)
    whole = entry(b"FullPanoWidthPixels", own_width)
    high = entry(b"FullPanoHeightPixels", whole // 2)
    left = entry(b"CroppedAreaLeftPixels", (whole - own_width) // 2)
    top = entry(b"CroppedAreaTopPixels", (high - own_height) // 2)
    # A picture made smaller later keeps the numbers of the original.
    scale = width / max(1, own_width)
    facts = PanoramaFacts(projection, *(round(scale * n) for n in (whole, high, left, top)))
    fits = facts.full_width >= width > 0 and facts.full_height > 0 and facts.left >= 0
    if not fits or facts.left + width > facts.full_width + 1:
        got = f"{path} of {width} x {height} pixels in {facts}"
        raise ImageFileError("GPano metadata that fit the picture", got, "correct or remove them")
    return facts


def _cut(
    panorama: UInt8[np.ndarray, "height width 3"],
    facts: PanoramaFacts,
    camera: PinholeCamera,
    turn: Rotation,
) -> tuple[UInt8[np.ndarray, "h w 3"], float]:
    """What a camera would show of the panorama, and the share of its pixels that it does show."""
    rays = turned(camera.rays(), turn)
    column = (np.arctan2(rays[..., 0], -rays[..., 2]) / (2 * pi) + 0.5) * facts.full_width
    if facts.projection == "cylindrical":
        focal = facts.full_width / (2 * pi)
        slope = rays[..., 1] / np.maximum(np.hypot(rays[..., 0], rays[..., 2]), 1e-9)
        row = facts.full_height / 2 - focal * slope
    else:
        row = np.arccos(np.clip(rays[..., 1], -1, 1)) / pi * facts.full_height
    column, row = column - facts.left - 0.5, row - facts.top - 0.5
    height, width, _ = panorama.shape
    shown = (row > -1) & (row < height) & (column > -1) & (column < width)
    pixels = cv2.remap(
        np.ascontiguousarray(panorama),
        column.astype(np.float32),
        row.astype(np.float32),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.asarray(pixels), float(shown.mean())


def _value(path: Path, name: bytes) -> str | None:
    with path.open("rb") as file:
        start = file.read(_LOOKED_AT)
    found = re.search(_NUMBER % name, start)
    return found.group(1).decode("ascii", "replace").lower() if found else None
