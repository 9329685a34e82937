"""Photos: anything a camera, phone or editor writes becomes upright 8-bit sRGB."""

import io
import warnings
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
from jaxtyping import Float32, UInt8
from PIL import Image, UnidentifiedImageError

from deeplight.camera_response import encode
from deeplight.errors import ImageFileError, MissingExtraError
from deeplight.io.atomic import replacing
from deeplight.io.exif import Exif, upright
from deeplight.io.image_file import check_size, damaged, first_bytes, not_an_image, opened
from deeplight.io.radiance import is_floating_point, read_radiance

MIN_SIDE = 32
"""Shortest side in pixels of a photo; less shows no scene to estimate light from."""

MAX_PHOTO_PIXELS = 100_000_000

PHOTO_SUFFIXES = frozenset(
    ".avif .bmp .gif .heic .heif .jfif .jp2 .jpeg .jpg .jxl .png .tif .tiff .webp".split()
)
"""What a folder is searched for. A file named directly may have any suffix."""

MID_GREY = 118
"""sRGB of an 18 % reflector: what a metered camera makes of an unknown scene."""

PNG_START = b"\x89PNG"
DECODED_WHEN_OPENED = (b"GIF8", b"\0\0\0\x0cjP  ", b"\xff\x4f\xff\x51")  # GIF, JPEG 2000
HEIF_BRANDS = (b"heic", b"heix", b"hevc", b"heim", b"heis", b"mif1", b"msf1")


@dataclass(frozen=True, eq=False)
class Photo:
    """One photo, upright.

    Attributes:
        pixels: RGB, gamma-encoded, [0, 255]. May be a turned view of the stored picture.
        source: the file it came from, None for pixels made in memory.
        vertical_fov_rad: of the upright photo, from EXIF; None where EXIF does not tell.
        notes: what reading had to decide, one short line each, to be shown to the user.
    """

    pixels: UInt8[np.ndarray, "height width 3"]
    source: Path | None = None
    vertical_fov_rad: float | None = None
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class _Stored:
    """A decoded picture as the file has it, not yet upright."""

    pixels: UInt8[np.ndarray, "height width 3"]
    exif: Exif
    notes: tuple[str, ...]


def read_photo(path: Path | str) -> Photo:
    """Read a photo of any size, orientation and pixel type.

    Grey becomes three equal channels. Transparent parts show nothing that was seen, so they are
    laid over mid-grey: black would read as a dark room, white as a lamp. CMYK, palette and 16-bit
    pictures become 8-bit RGB. An embedded colour profile is not applied; `notes` names it.
    Floating-point files (EXR, .hdr, TIFF) are scene-linear: their radiance is clipped at 1 and
    encoded with gamma 2.2, so 1.0 is taken as the camera's white. Of several frames the first is
    read.

    Raises:
        OSError: there is no such file, it is a folder, or reading it is not permitted.
        ImageFileError: not an image, truncated, under 32 pixels a side, over 100 megapixels or
            30,000 pixels a side, or holding NaN or infinity.
        MissingExtraError: a HEIC file without the `heic` extra.
    """
    path = Path(path)
    start = first_bytes(path)
    # Measured on a 12-megapixel JPEG on one core: OpenImageIO takes 90 ms to a numpy array, Pillow
    # 145 ms, half of it the copy out of its own four-byte pixels. The pixels are the same.
    stored = _decode_heif(path, start) if start[4:8] == b"ftyp" else _decode(path, start)
    height, width, _ = stored.pixels.shape
    if min(height, width) < MIN_SIDE:
        expected, got = (
            f"a photo of at least {MIN_SIDE} pixels a side",
            f"{path} of {width} x {height}",
        )
        raise ImageFileError(expected, got, "use a larger photo")
    return Photo(
        pixels=upright(stored.pixels, stored.exif.orientation),
        source=path,
        vertical_fov_rad=stored.exif.vertical_fov_rad(width, height),
        notes=stored.notes,
    )


