"""ICC colour profiles: how pictures with one become the product's pixels.

Profiles of three primaries and a curve, which nearly all are (Display P3, Adobe RGB, ProPhoto, any
linear one), are read here, because LittleCMS by way of Pillow has 8 bits only and linear pictures
need 16. All others (look-up tables, CMYK, Lab) go through LittleCMS.
"""

import io
import struct
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from jaxtyping import Float, UInt8
from PIL import Image, ImageCms

from deeplight.io.colour import (
    BT709,
    ColourSpace,
    Matrix,
    Signal,
    bt709_from_primaries,
    eight_bit,
    from_cicp,
    is_srgb,
    power_curve,
)

_XYZ_FROM_BT709_D50 = np.array(  # ICC's sRGB: its primaries adapted to D50 as Bradford does
    [[0.43607, 0.38515, 0.14307], [0.22249, 0.71687, 0.06061], [0.01392, 0.09708, 0.71410]]
)


_ROWS = 256  # at once, to keep Pillow's copies small


class LookUpProfile:
    """A profile that LittleCMS applies, in 8 bits and to sRGB; called for whole pictures.

    Attributes:
        name: the profile's own.
        mode: Pillow's mode of the pictures it is for: "RGB", "L", "CMYK" or "LAB".
    """

    is_radiance = False

    def __init__(self, name: str, mode: str, profile: ImageCms.ImageCmsProfile) -> None:
        self.name, self.mode = name, mode
        self._transform = ImageCms.buildTransform(
            profile, ImageCms.createProfile("sRGB"), mode, "RGB"
        )

    def picture(self, picture: Image.Image) -> UInt8[np.ndarray, "height width 3"]:
        """sRGB pixels of a picture of its mode."""
        return np.asarray(ImageCms.applyTransform(picture, self._transform))

    def pixels(self, stored: np.ndarray) -> UInt8[np.ndarray, "height width 3"]:
        """sRGB pixels of 8- or 16-bit RGB ones, of which a grey profile takes the first channel."""
        result = np.empty(stored.shape, np.uint8)
        for start in range(0, stored.shape[0], _ROWS):
            rows = eight_bit(stored[start : start + _ROWS])
            channels = rows if self.mode == "RGB" else rows[..., 0]
            picture = Image.fromarray(np.ascontiguousarray(channels))
            result[start : start + _ROWS] = self.picture(picture)
        return result


@lru_cache(maxsize=32)
def from_icc(profile: bytes) -> ColourSpace | LookUpProfile | None:
    """What a profile does; None where it is sRGB, or so near that no pixel changes visibly.

    A profile that names H.273 code points (tag `cicp`, as HDR ones do) is taken by them.

    Raises:
        ValueError: no profile, or one that cannot be applied to a picture.
    """
    try:
        opened = ImageCms.ImageCmsProfile(io.BytesIO(profile))
        name = ImageCms.getProfileDescription(opened).strip() or "unnamed"
        tags = _tags(profile)
        if b"cicp" in tags:
            primaries, transfer = tags[b"cicp"][8:10]
            return from_cicp(primaries, transfer)
        space, meant = profile[16:20], profile[20:24]
        found = _of_primaries(name, space, meant, tags) or _looked_up(name, space, opened)
    except (ImageCms.PyCMSError, OSError, TypeError, struct.error, IndexError) as error:
        raise ValueError(f"colour profile: {error}") from error
    return None if isinstance(found, ColourSpace) and is_srgb(found.pixels) else found


def _tags(profile: bytes) -> dict[bytes, bytes]:
    (count,) = struct.unpack_from(">I", profile, 128)
    entries = (struct.unpack_from(">4sII", profile, 132 + 12 * i) for i in range(min(count, 100)))
    return {name: profile[start : start + size] for name, start, size in entries}


