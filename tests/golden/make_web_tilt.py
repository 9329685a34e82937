"""Make what the page's reading of a photo's tilt is checked with.

python tests/golden/make_web_tilt.py

Small photos with tilts in their EXIF data, and where up is in them by `io.tilt`, go to
web/tests/golden/tilt.json.
"""

import base64
import io
import json
import struct
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from PIL import Image, TiffImagePlugin

from deeplight.io.tilt import tilt_of

FILE = Path(__file__).resolve().parents[2] / "web/tests/golden/tilt.json"
HELD = {1: (-0.75, 0.2, 0.6), 3: (0.75, 0.2, 0.6), 6: (0.2, -0.75, 0.6), 8: (0.2, 0.75, 0.6)}
"""Acceleration in g, in the phone's axes, while it looks up, by the orientation of its photo."""


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
    note: bytes | None = None, orientation: int | None = None, elevation: object = None
) -> bytes:
    """A JPEG with these entries."""
    exif = Image.Exif()
    camera = exif.get_ifd(0x8769)
    if orientation is not None:
        exif[0x0112] = orientation
    if note is not None:
        camera[0x927C] = note
    if elevation is not None:
        camera[0x9405] = elevation
    file = io.BytesIO()
    Image.new("RGB", (8, 8)).save(file, "JPEG", exif=exif)
    return file.getvalue()


def photos() -> dict[str, bytes]:
    """By name; of some nothing is known."""
    degrees = TiffImagePlugin.IFDRational(-25, 2)
    known = photo(elevation=degrees)
    held = HELD[6]
    return {
        **{f"orientation {way}": photo(maker_note(g), way) for way, g in HELD.items()},
        "little-endian note": photo(maker_note(held, "<"), 6),
        "no orientation": photo(maker_note(HELD[1])),
        "elevation": known,
        "elevation above": photo(elevation=TiffImagePlugin.IFDRational(20, 1)),
        "unknown elevation": known.replace(struct.pack(">2i", -25, 2), struct.pack(">2i", -25, -1)),
        "steep elevation": photo(elevation=TiffImagePlugin.IFDRational(-90, 1)),
        "mirrored, with an elevation": photo(maker_note(held), 2, degrees),
        "shaken": photo(maker_note((0.4, -1.5, 1.2)), 6),
        "lying flat": photo(maker_note((0.1, -0.05, 1.0)), 6),
        "note of another maker": photo(b"Nikon" + maker_note(held)[5:], 6),
        "note cut off": photo(maker_note(held)[:50], 6),
        "nothing": photo(),
    }


def golden() -> dict[str, Any]:
    """Each photo as base64, and up in it in the camera frame."""
    found = {}
    with TemporaryDirectory() as folder:
        for name, content in photos().items():
            path = Path(folder) / "photo.jpg"
            path.write_bytes(content)
            tilt = tilt_of(path)
            up = None if tilt is None else tilt.up.tolist()
            found[name] = {"file": base64.b64encode(content).decode(), "up": up}
    return found


if __name__ == "__main__":
    FILE.write_text(json.dumps(golden(), indent=1) + "\n", encoding="utf-8")