def photo_paths(paths: Iterable[Path | str]) -> list[Path]:
    """List the photos that `paths` name: files as given, folders as their sorted photos.

    A folder is not searched deeper; hidden files, other files and earlier previews are left out.

    Raises:
        OSError: a path does not exist or a folder cannot be listed.
        ImageFileError: a folder holds no photo.
    """
    found: list[Path] = []
    for path in map(Path, paths):
        if not path.is_dir():
            path.stat()  # a missing file is told before any work starts
            found.append(path)
            continue
        photos = sorted(entry for entry in path.iterdir() if _is_photo_name(entry))
        if not photos:
            raise ImageFileError("a folder of photos", f"{path} without any", "give another folder")
        found += photos
    return found


def write_png(path: Path | str, pixels: UInt8[np.ndarray, "height width 3"]) -> None:
    """Write 8-bit RGB, whole or not at all.

    Raises:
        OSError: the file cannot be written.
    """
    with replacing(path) as temporary:
        temporary.write_bytes(encode_png(pixels))


def encode_png(pixels: UInt8[np.ndarray, "height width 3"]) -> bytes:
    """Encode 8-bit RGB as PNG, without loss."""
    return _encoded(pixels, "PNG")


def encode_jpeg(pixels: UInt8[np.ndarray, "height width 3"], quality: int = 95) -> bytes:
    """Encode 8-bit RGB as JPEG with halved chroma, as phones do; `quality` is 1 to 95."""
    return _encoded(pixels, "JPEG", quality=quality)


def decode_rgb(encoded: bytes) -> UInt8[np.ndarray, "height width 3"]:
    """Decode a small picture from memory; EXIF is not looked at.

    Raises:
        OSError: the bytes are no complete image.
    """
    try:
        with Image.open(io.BytesIO(encoded)) as picture:
            return np.asarray(picture.convert("RGB"))
    except (SyntaxError, ValueError) as error:  # Pillow's words for some kinds of damage
        raise OSError(f"broken image: {error}") from error


def _encoded(pixels: UInt8[np.ndarray, "height width 3"], kind: str, **options: int) -> bytes:
    buffer = io.BytesIO()
    Image.fromarray(np.ascontiguousarray(pixels)).save(buffer, kind, **options)
    return buffer.getvalue()


def _is_photo_name(path: Path) -> bool:
    hidden_or_result = path.name.startswith(".") or path.name.endswith(".preview.png")
    return path.suffix.lower() in PHOTO_SUFFIXES and not hidden_or_result and path.is_file()


def _decode(path: Path, start: bytes) -> _Stored:
    check_with_pillow(path, start)
    with opened(path, MAX_PHOTO_PIXELS) as file:
        if is_floating_point(file):
            pixels = _encode_radiance(read_radiance(file, path))
            return _Stored(pixels, _exif(file.spec()), ("scene-linear file: 1.0 taken as white",))
        values = file.read_image(0, 0, 0, min(file.spec().nchannels, 4), oiio.UINT8)
        if values is None or file.has_error:
            raise damaged(path, file.geterror())
        values = values.reshape(values.shape[0], values.shape[1], -1)
        return _as_rgb(values, file.spec(), file.format_name())


def _as_rgb(
    values: UInt8[np.ndarray, "height width channels"], spec: oiio.ImageSpec, kind: str
) -> _Stored:
    """Bring one to four channels to RGB: spread grey, lay alpha over mid-grey."""
    notes = []
    channels = values.shape[2]
    rgb = values[..., :3] if channels >= 3 else np.repeat(values[..., :1], 3, axis=2)
    names = spec.channelnames[:channels]
    if "A" in names:  # not spec.alpha_channel, which is off by one for GIF
        # GIF's alpha is all or nothing and its hidden colours are not black, which nothing states.
        straight = bool(spec.get_int_attribute("oiio:UnassociatedAlpha")) or kind == "gif"
        rgb, see_through = _over_mid_grey(rgb, values[..., names.index("A")], straight)
        if see_through:
            notes.append("transparent parts taken as mid-grey")
    profile = spec.get_string_attribute("ICCProfile:profile_description")
    if profile and "srgb" not in profile.lower():
        notes.append(f"colour profile '{profile}' read as sRGB")
    return _Stored(np.ascontiguousarray(rgb), _exif(spec), tuple(notes))