def _of_primaries(
    name: str, space: bytes, meant: bytes, tags: dict[bytes, bytes]
) -> ColourSpace | None:
    """A profile of primaries and curves; None if it is of another kind or its curves differ.

    Args:
        name: the profile's own.
        space: what pictures with it hold.
        meant: the space that it leads to; a grey curve of Lab gives lightness instead of light.
        tags: its tables and curves.
    """
    if b"A2B0" in tags or meant != b"XYZ ":
        return None
    if space == b"GRAY" and b"kTRC" in tags:
        curve = _curve(tags[b"kTRC"])
        return ColourSpace(name, np.eye(3), curve, _is_linear(curve))
    needed = (b"rXYZ", b"gXYZ", b"bXYZ", b"rTRC", b"gTRC", b"bTRC")
    if space != b"RGB " or any(tag not in tags for tag in needed):
        return None
    curves = [_curve(tags[tag]) for tag in needed[3:]]
    probe = np.linspace(0, 1, 33)
    if any(np.abs(curve(probe) - curves[0](probe)).max() > 1e-3 for curve in curves[1:]):
        return None
    matrix = np.linalg.inv(_XYZ_FROM_BT709_D50) @ _colorants(tags)
    return ColourSpace(name, matrix, curves[0], _is_linear(curves[0]))


def _colorants(tags: dict[bytes, bytes]) -> Matrix:
    columns = [struct.unpack_from(">3i", tags[tag], 8) for tag in (b"rXYZ", b"gXYZ", b"bXYZ")]
    return np.array(columns, float).T / 65536


def _is_linear(curve: Callable[[Signal], Signal]) -> bool:
    probe = np.linspace(0, 1, 9)
    return bool(np.abs(curve(probe) - probe).max() < 0.01)


def _curve(tag: bytes) -> Callable[[Signal], Signal]:
    """The curve of a `curv` or `para` tag (ICC.1:2022, 10.6 and 10.18)."""
    if tag[:4] == b"para":
        (kind,) = struct.unpack_from(">H", tag, 8)
        values = np.array(struct.unpack_from(f">{(1, 3, 4, 5, 7)[kind]}i", tag, 12)) / 65536
        return _parametric(kind, values)
    (count,) = struct.unpack_from(">I", tag, 8)
    if count == 0:
        return power_curve(1.0)
    table: np.ndarray = np.array(struct.unpack_from(f">{count}H", tag, 12))
    if count == 1:
        return power_curve(float(table[0]) / 256)
    return lambda signal: np.interp(signal, np.linspace(0, 1, count), table / 65535)


def _parametric(kind: int, values: Float[np.ndarray, "n"]) -> Callable[[Signal], Signal]:
    g, a, b, c, d, e, f = np.pad(values, (0, 7 - len(values))).tolist()
    if kind == 0:
        return power_curve(g)
    start = -b / a if kind in (1, 2) else d  # where the power begins
    shift, below = {1: (0.0, 0.0), 2: (c, c), 3: (0.0, 0.0), 4: (e, f)}[kind]
    slope = c if kind in (3, 4) else 0.0
    return lambda signal: np.where(
        signal >= start,
        np.maximum(a * signal + b, 0) ** g + shift,
        slope * signal + below,
    )


def _looked_up(name: str, space: bytes, opened: ImageCms.ImageCmsProfile) -> LookUpProfile | None:
    modes = {b"RGB ": "RGB", b"GRAY": "L", b"CMYK": "CMYK", b"Lab ": "LAB"}
    mode = modes.get(space)
    if mode is None:
        raise ValueError(f"colour profile of {ascii(space)}")
    found = LookUpProfile(name, mode, opened)
    return None if mode == "RGB" and is_srgb(found.pixels) else found


def cie_lab() -> LookUpProfile:
    """The profile of CIE Lab pictures that have none."""
    return LookUpProfile("CIE Lab", "LAB", ImageCms.ImageCmsProfile(ImageCms.createProfile("LAB")))


def bt709_from_icc(profile: bytes) -> Matrix:
    """Linear sRGB colours of a linear picture with this profile; identity if it has no primaries.

    Raises:
        ValueError: no profile.
    """
    found = from_icc(profile)
    return (
        found.bt709_from_linear if isinstance(found, ColourSpace) else bt709_from_primaries(BT709)
    )
