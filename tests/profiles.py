"""Small ICC profiles, built here byte by byte so that tests need no files of others."""

import struct

import numpy as np

from deeplight.io.colour import BT709, bt709_from_primaries

XYZ_D50_FROM_BT709 = np.array(  # ICC's sRGB
    [[0.43607, 0.38515, 0.14307], [0.22249, 0.71687, 0.06061], [0.01392, 0.09708, 0.71410]]
)
SRGB_CURVE = ("para", (2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045))


def fixed(*values: float) -> bytes:
    return b"".join(struct.pack(">i", round(value * 65536)) for value in values)


def curve_tag(curve: float | tuple[str, tuple[float, ...]] | np.ndarray) -> bytes:
    """A gamma (u8Fixed8), the numbers of a parametric curve, or a table."""
    if isinstance(curve, tuple):
        kind = {1: 0, 3: 1, 4: 2, 5: 3, 7: 4}[len(curve[1])]
        return b"para\0\0\0\0" + struct.pack(">HH", kind, 0) + fixed(*curve[1])
    if isinstance(curve, np.ndarray):
        words = np.round(curve * 65535).astype(">u2")
        return b"curv\0\0\0\0" + struct.pack(">I", len(words)) + words.tobytes()
    return b"curv\0\0\0\0" + struct.pack(">IH", 1, round(curve * 256)) + bytes(2)


def profile(
    space: bytes, tags: dict[bytes, bytes], name: str = "made", pcs: bytes = b"XYZ "
) -> bytes:
    text = name.encode("utf-16-be")
    tags = {
        b"desc": b"mluc\0\0\0\0"
        + struct.pack(">II2s2sII", 1, 12, b"en", b"US", len(text), 28)
        + text,
        b"cprt": b"mluc\0\0\0\0" + struct.pack(">II2s2sII", 1, 12, b"en", b"US", 2, 28) + b"\0x",
        b"wtpt": b"XYZ \0\0\0\0" + fixed(0.9642, 1, 0.8249),
        **tags,
    }
    at, table, body = 132 + 12 * len(tags), b"", b""
    for tag, content in tags.items():
        content += bytes(-len(content) % 4)
        table += struct.pack(">4sII", tag, at + len(body), len(content))
        body += content
    header = struct.pack(">I4sI4s4s4s", at + len(body), b"lcms", 0x04300000, b"mntr", space, pcs)
    header += struct.pack(">6H", 2026, 1, 1, 0, 0, 0) + b"acsp" + bytes(28)
    header += fixed(0.9642, 1, 0.8249)
    header = header.ljust(128, b"\0")
    return header + struct.pack(">I", len(tags)) + table + body


def rgb_profile(
    chromaticities: tuple[float, ...] = BT709,
    curve: float | tuple[str, tuple[float, ...]] | np.ndarray = SRGB_CURVE,
    name: str = "made",
    **more: bytes,
) -> bytes:
    """Three primaries and one curve; `more` are tags by name."""
    colorants = (XYZ_D50_FROM_BT709 @ bt709_from_primaries(chromaticities)).T
    tags = {
        tag: b"XYZ \0\0\0\0" + fixed(*xyz)
        for tag, xyz in zip((b"rXYZ", b"gXYZ", b"bXYZ"), colorants, strict=True)
    }
    tags |= {tag: curve_tag(curve) for tag in (b"rTRC", b"gTRC", b"bTRC")}
    return profile(b"RGB ", tags | {tag.encode(): content for tag, content in more.items()}, name)


def grey_profile(curve: float | np.ndarray, pcs: bytes = b"XYZ ") -> bytes:
    return profile(b"GRAY", {b"kTRC": curve_tag(curve)}, "grey", pcs)


def cmyk_profile() -> bytes:
    """Ink takes its colour away, in a look-up table to Lab whose corners are all there is."""
    ramp = bytes(range(256))
    corners = b""
    for c, m, y, k in np.ndindex(2, 2, 2, 2):
        lightness = 255 * (1 - k) * (1 - 0.2 * c) * (1 - 0.3 * m) * (1 - 0.1 * y)
        corners += bytes([round(lightness), 128, 128])
    table = b"mft1\0\0\0\0" + bytes([4, 3, 2, 0]) + fixed(1, 0, 0, 0, 1, 0, 0, 0, 1)
    return profile(b"CMYK", {b"A2B0": table + ramp * 4 + corners + ramp * 3}, "inks", pcs=b"Lab ")
