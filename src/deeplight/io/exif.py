"""What a photo's EXIF data says about its camera: orientation and field of view."""

import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Shaped
from PIL import Image

from deeplight.io.heif_boxes import read_header
from deeplight.io.image_file import first_bytes

DIAGONAL_35MM_MM = math.hypot(36, 24)
"""Diagonal of 35 mm film, 43.27 mm: what "35 mm equivalent" compares (CIPA DCG-001)."""

PLAUSIBLE_FOV_RAD = (math.radians(3), math.radians(150))
CAMERA, GPS, INTEROPERABILITY = 0x8769, 0x8825, 0xA005
"""Pillow's numbers of EXIF's directories."""

MAKE, MODEL = 0x010F, 0x0110
MAX_NAME = 100  # letters of a make or model that are looked at

MM_PER_UNIT = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}  # FocalPlaneResolutionUnit


@dataclass(frozen=True)
class Exif:
    """The EXIF entries that lighting needs; 0 or None where the file says nothing.

    Attributes:
        orientation: 1 to 8, how to turn the stored rows and columns upright.
        focal_length_35mm_mm: FocalLengthIn35mmFilm.
        focal_length_mm: FocalLength, the real one.
        focal_plane_x_resolution: sensor pixels per unit along the stored rows.
        focal_plane_unit: 2 inch, 3 cm, 4 mm, 5 um.
        original_width: PixelXDimension, the stored width when the resolution was written.
        is_adobe_rgb: the camera was set to Adobe RGB (DCF's optional colour space, "R03").
        camera: make and model, see `camera_name`.
        directories: all that was read; None where not all was.
    """

    orientation: int = 1
    focal_length_35mm_mm: float = 0.0
    focal_length_mm: float = 0.0
    focal_plane_x_resolution: float = 0.0
    focal_plane_unit: int = 2
    original_width: int = 0
    is_adobe_rgb: bool = False
    camera: str = ""
    directories: "ExifDirectories | None" = field(default=None, repr=False, compare=False)

    def focal_length_px(self, stored_width: int, stored_height: int) -> float | None:
        """Give the focal length in pixels of the stored picture, None where EXIF does not say.

        The 35 mm figure compares diagonals, so it needs no care for orientation or aspect.
        """
        if self.focal_length_35mm_mm > 0:
            diagonal = math.hypot(stored_width, stored_height)
            return self.focal_length_35mm_mm / DIAGONAL_35MM_MM * diagonal
        unit_mm = MM_PER_UNIT.get(self.focal_plane_unit)
        if unit_mm and self.focal_length_mm > 0 and self.focal_plane_x_resolution > 0:
            # A picture made smaller later keeps the resolution of the original.
            shrunk = stored_width / self.original_width if self.original_width > 0 else 1.0
            return self.focal_length_mm * self.focal_plane_x_resolution / unit_mm * shrunk
        return None

    @property
    def is_on_its_side(self) -> bool:
        """Whether stored rows are columns of the upright photo."""
        return self.orientation in (5, 6, 7, 8)

    def vertical_fov_rad(self, stored_width: int, stored_height: int) -> float | None:
        """Give the upright picture's vertical field of view, None if unknown or implausible."""
        focal = self.focal_length_px(stored_width, stored_height)
        if focal is None or not math.isfinite(focal):
            return None
        upright_height = stored_width if self.is_on_its_side else stored_height
        fov = 2 * math.atan(upright_height / 2 / focal)
        return fov if PLAUSIBLE_FOV_RAD[0] <= fov <= PLAUSIBLE_FOV_RAD[1] else None


def camera_name(make: Any, model: Any) -> str:
    """One name of a camera, "Apple iPhone 12", from two entries that may be anything.

    Some makers repeat their name in the model; it is given once.
    """
    first, second = (
        " ".join(str(value or "").replace("\0", " ").split())[:MAX_NAME] for value in (make, model)
    )
    repeated = second.casefold().startswith(first.casefold())
    return second if repeated else f"{first} {second}".strip()


