"""Photos: anything a camera, phone or editor writes becomes upright 8-bit sRGB."""

import io
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import UInt8
from PIL import Image

from deeplight.errors import ImageFileError
from deeplight.io.atomic import replacing
from deeplight.io.boundary import reading, reads
from deeplight.io.exif import ExifDirectories, exif_directories, upright
from deeplight.io.image_file import first_bytes
from deeplight.io.photo_decoders import (
    MIN_SIDE,
    Stored,
    decode_photo,
    decode_reduced,
    stored_of_pillow,
)
from deeplight.io.raw import RAW_SUFFIXES
from deeplight.io.tilt import Tilt, tilt_of

PHOTO_SUFFIXES = frozenset(
    ".avif .bmp .gif .heic .heif .jfif .jp2 .jpeg .jpg .jxl .png .tif .tiff .webp".split()
)
"""What a folder is searched for. A file named directly may have any suffix."""
_RUNS = 3  # zlib's Z_RLE


@dataclass(frozen=True, eq=False)
class Photo:
    """One photo, upright.

    Attributes:
        pixels: RGB, gamma-encoded, [0, 255]. May be a turned view of the stored picture.
        source: the file it came from, None for pixels made in memory.
        vertical_fov_rad: of the upright photo, from EXIF; None where EXIF does not say.
        notes: what reading had to decide, one short line each, to be shown to the user.
        reduced_from: height and width of the upright photo in its file, where `pixels` are fewer.
        camera: make and model as EXIF has them (`exif.camera_name`), empty where it does not say.
        read_exif: what was read of its file with its pixels, if all was.
    """

    pixels: UInt8[np.ndarray, "height width 3"]
    source: Path | None = None
    vertical_fov_rad: float | None = None
    notes: tuple[str, ...] = ()
    reduced_from: tuple[int, int] | None = None
    camera: str = ""
    read_exif: ExifDirectories | None = field(default=None, repr=False)

    @property
    def full_size(self) -> tuple[int, int]:
        """Height and width of the upright photo in its file: what users' pixels are of."""
        height, width, _ = self.pixels.shape
        return self.reduced_from or (height, width)

    @cached_property
    def exif(self) -> ExifDirectories:
        """All that its file says of how it was taken, read once; nothing of pixels from memory."""
        if self.source is None:
            return ExifDirectories()
        return self.read_exif or exif_directories(self.source)

    @cached_property
    def tilt(self) -> Tilt | None:
        """The camera's, where EXIF has it."""
        return tilt_of(self.exif)


@reads
def read_photo(path: Path | str, max_side: int | None = None) -> Photo:
    """Read a photo of any size, orientation and pixel type.

    Grey becomes three equal channels. Transparent parts show nothing that was seen, so they are
    laid over mid-grey: black would read as a dark room, white as a lamp. CMYK, palette and 16-bit
    pictures become 8-bit RGB, colours of other profiles and gamuts sRGB. Linear and HDR pictures
    (EXR, .hdr, raw files, PQ, HLG, linear PNG or TIFF) are scene-linear: their radiance is clipped
    at 1 and encoded with gamma 2.2, so 1.0 is taken as the camera's white. Of several frames the
    first is read. `notes` says what was decided.

    Args:
        path: of the file.
        max_side: enough pixels along the longer side: a JPEG of more than twice that comes at
            1/2, 1/4 or 1/8 of its side, still with at least this number, in a fraction of the time.

    Raises:
        OSError: there is no such file, it is a folder, or reading it is not permitted.
        ImageFileError: not an image, truncated, under 32 pixels a side, over 100 megapixels or
            30,000 pixels a side, or holding NaN or infinity.
        MissingExtraError: a HEIC or raw file without the `heic` or `raw` extra.
    """
    path = Path(path)
    start = first_bytes(path)
    reduced = None if max_side is None else decode_reduced(path, start, max_side)
    if reduced is not None:
        stored, width, height = reduced
        return _upright(stored, path, f"{path}", (width, height))
    return _upright(decode_photo(path, start), path, f"{path}")


def photo_of_pillow(picture: Image.Image) -> Photo:
    """A photo from a Pillow picture: what `read_photo` makes of its file, but for its `source`.

    Raises:
        ImageFileError: it fails to load, or is under 32 pixels a side.
    """
    name = getattr(picture, "filename", "") or "a Pillow picture"
    with reading(name):
        return _upright(stored_of_pillow(picture), None, name)


def _upright(
    stored: Stored, path: Path | None, name: str, whole: tuple[int, int] | None = None
) -> Photo:
    """The photo of a decoded picture; `whole` is width and height of what it was reduced from."""
    height, width, _ = stored.pixels.shape
    if min(height, width) < MIN_SIDE:
        expected, got = (
            f"a photo of at least {MIN_SIDE} pixels a side",
            f"{name} of {width} x {height}",
        )
        raise ImageFileError(expected, got, "use a larger photo")
    pixels = upright(stored.pixels, stored.exif.orientation)
    reduced_from = None
    if whole is not None:
        on_its_side = stored.exif.is_on_its_side
        reduced_from = whole if on_its_side else whole[::-1]
    return Photo(
        pixels=pixels,
        source=path,
        vertical_fov_rad=stored.exif.vertical_fov_rad(*(whole or (width, height))),
        notes=stored.notes,
        reduced_from=reduced_from,
        camera=stored.exif.camera,
        read_exif=stored.exif.directories,
    )


def photo_paths(paths: Iterable[Path | str]) -> list[Path]:
    """List the photos that `paths` name: files as given, folders as their sorted photos.

    A folder is not searched deeper; hidden files, other files and earlier previews are left out,
    and so are raw files next to a photo of the same name: phones and cameras write both.

    Raises:
        OSError: a path does not exist or a folder cannot be listed.
        ImageFileError: a folder holds no photo.
    """
    found: list[Path] = []
    for path in map(Path, paths):
        if not path.is_dir():
            path.stat()  # a missing file is refused before any work starts
            found.append(path)
            continue
        photos = _photos_in(path)
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
        # Looking for runs alone takes a third of the time; a preview grows by a twelfth.
        temporary.write_bytes(_encoded(pixels, "PNG", compress_type=_RUNS))


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


def _photos_in(folder: Path) -> list[Path]:
    """The folder's photos, sorted; a raw file only where no photo has its name."""
    found = [path for path in folder.iterdir() if _is_photo_name(path)]
    shown = {path.stem for path in found if path.suffix.lower() in PHOTO_SUFFIXES}
    return sorted(
        path for path in found if path.suffix.lower() in PHOTO_SUFFIXES or path.stem not in shown
    )


def _is_photo_name(path: Path) -> bool:
    hidden_or_result = path.name.startswith(".") or path.name.endswith(".preview.png")
    suffix = path.suffix.lower()
    return suffix in PHOTO_SUFFIXES | RAW_SUFFIXES and not hidden_or_result and path.is_file()
