"""Where and when a photo was taken and which way it looks, as its EXIF data has it.

Read to place the sun, never written to any file.
"""

import struct
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta
from math import log2
from typing import Any, Literal

from deeplight.io.exif import ExifDirectories, number

_LATITUDE, _LONGITUDE, _ALTITUDE_M, _TIME, _HEADING, _DATE = 2, 4, 6, 7, 17, 29
_TAKEN, _OFFSET = 0x9003, 0x9011  # DateTimeOriginal, OffsetTimeOriginal
_EXPOSURE_S, _APERTURE, _ISO = 0x829A, 0x829D, 0x8827
_EXIF_TIME = "%Y:%m:%d %H:%M:%S"


@dataclass(frozen=True)
class Whereabouts:
    """Place, time and heading of a photo; place and heading do not show in its repr.

    Attributes:
        latitude_deg, longitude_deg: north and east are positive.
        altitude_m: above the sea.
        time: in UTC.
        heading_deg: where the camera looks, clockwise from north.
        north: what north that is.
        exposure_value: at ISO 100, log2(aperture^2 / seconds): some 15 in the sun, under 9 in
            rooms; None where the camera does not say.
    """

    latitude_deg: float = field(repr=False)
    longitude_deg: float = field(repr=False)
    altitude_m: float = field(repr=False)
    time: datetime
    heading_deg: float = field(repr=False)
    north: Literal["true", "magnetic"]
    exposure_value: float | None = None


def whereabouts_of(exif: ExifDirectories) -> Whereabouts | None:
    """GPS position, UTC time and GPSImgDirection; None where one is missing or nonsense."""
    try:
        gps, camera = exif.gps, exif.camera
        latitude = _angle(gps[_LATITUDE], gps.get(_LATITUDE - 1, "N"), "S")
        longitude = _angle(gps[_LONGITUDE], gps.get(_LONGITUDE - 1, "E"), "W")
        heading = _known(gps[_HEADING])
        reference = str(gps.get(_HEADING - 1, "T")).strip("\0 ").upper()
        time = _time(gps, camera)
        altitude = number(gps.get(_ALTITUDE_M)) or 0.0
    except (OSError, KeyError, ValueError, TypeError, SyntaxError, ArithmeticError, struct.error):
        return None
    sane = abs(latitude) <= 90 and abs(longitude) <= 180 and 0 <= heading <= 360
    if time is None or not sane or reference not in ("T", "M"):
        return None
    north: Literal["true", "magnetic"] = "true" if reference == "T" else "magnetic"
    height = altitude if abs(altitude) < 9000 else 0.0
    exposure = _exposure_value(camera)
    return Whereabouts(latitude, longitude, height, time, heading, north, exposure)


def _exposure_value(camera: Any) -> float | None:
    """From ExposureTime, FNumber and ISO (APEX); None where one of them is missing."""
    try:
        seconds, aperture = _known(camera[_EXPOSURE_S]), _known(camera[_APERTURE])
        iso = camera[_ISO]
        speed = _known(iso[0] if isinstance(iso, tuple) else iso)
        return log2(aperture**2 / seconds) - log2(speed / 100)
    except (KeyError, ValueError, ArithmeticError, IndexError):
        return None


def _known(value: Any) -> float:
    """The number of an entry.

    Raises:
        ValueError: it is none, or says that it is unknown.
    """
    found = number(value)
    if found is None:
        raise ValueError("no number")
    return found


def _angle(parts: Any, reference: Any, negative: str) -> float:
    """Degrees, minutes and seconds as one signed number of degrees."""
    degrees, minutes, seconds = (_known(part) for part in parts)
    value = degrees + minutes / 60 + seconds / 3600
    return -value if str(reference).strip("\0 ").upper() == negative else value


def _time(gps: Any, camera: Any) -> datetime | None:
    """GPS time, which is UTC; else the camera's clock with its offset from UTC."""
    if _DATE in gps and _TIME in gps:
        day = datetime.strptime(str(gps[_DATE]).strip("\0 "), "%Y:%m:%d").replace(tzinfo=UTC)
        hours, minutes, seconds = (_known(part) for part in gps[_TIME])
        return day + timedelta(hours=hours, minutes=minutes, seconds=seconds)
    if _TAKEN in camera and _OFFSET in camera:
        local = datetime.strptime(str(camera[_TAKEN]).strip("\0 "), _EXIF_TIME)
        sign, hours, minutes = _offset(str(camera[_OFFSET]).strip("\0 "))
        return (local - sign * timedelta(hours=hours, minutes=minutes)).replace(tzinfo=UTC)
    return None


def _offset(text: str) -> tuple[int, int, int]:
    """Sign, hours and minutes of an EXIF offset such as +02:00."""
    if text in ("Z", "z"):
        return 1, 0, 0
    hours, minutes = text[1:].split(":")
    return (-1 if text[0] == "-" else 1), int(hours), int(minutes)
