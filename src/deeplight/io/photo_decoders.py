"""From a photo's file to 8-bit sRGB as it is stored: one decoder for each family of formats.

OpenImageIO for most, simplejpeg for JPEGs made smaller, libheif for HEIC, Pillow for AVIF and what
is not RGB, LibRaw for raw files.
"""

import logging
import warnings
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
from jaxtyping import Float32, Shaped, UInt8
from PIL import Image, UnidentifiedImageError

from deeplight.camera_response import encode
from deeplight.errors import ImageFileError, MissingExtraError
from deeplight.io.colour import eight_bit, over_grey, pixel_table
from deeplight.io.colour_profile import LookUpProfile, cie_lab
from deeplight.io.exif import Exif, camera_name, exif_of_bytes, exif_of_pillow
from deeplight.io.heif_boxes import HeifHeader, read_header
from deeplight.io.image_file import check_size, damaged, first_bytes, not_an_image, opened
from deeplight.io.photo_colours import (
    ADOBE,
    Conversion,
    colours_of,
    conversion_of,
    fitting,
    is_encoded,
    notes_on,
)
from deeplight.io.png_chunks import PNG_START, read_png_chunks
from deeplight.io.radiance import (
    counts_down,
    is_floating_point,
    orientation_of,
    read_radiance,
)
from deeplight.io.raw import develop, is_raw

try:
    import simplejpeg
except ImportError:  # there is none for this Python: Pillow gives the same pixels
    simplejpeg = None

# Pillow reports damage in errors too; a logger without a handler prints on stderr.
logging.getLogger("PIL").addHandler(logging.NullHandler())

MAX_PHOTO_PIXELS = 100_000_000
MAX_JPEG_2000_PIXELS = 50_000_000  # OpenJPEG takes 24 bytes for each
MIN_SIDE = 32
"""Shortest side in pixels of a photo; less shows no scene to estimate light from."""

JPEG_START = b"\xff\xd8\xff"
_PILLOW_EXIF = (JPEG_START, b"RIFF", b"II", b"MM")
JPEG_2000 = (b"\0\0\0\x0cjP  ", b"\xff\x4f\xff\x51")
DECODED_WHEN_OPENED = (b"GIF8", *JPEG_2000)

_PHOTOMETRIC, _CIE_LAB = "tiff:PhotometricInterpretation", 8
_BLOCK = 1 << 17  # bytes that Pillow reads at once: with half of them it decodes 2 % slower
_ROWS = 256  # read and converted at once where a picture is not taken as it is


@dataclass(frozen=True, eq=False)
class Stored:
    """A decoded picture as the file has it, not yet upright.

    Attributes:
        pixels: sRGB; linear and HDR pictures as floating-point ones, see `io.colour`.
        exif: what the camera says.
        notes: what had to be decided, one short line each.
    """

    pixels: UInt8[np.ndarray, "height width 3"]
    exif: Exif
    notes: tuple[str, ...] = ()


def decode_photo(path: Path, start: bytes) -> Stored:
    """Decode a photo of any format; `start` is how its file begins.

    Raises:
        ImageFileError: not an image, damaged, too large, or holding NaN or infinity.
        MissingExtraError: HEIC or raw without their extras.
        Exception: whatever else a decoder raises; callers stand behind `io.boundary`.
    """
    if is_raw(path, start):
        return _developed(path)
    if start[4:8] == b"ftyp":
        return _decode_heif(path)
    # Measured on a 12-megapixel JPEG on one core: OpenImageIO takes 90 ms to a numpy array, Pillow
    # 145 ms, half of it the copy out of its own four-byte pixels. The pixels are the same.
    return _decode(path, start)


