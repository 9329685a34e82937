"""Make what the page's reading of a photo's EXIF data is checked with.

python tests/golden/make_web_exif.py

Small photos, where up is in them by `io.tilt`, and their field of view by `io.exif`, go to
web/tests/golden/exif.json.
"""

import base64
import io
import json
import struct
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from deeplight.io.exif import exif_directories, exif_of_pillow
from deeplight.io.tilt import tilt_of

FILE = Path(__file__).resolve().parents[2] / "web/tests/golden/exif.json"
HELD = {1: (-0.75, 0.2, 0.6), 3: (0.75, 0.2, 0.6), 6: (0.2, -0.75, 0.6), 8: (0.2, 0.75, 0.6)}
"""Acceleration in g, in the phone's axes, while it looks up, by the orientation of its photo."""

STORED = (24, 16)
"""Width and height of the photos as they are stored."""
CAMERA = {"mm_35": 0xA405, "mm": 0x920A, "per_unit": 0xA20E, "unit": 0xA210, "width": 0xA002}
SENSOR = {"mm": IFDRational(50), "per_unit": IFDRational(2400), "unit": 2, "width": 2048}
"""A 50 mm lens on a sensor of 2,400 pixels an inch."""


def maker_note(acceleration: tuple[float, float, float], order: str = ">") -> bytes:
    """An iPhone's maker note that says how the phone was held, with an entry before that."""
    mark = {">": b"MM", "<": b"II"}[order]
    note = b"Apple iOS\0\0\x01" + mark + struct.pack(f"{order}H", 2)
    note += struct.pack(f"{order}HHIi", 1, 9, 1, 14)
    note += struct.pack(f"{order}HHII", 8, 10, 3, 44) + bytes(4)
    for value in acceleration:
        note += struct.pack(f"{order}ii", round(value * 10_000), 10_000)
    return note


def photo(
    note: bytes | None = None, orientation: int | None = None, elevation: object = None, **more: Any
) -> bytes:
    """A JPEG with these entries, `more` by their numbers in `CAMERA`."""
    exif = Image.Exif()
    if orientation is not None:
        exif[0x0112] = orientation
    numbered = {0x927C: note, 0x9405: elevation} | {CAMERA[name]: more[name] for name in more}
    exif.get_ifd(0x8769).update({tag: it for tag, it in numbered.items() if it is not None})
    file = io.BytesIO()
    Image.new("RGB", STORED).save(file, "JPEG", exif=exif)
    return file.getvalue()


def photos() -> dict[str, bytes]:
    """By name; of some nothing is known."""
    degrees = IFDRational(-25, 2)
    known = photo(elevation=degrees)
    held = HELD[6]
    return {
        **{f"orientation {way}": photo(maker_note(g), way) for way, g in HELD.items()},
        "little-endian note": photo(maker_note(held, "<"), 6),
        "no orientation": photo(maker_note(HELD[1])),
        "elevation": known,
        "elevation above": photo(elevation=IFDRational(20, 1)),
        "floating point, as Pillow writes it": photo(elevation=12.5, mm_35=28.5),
        "unknown elevation": known.replace(struct.pack(">2i", -25, 2), struct.pack(">2i", -25, -1)),
        "steep elevation": photo(elevation=IFDRational(-90, 1)),
        "mirrored, with an elevation": photo(maker_note(held), 2, degrees),
        "shaken": photo(maker_note((0.4, -1.5, 1.2)), 6),
        "lying flat": photo(maker_note((0.1, -0.05, 1.0)), 6),
        "note of another maker": photo(b"Nikon" + maker_note(held)[5:], 6),
        "note cut off": photo(maker_note(held)[:50], 6),
        "nothing": photo(),
        "35 mm equivalent": photo(mm_35=29),
        "35 mm equivalent, on its side": photo(orientation=6, mm_35=29, **SENSOR),
        "sensor": photo(**SENSOR),
        "sensor, on its side": photo(orientation=8, **SENSOR),
        "sensor in centimetres, not made smaller": photo(
            **SENSOR | {"unit": 3, "width": None, "per_unit": IFDRational(9, 2)}
        ),
        "sensor without its unit": photo(**SENSOR | {"unit": None}),
        "sensor in an unknown unit": photo(**SENSOR | {"unit": 9}),
        "no lens is that long": photo(mm_35=60_000),
    }


def golden() -> dict[str, Any]:
    """Each photo as base64, up in it in the camera frame, and its vertical field of view."""
    found = {}
    with TemporaryDirectory() as folder:
        for name, content in photos().items():
            path = Path(folder) / "photo.jpg"
            path.write_bytes(content)
            tilt = tilt_of(exif_directories(path))
            with Image.open(path) as picture:
                exif = exif_of_pillow(picture.getexif)
            width, height = STORED[::-1] if exif.is_on_its_side else STORED
            found[name] = {
                "file": base64.b64encode(content).decode(),
                "width": width,
                "height": height,
                "up": None if tilt is None else tilt.up.tolist(),
                "vertical_fov_rad": exif.vertical_fov_rad(*STORED),
            }
    return found


if __name__ == "__main__":
    FILE.write_text(json.dumps(golden(), indent=1) + "\n", encoding="utf-8")
