"""A cube map as KTX 2.0, float32, uncompressed: what game engines load without conversion.

https://registry.khronos.org/KTX/specs/2.0/ktxspec.v2.html. The container is written here: the one
writer on PyPI, pyktx, has no wheels, and those on npm need node.
"""

import struct
from pathlib import Path

import numpy as np
from jaxtyping import Float

from deeplight.io.atomic import replacing

_IDENTIFIER = b"\xabKTX 20\xbb\r\n\x1a\n"
_RGBA_FLOAT32 = 109  # VK_FORMAT_R32G32B32A32_SFLOAT; that of three channels is hardly supported
_TEXEL_BYTES = 16
_INDEX_END = 80 + 24  # the header, and the place of one level
_LINEAR_BT709 = (1, 1, 1, 0)  # colour model RGBSDA, primaries, transfer, straight alpha
_FLOAT, _SIGNED = 0x80, 0x40


def write_ktx2(path: Path | str, faces: Float[np.ndarray, "6 size size 3"], unit: str) -> None:
    """Write one level of six faces, +X -X +Y -Y +Z -Z, whole or not at all.

    Args:
        path: of the file.
        faces: radiance as OpenGL and Vulkan lay it out (`orientation.faces_for(..., "webxr")`).
        unit: what 1.0 means, noted in the file.

    Raises:
        OSError: the file cannot be written.
    """
    size = faces.shape[1]
    texels = np.ones((6, size, size, 4), "<f4")
    texels[..., :3] = faces
    layout = _layout()
    notes = _notes({"KTXorientation": "rd", "KTXwriter": "deeplight", "deeplight:unit": unit})
    begin = _INDEX_END + len(layout) + len(notes)
    padding = -begin % _TEXEL_BYTES
    header = struct.pack("<9I", _RGBA_FLOAT32, 4, size, size, 0, 0, 6, 1, 0)
    header += struct.pack("<4I", _INDEX_END, len(layout), _INDEX_END + len(layout), len(notes))
    header += struct.pack("<2Q", 0, 0)  # nothing is compressed over all
    level = struct.pack("<3Q", begin + padding, texels.nbytes, texels.nbytes)
    with replacing(path) as temporary, temporary.open("wb") as file:
        file.write(_IDENTIFIER + header + level + layout + notes + bytes(padding))
        file.write(texels.tobytes())


def _layout() -> bytes:
    """Describe a texel as the Khronos Data Format does: four linear floats."""
    samples = b""
    for number, channel in enumerate((0, 1, 2, 15)):  # red, green, blue, alpha
        kind = channel | _FLOAT | _SIGNED
        samples += struct.pack("<HBB4x2f", 32 * number, 31, kind, -1.0, 1.0)
    size = 24 + len(samples)
    block = struct.pack("<IHH4B4x8B", 0, 2, size, *_LINEAR_BT709, _TEXEL_BYTES, *[0] * 7)
    return struct.pack("<I", 4 + size) + block + samples


def _notes(pairs: dict[str, str]) -> bytes:
    """Keys and values, in the order of their keys."""
    result = b""
    for key in sorted(pairs):
        pair = f"{key}\0{pairs[key]}\0".encode()
        result += struct.pack("<I", len(pair)) + pair + bytes(-len(pair) % 4)
    return result