def decode_reduced(path: Path, start: bytes, max_side: int) -> tuple[Stored, int, int] | None:
    """Decode a JPEG at the scale that is needed, and give the width and height of the whole.

    The decoder leaves out the finer waves of each block of 8 x 8, which saves it most of the work:
    at 1/2, 1/4 or 1/8 of the side, the least that keeps `max_side` pixels along the longer one.

    Returns:
        None for a file that cannot be read so, or that is not twice as large.

    Raises:
        ImageFileError: too large.
        Exception: whatever Pillow raises; callers stand behind `io.boundary`.
    """
    if not start.startswith(JPEG_START):
        return None
    with warnings.catch_warnings(action="ignore"), Image.open(path) as picture:
        width, height = picture.size
        check_size(path, width, height, MAX_PHOTO_PIXELS)
        longest = max(width, height)
        if picture.mode not in ("L", "RGB") or longest < 2 * max_side:
            return None
        wanted = [max(MIN_SIDE, side * max_side // longest) for side in (width, height)]
        picture.draft(picture.mode, (wanted[0], wanted[1]))
        picture.decodermaxblock = _BLOCK
        return stored_of_pillow(picture, None, partial(_pixels_of_jpeg, path)), width, height


def _pixels_of_jpeg(path: Path, picture: Image.Image) -> UInt8[np.ndarray, "height width *rgb"]:
    """A JPEG's pixels, as many as Pillow would give now: the same ones, in 0.9 of its time."""
    width, height = picture.size
    if simplejpeg is not None and picture.mode == "RGB":
        # What is damaged Pillow shows as far as it can, or says what is wrong.
        with suppress(ValueError):
            least = {"min_height": height, "min_width": width}
            pixels: np.ndarray = simplejpeg.decode_jpeg(path.read_bytes(), **least)
            if pixels.shape == (height, width, 3):
                return pixels
    return np.asarray(picture)


def stored_of_pillow(
    picture: Image.Image,
    cicp: tuple[int, int] | None = None,
    pixels_of: Callable[[Image.Image], np.ndarray] = np.asarray,
) -> Stored:
    """A Pillow picture of any mode, with its colours converted and its EXIF read.

    Args:
        picture: opened or made in memory.
        cicp: H.273's primaries and transfer, where its file names them.
        pixels_of: gives those of a picture that needs no conversion by Pillow.
    """
    exif = exif_of_pillow(picture.getexif)
    profile = picture.info.get("icc_profile")
    conversion, notes = colours_of(cicp, profile)
    if exif.is_adobe_rgb and not profile and cicp is None:
        conversion = ADOBE
    if picture.mode == "LAB" and conversion is None:
        conversion = cie_lab()
    if isinstance(conversion, LookUpProfile) and conversion.mode == picture.mode:
        return Stored(conversion.picture(picture), exif, notes_on(conversion))
    mode = "RGBA" if picture.has_transparency_data else "RGB"
    deep = picture.mode.startswith(("I", "F"))
    shown = picture if deep or picture.mode == mode else picture.convert(mode)  # a copy is large
    values = _sixteen_bit(shown) if deep else pixels_of(shown)
    conversion, misfit = fitting(conversion, is_grey=picture.mode in ("1", "L", "LA") or deep)
    alpha = 3 if values.shape[2] == 4 else None
    pixels, see_through = _as_rgb(values, conversion, alpha, straight=True)
    return Stored(pixels, exif, (*notes, *misfit, *notes_on(conversion, see_through)))


def checked_facts(path: Path, start: bytes) -> dict[str, Any]:
    """Check what OpenImageIO would find out too late or too loudly.

    It decodes GIF and JPEG 2000 when it opens them, whatever their size.

    Returns:
        Facts about a PNG, see `png_chunks`; nothing for other files.
    """
    if start.startswith(PNG_START):
        size, facts = read_png_chunks(path)
        check_size(path, *size, MAX_PHOTO_PIXELS)
        return facts
    if not start.startswith(DECODED_WHEN_OPENED):
        return {}
    try:
        most = MAX_JPEG_2000_PIXELS if start.startswith(JPEG_2000) else MAX_PHOTO_PIXELS
        with warnings.catch_warnings(action="ignore"), Image.open(path) as picture:
            check_size(path, *picture.size, most)
    except Image.DecompressionBombError as error:
        expected = f"a photo of at most {MAX_PHOTO_PIXELS / 1e6:.0f} megapixels"
        raise ImageFileError(expected, f"{path}, far larger", "make it smaller first") from error
    except UnidentifiedImageError as error:
        raise not_an_image(path, "a damaged header") from error
    except (OSError, SyntaxError, ValueError) as error:
        raise damaged(path, str(error)) from error
    return {}


def _decode(path: Path, start: bytes) -> Stored:
    facts = checked_facts(path, start)
    if start.startswith(JPEG_2000):
        with Image.open(path) as picture:
            if picture.mode in ("LA", "RGBA"):  # OpenImageIO multiplies by alpha, as if linear
                return stored_of_pillow(picture)
    with opened(path, MAX_PHOTO_PIXELS) as file:
        if is_floating_point(file) and not start.startswith(JPEG_START) and not is_encoded(file):
            pixels = _encode_radiance(read_radiance(file, path, MAX_PHOTO_PIXELS))
            exif = replace(_exif(file.spec()), orientation=orientation_of(file, path))
            return Stored(pixels, exif, ("scene-linear file: 1.0 taken as white",))
        _leave_thumbnails(file, path)
        conversion, notes = conversion_of(file.spec(), facts, path)
        of_inks = isinstance(conversion, LookUpProfile) and conversion.mode in ("CMYK", "LAB")
        # A JPEG with a gain map, which is left out: the photo is what every viewer shows.
        has_gain_map = is_floating_point(file) and start.startswith(JPEG_START)
        if of_inks or has_gain_map or file.spec().get_int_attribute(_PHOTOMETRIC) == _CIE_LAB:
            with Image.open(path) as picture:
                return stored_of_pillow(picture)
        conversion, misfit = fitting(conversion, is_grey=file.spec().nchannels < 3)
        pixels, see_through = _read(file, path, conversion)
        notes = (*notes, *misfit, *notes_on(conversion, see_through))
        return Stored(pixels, _exif_of(path, start, facts, file.spec()), notes)


def _leave_thumbnails(file: oiio.ImageInput, path: Path) -> None:
    """Go to the first page of a TIFF that is no smaller version of another (NewSubfileType)."""
    page = 0
    while file.spec().get_int_attribute("tiff:subfiletype") & 1:
        page += 1
        if not file.seek_subimage(page, 0):
            file.geterror()  # or OpenImageIO prints it when the process ends
            file.seek_subimage(0, 0)
            return
        check_size(path, file.spec().width, file.spec().height, MAX_PHOTO_PIXELS)


def _read(
    file: oiio.ImageInput, path: Path, conversion: Conversion | None
) -> tuple[UInt8[np.ndarray, "height width 3"], bool]:
    """The pixels, and whether some were transparent; what needs work is read by stripes."""
    spec = file.spec()
    channels = min(spec.nchannels, 4)
    names = spec.channelnames[:channels]
    alpha = names.index("A") if "A" in names else None  # spec.alpha_channel is off by one for GIF
    if alpha is not None and file.format_name() == "bmp" and not _bmp_has_alpha(path):
        alpha = None
    deep = conversion is not None and str(spec.format) != "uint8"
    kind = oiio.UINT16 if deep else oiio.UINT8
    # Colours of these are not multiplied by alpha, which nothing states.
    left_straight = file.format_name() in ("bmp", "dds", "gif", "sgi")
    straight = bool(spec.get_int_attribute("oiio:UnassociatedAlpha")) or left_straight
    plain = conversion is None and alpha is None
    is_negative = counts_down(spec)
    rows = spec.height if plain or spec.tile_width else _ROWS
    result = np.empty((0, spec.width, 3), np.uint8)
    any_seen_through = False
    for top in range(0, spec.height, rows):
        end = min(top + rows, spec.height)
        if rows == spec.height:
            values = file.read_image(file.current_subimage(), 0, 0, channels, kind)
        else:
            values = file.read_scanlines(spec.y + top, spec.y + end, spec.z, 0, channels, kind)
        if values is None or file.has_error:
            raise damaged(path, file.geterror())
        values = values.reshape(end - top, spec.width, -1)
        if is_negative:
            values = np.iinfo(values.dtype).max - values
        pixels, see_through = _as_rgb(values, conversion, alpha, straight)
        any_seen_through |= see_through
        if rows == spec.height:
            return pixels, see_through
        if not result.size:
            result = np.empty((spec.height, spec.width, 3), np.uint8)
        result[top:end] = pixels
    return result, any_seen_through


def _bmp_has_alpha(path: Path) -> bool:
    """Whether a .bmp names a mask for alpha: without one the fourth byte of a pixel is unused."""
    start = first_bytes(path, 70)
    header, compression = int.from_bytes(start[14:18], "little"), start[30]
    return header >= 56 and compression in (3, 6) and any(start[66:70])


def _as_rgb(
    values: Shaped[np.ndarray, "height width channels"],
    conversion: Conversion | None,
    alpha: int | None,
    straight: bool,
) -> tuple[UInt8[np.ndarray, "height width 3"], bool]:
    """One to four channels as sRGB: grey spread, colours converted, alpha laid over mid-grey.

    By stripes where there is something to do, so that what is in between takes little memory.
    """
    if conversion is None and alpha is None and values.dtype == np.uint8:
        return np.ascontiguousarray(_three(values)), False
    result = np.empty((*values.shape[:2], 3), np.uint8)
    any_seen_through = False
    for top in range(0, len(values), _ROWS):
        part = values[top : top + _ROWS]
        rgb = eight_bit(_three(part)) if conversion is None else conversion.pixels(_three(part))
        if alpha is not None:
            cover = eight_bit(part[..., alpha])
            if cover.min() < 255:
                rgb, any_seen_through = over_grey(rgb, cover[..., None], straight), True
        result[top : top + _ROWS] = rgb
    return result, any_seen_through


def _three(
    values: Shaped[np.ndarray, "rows width channels"],
) -> Shaped[np.ndarray, "rows width 3"]:
    """Red, green and blue; of grey the same three times."""
    return values[..., :3] if values.shape[2] >= 3 else np.repeat(values[..., :1], 3, axis=2)


def _sixteen_bit(picture: Image.Image) -> Shaped[np.ndarray, "height width 1"]:
    """A grey picture of Pillow's 16-bit, 32-bit and floating-point modes, in 16 bits."""
    values = np.asarray(picture)
    if values.dtype == np.float32:
        return np.floor(np.clip(values, 0, 255) * 257 + 0.5).astype(np.uint16)[..., None]
    return np.clip(values, 0, 65535).astype(np.uint16)[..., None]


def _encode_radiance(
    radiance: Float32[np.ndarray, "height width 3"],
) -> UInt8[np.ndarray, "height width 3"]:
    return np.floor(encode(np.clip(radiance, 0, 1)) * 255 + 0.5).astype(np.uint8)


def _exif_of(path: Path, start: bytes, facts: dict[Any, Any], spec: oiio.ImageSpec) -> Exif:
    """What the camera says: Pillow's entries wherever it reads the format, so that full and reduced
    pictures, and all formats, agree on entries of odd types."""
    if start.startswith(PNG_START):
        bare = Image.new("L", (1, 1))
        bare.info = dict(facts)
        return exif_of_pillow(bare.getexif)
    if not start.startswith(_PILLOW_EXIF):
        return _exif(spec)
    try:
        with warnings.catch_warnings(action="ignore"), Image.open(path) as picture:
            return exif_of_pillow(picture.getexif)
    except (OSError, SyntaxError, ValueError):  # OpenImageIO could read more than Pillow
        return _exif(spec)


def _exif(spec: oiio.ImageSpec) -> Exif:
    return Exif(
        orientation=spec.get_int_attribute("Orientation", 1),
        focal_length_35mm_mm=spec.get_float_attribute("Exif:FocalLengthIn35mmFilm"),
        focal_length_mm=spec.get_float_attribute("Exif:FocalLength"),
        focal_plane_x_resolution=spec.get_float_attribute("Exif:FocalPlaneXResolution"),
        focal_plane_unit=spec.get_int_attribute("Exif:FocalPlaneResolutionUnit", 2),
        original_width=spec.get_int_attribute("Exif:PixelXDimension"),
        camera=camera_name(spec.get_string_attribute("Make"), spec.get_string_attribute("Model")),
    )


def _developed(path: Path) -> Stored:
    raw = develop(path, MAX_PHOTO_PIXELS)
    note = "camera raw, developed with its own white balance and exposure"
    return Stored(pixel_table(True)[raw.linear], raw.exif, (note,))


def _decode_heif(path: Path) -> Stored:
    """Decode AVIF with Pillow, and HEIC, for which OpenImageIO's package has no reader."""
    header = read_header(path)
    if not header.is_av1:
        return _decode_heic(path, header)
    try:
        with Image.open(path, formats=("AVIF",)) as picture:
            check_size(path, *picture.size, MAX_PHOTO_PIXELS)
            return stored_of_pillow(picture, header.cicp)
    except UnidentifiedImageError as error:
        raise not_an_image(path, "no picture in it") from error


def _decode_heic(path: Path, header: HeifHeader) -> Stored:
    try:
        import pillow_heif
    except ImportError as error:
        raise MissingExtraError("heic", f"reading {path.name}") from error
    opened = pillow_heif.open_heif(path, convert_hdr_to_8bit=False)
    picture: Any = opened[opened.primary_index]
    width, height = picture.size
    check_size(path, width, height, MAX_PHOTO_PIXELS)
    conversion, notes = colours_of(header.cicp, picture.info.get("icc_profile"))
    conversion, misfit = fitting(conversion, is_grey=picture.mode.startswith("L"))
    exif = exif_of_pillow(lambda: exif_of_bytes(picture.info.get("exif")))
    if header.is_turned:  # and the decoder has obeyed
        exif = replace(exif, orientation=1)
    elif exif.orientation != 1:
        # ISO/IEC 23008-12 says to ignore EXIF here; the cameras that write such files need it.
        notes += (f"turned by EXIF orientation {exif.orientation}: the HEIC says nothing itself",)
    values = np.asarray(picture).reshape(height, -1, len(picture.mode.partition(";")[0]))
    values = values[:, :width]
    alpha = values.shape[2] - 1 if values.shape[2] in (2, 4) else None
    pixels, see_through = _as_rgb(values, conversion, alpha, straight=True)
    return Stored(pixels, exif, (*notes, *misfit, *notes_on(conversion, see_through)))
