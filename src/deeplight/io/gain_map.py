"""Gain-map JPEG ("Ultra HDR" 1.0): an ordinary JPEG with a second one that says how much brighter.

https://developer.android.com/media/platform/hdr-image-format. The container is written here, since
the libraries for it clip at 49 times white, and the sun is far above that.
"""

import io
import struct
from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8
from PIL import Image

from deeplight.io.atomic import replacing
from deeplight.io.colour import srgb_decode, srgb_encode

OFFSET = 1 / 64
QUALITY = 95
_XMP = b"http://ns.adobe.com/xap/1.0/\0"
_PACKET = (
    '<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF'
    ' xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description'
    ' xmlns:hdrgm="http://ns.adobe.com/hdr-gain-map/1.0/" hdrgm:Version="1.0"{}'
    "</rdf:Description></rdf:RDF></x:xmpmeta>"
)
_DIRECTORY = (
    ' xmlns:Container="http://ns.google.com/photos/1.0/container/"'
    ' xmlns:Item="http://ns.google.com/photos/1.0/container/item/"><Container:Directory><rdf:Seq>'
    '<rdf:li rdf:parseType="Resource"><Container:Item Item:Semantic="Primary"'
    ' Item:Mime="image/jpeg"/></rdf:li><rdf:li rdf:parseType="Resource"><Container:Item'
    ' Item:Semantic="GainMap" Item:Mime="image/jpeg" Item:Length="{}"/></rdf:li></rdf:Seq>'
    "</Container:Directory>"
)
_MPF_BYTES = 90  # of the whole segment for two pictures


def write_gain_map_jpeg(path: Path | str, radiance: Float[np.ndarray, "height width 3"]) -> None:
    """Write radiance as a picture clipped at 1.0 (white) with its gain map, whole or not at all.

    Gains are 8 bits over the picture's range of stops: with a sun of 100,000 they step by 5 %, and
    JPEG adds its own few percent; for exact light use .exr.

    Raises:
        OSError: the file cannot be written.
    """
    base = _jpeg(np.round(srgb_encode(np.clip(radiance, 0, 1)) * 255).astype(np.uint8))
    shown = srgb_decode(np.asarray(Image.open(io.BytesIO(base)), np.float32) / 255)
    stops = np.log2((np.maximum(radiance, 0) + OFFSET) / (shown + OFFSET))
    least, most = float(stops.min()), max(float(stops.max()), float(stops.min()) + 1e-3)
    gains = np.round((stops - least) / (most - least) * 255).astype(np.uint8)
    facts = {
        "GainMapMin": least,
        "GainMapMax": most,
        "Gamma": 1.0,
        "OffsetSDR": OFFSET,
        "OffsetHDR": OFFSET,
        "HDRCapacityMin": 0.0,
        "HDRCapacityMax": max(most, 1e-3),
    }
    attributes = "".join(f' hdrgm:{name}="{value:.6f}"' for name, value in facts.items())
    second = _with_segments(
        _jpeg(gains), _xmp(_PACKET.format(f'{attributes} hdrgm:BaseRenditionIsHDR="False">'))
    )
    with replacing(path) as temporary:
        temporary.write_bytes(_joined(base, second))


def _joined(base: bytes, second: bytes) -> bytes:
    """Both JPEGs in one file, the first with the directory that names the second."""
    xmp = _xmp(_PACKET.format(_DIRECTORY.format(len(second))))
    size = len(base) + len(xmp) + _MPF_BYTES
    header_at = 2 + len(xmp) + 8  # SOI, XMP, then marker, length and "MPF\0"
    entries = struct.pack(">IIIHH", 0x030000, size, 0, 0, 0)
    entries += struct.pack(">IIIHH", 0, len(second), size - header_at, 0, 0)
    fields = struct.pack(">HHI4s", 0xB000, 7, 4, b"0100")
    fields += struct.pack(">HHII", 0xB001, 4, 1, 2)
    fields += struct.pack(">HHII", 0xB002, 7, len(entries), 50)
    mpf = b"MPF\0MM\0*" + struct.pack(">IH", 8, 3) + fields + struct.pack(">I", 0) + entries
    return _with_segments(base, xmp + _segment(0xE2, mpf)) + second


def _with_segments(jpeg: bytes, segments: bytes) -> bytes:
    return jpeg[:2] + segments + jpeg[2:]


def _xmp(packet: str) -> bytes:
    return _segment(0xE1, _XMP + packet.encode())


def _segment(marker: int, content: bytes) -> bytes:
    return struct.pack(">BBH", 0xFF, marker, len(content) + 2) + content


def _jpeg(pixels: UInt8[np.ndarray, "height width 3"]) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(pixels).save(buffer, "JPEG", quality=QUALITY, subsampling=0)
    return buffer.getvalue()