def _over_mid_grey(
    rgb: UInt8[np.ndarray, "height width 3"],
    alpha: UInt8[np.ndarray, "height width"],
    straight: bool,
) -> tuple[UInt8[np.ndarray, "height width 3"], bool]:
    """Lay a picture over mid-grey; also tell whether anything was transparent at all."""
    if alpha.min() == 255:
        return rgb, False
    cover = alpha[..., None].astype(np.uint32)
    colour = rgb * cover if straight else rgb * np.uint32(255)
    mixed = (colour + MID_GREY * (255 - cover) + 127) // 255
    return np.minimum(mixed, 255).astype(np.uint8), True


def _encode_radiance(
    radiance: Float32[np.ndarray, "height width 3"],
) -> UInt8[np.ndarray, "height width 3"]:
    return np.floor(encode(np.clip(radiance, 0, 1)) * 255 + 0.5).astype(np.uint8)


def check_with_pillow(path: Path, start: bytes) -> None:
    """Check what OpenImageIO would find out too late or too loudly.

    It decodes GIF and JPEG 2000 when it opens them, whatever their size, and libpng tells of damage
    on stderr, past every error handler.
    """
    is_png = start.startswith(PNG_START)
    if not (is_png or start.startswith(DECODED_WHEN_OPENED)):
        return
    try:
        with warnings.catch_warnings(action="ignore"), Image.open(path) as picture:
            check_size(path, *picture.size, MAX_PHOTO_PIXELS)
            if is_png:
                picture.verify()
    except Image.DecompressionBombError as error:
        expected = f"a photo of at most {MAX_PHOTO_PIXELS / 1e6:.0f} megapixels"
        raise ImageFileError(expected, f"{path}, far larger", "make it smaller first") from error
    except UnidentifiedImageError as error:
        raise not_an_image(path, "a damaged header") from error
    except (OSError, SyntaxError, ValueError) as error:
        raise damaged(path, str(error)) from error


def _exif(spec: oiio.ImageSpec) -> Exif:
    return Exif(
        orientation=spec.get_int_attribute("Orientation", 1),
        focal_length_35mm_mm=spec.get_float_attribute("Exif:FocalLengthIn35mmFilm"),
        focal_length_mm=spec.get_float_attribute("Exif:FocalLength"),
        focal_plane_x_resolution=spec.get_float_attribute("Exif:FocalPlaneXResolution"),
        focal_plane_unit=spec.get_int_attribute("Exif:FocalPlaneResolutionUnit", 2),
        original_width=spec.get_int_attribute("Exif:PixelXDimension"),
    )


def _decode_heif(path: Path, start: bytes) -> _Stored:
    """Decode HEIC, for which OpenImageIO's package has no reader, and AVIF with Pillow."""
    if start[8:12] in HEIF_BRANDS:
        try:
            import pillow_heif
        except ImportError as error:
            raise MissingExtraError("heic", f"reading {path.name}") from error
        pillow_heif.register_heif_opener()
    try:
        with Image.open(path) as picture:
            check_size(path, *picture.size, MAX_PHOTO_PIXELS)
            exif = _pillow_exif(picture)
            rgba = np.asarray(picture.convert("RGBA"))
    except UnidentifiedImageError as error:
        raise not_an_image(path, "no picture in it") from error
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise damaged(path, str(error)) from error
    rgb, see_through = _over_mid_grey(rgba[..., :3], rgba[..., 3], straight=True)
    notes = ("transparent parts taken as mid-grey",) if see_through else ()
    return _Stored(np.ascontiguousarray(rgb), exif, notes)


def _pillow_exif(picture: Image.Image) -> Exif:
    """Read EXIF through Pillow. The HEIF decoder has already turned the picture upright."""
    tags = picture.getexif()
    camera = tags.get_ifd(0x8769)
    exif = Exif(
        orientation=int(tags.get(0x0112, 1)),
        focal_length_35mm_mm=float(camera.get(0xA405, 0)),
        focal_length_mm=float(camera.get(0x920A, 0)),
        focal_plane_x_resolution=float(camera.get(0xA20E, 0)),
        focal_plane_unit=int(camera.get(0xA210, 2)),
        original_width=int(camera.get(0xA002, 0)),
    )
    return exif if picture.format == "AVIF" else replace(exif, orientation=1)