def number(value: Any) -> float | None:
    """The one finite number of an EXIF entry of any type; None if it is none, several or unknown.

    Writers put texts ("n/a"), empty fractions and lists where the standard has a number; a fraction
    of FFFFFFFF parts is its word for unknown (CIPA DC-008).
    """
    if isinstance(value, tuple | list) and len(value) == 1:
        (value,) = value
    if isinstance(value, bytes):
        is_byte = len(value) == 1 and not value.isdigit()  # a number in the type of one byte
        value = value[0] if is_byte else value.rstrip(b"\0 ").decode("latin-1")
    if getattr(value, "denominator", 1) in (0xFFFFFFFF, -1):
        return None
    try:
        found = float(value)
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        return None
    return found if math.isfinite(found) else None


@dataclass(frozen=True)
class ExifDirectories:
    """All that a photo's EXIF data say, by the entries' numbers; empty where they say nothing.

    Attributes:
        main: the picture itself; orientation is the camera's, even where a HEIC's boxes replace it.
        camera: how it was taken.
        gps: where and which way.
    """

    main: Mapping[int, Any] = field(default_factory=dict)
    camera: Mapping[int, Any] = field(default_factory=dict)
    gps: Mapping[int, Any] = field(default_factory=dict)


def exif_directories(path: Path) -> ExifDirectories:
    """The EXIF entries of a photo in any format, read while its file is open: Pillow reads a
    TIFF's directories when they are asked for, and HEIC not at all.

    A file that cannot be read has none: whoever needs its pixels is given what is wrong with it.
    """
    try:
        with warnings.catch_warnings(action="ignore"):
            if first_bytes(path)[4:8] == b"ftyp" and not read_header(path).is_av1:
                import pillow_heif

                return _directories(exif_of_bytes(pillow_heif.open_heif(path).info.get("exif")))
            with Image.open(path) as picture:
                return _directories(picture.getexif())
    except Exception:  # Pillow's parsers have no common error
        return ExifDirectories()


def exif_of_bytes(content: bytes | None) -> Image.Exif:
    """Pillow's entries of an EXIF block; none of None."""
    exif = Image.Exif()
    exif.load(content or b"")
    return exif


def _directories(tags: Image.Exif) -> ExifDirectories:
    return ExifDirectories(dict(tags), entries_of(tags, CAMERA), entries_of(tags, GPS))


def _all_of(tags: Image.Exif) -> ExifDirectories | None:
    """All directories; None if an entry nobody asked for cannot be read."""
    try:
        with warnings.catch_warnings(action="ignore"):
            return _directories(tags)
    except Exception:  # as above
        return None


def entries_of(tags: Image.Exif, directory: int) -> dict[int, Any]:
    """The entries of one directory; none if it cannot be read."""
    try:
        with warnings.catch_warnings(action="ignore"):
            return dict(tags.get_ifd(directory))
    except Exception:  # Pillow's parsers have no common error
        return {}


def exif_of_pillow(load: Callable[[], Image.Exif]) -> Exif:
    """Read the entries through Pillow; EXIF that it cannot read is no EXIF.

    Args:
        load: gives Pillow's EXIF; called here, where its failures are expected.
    """
    try:
        with warnings.catch_warnings(action="ignore"):
            tags = load()
            orientation = number(tags.get(0x0112))
    except Exception:  # as above; a photo is worth more than its EXIF
        return Exif()
    camera = entries_of(tags, CAMERA)
    interoperability = str(entries_of(tags, INTEROPERABILITY).get(1, ""))
    return Exif(
        orientation=int(orientation or 1),
        focal_length_35mm_mm=number(camera.get(0xA405)) or 0.0,
        focal_length_mm=number(camera.get(0x920A)) or 0.0,
        focal_plane_x_resolution=number(camera.get(0xA20E)) or 0.0,
        focal_plane_unit=int(number(camera.get(0xA210)) or 2),
        original_width=int(number(camera.get(0xA002)) or 0),
        is_adobe_rgb=interoperability.startswith("R03"),
        camera=camera_name(tags.get(MAKE), tags.get(MODEL)),
        directories=_all_of(tags),
    )


def upright(
    stored: Shaped[np.ndarray, "stored_height stored_width *channels"], orientation: int
) -> Shaped[np.ndarray, "height width *channels"]:
    """Turn stored pixels upright by EXIF orientation 1 to 8; other values change nothing.

    Returns:
        A view: turning 12 megapixels for real would cost more than decoding them did.
    """
    turned = stored.swapaxes(0, 1) if orientation in (5, 6, 7, 8) else stored
    if orientation in (3, 4, 7, 8):
        turned = turned[::-1]
    if orientation in (2, 3, 6, 7):
        turned = turned[:, ::-1]
    return turned
