"""Open an image file with OpenImageIO: every failure becomes one clear error.

The size is checked from the header, before a single pixel is decoded.
"""

import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import OpenImageIO as oiio

from deeplight.errors import ImageFileError
from deeplight.io.atomic import replacing
from deeplight.io.quiet import hushed
from deeplight.io.radiance_pixels import plain_hdr

GAIN_MAP_NAMES = (b"hdrgm", b":21496")  # Adobe's and ISO's
GAIN_MAP_WITHIN = 200_000  # bytes: behind at most two segments of other metadata
MAX_SIDE = 30_000
"""Longest side in pixels that is read; longer ones are mistakes or attacks."""


def first_bytes(path: Path, count: int = 16) -> bytes:
    """Read the start of a regular file.

    Raises:
        OSError: there is no such file, it is a folder, or reading it is not permitted.
        ImageFileError: the file is empty or no regular file.
    """
    mode = path.stat().st_mode
    if not (stat.S_ISREG(mode) or stat.S_ISDIR(mode)):  # opening a pipe would wait for ever
        raise ImageFileError("a regular file", f"{path}, a device or pipe", "copy it into one")
    with path.open("rb") as file:
        start = file.read(count)
    if not start:
        raise ImageFileError("a whole file", f"{path}, 0 bytes long", "copy or download it again")
    return start


@contextmanager
def opened(path: Path, max_pixels: int) -> Iterator[oiio.ImageInput]:
    """Open `path` and check its size, header only. Alpha stays unassociated.

    Raises:
        OSError: there is no such file, it is a folder, or reading it is not permitted.
        ImageFileError: not an image, a damaged header, or more than `max_pixels` or `MAX_SIDE`.
    """
    start = first_bytes(path)
    plain = plain_hdr(path, max_pixels) if start.startswith(b"#?") else None
    chatter = hushed() if _is_talked_about(path, start) else nullcontext()
    with _openable(path, plain) as name, chatter:
        straight_alpha = oiio.ImageSpec()
        straight_alpha.attribute("oiio:UnassociatedAlpha", 1)
        file = oiio.ImageInput.open(name, straight_alpha)
        if file is None:
            raise not_an_image(path, oiio.geterror())
        try:
            check_size(path, file.spec().width, file.spec().height, max_pixels)
            yield file
        finally:
            file.close()


def _is_talked_about(path: Path, start: bytes) -> bool:
    """Whether a decoder prints what is wrong: libpng, and libultrahdr of a JPEG with a gain map."""
    if not start.startswith(b"\xff\xd8\xff"):
        return start.startswith(b"\x89PNG")
    head = first_bytes(path, GAIN_MAP_WITHIN)
    return any(name in head for name in GAIN_MAP_NAMES)


@contextmanager
def _openable(path: Path, content: bytes | None) -> Iterator[str]:
    """A name by which OpenImageIO can read the file, or `content` instead: it takes UTF-8 alone."""
    if is_utf8(path) and content is None:
        yield str(path)
        return
    with TemporaryDirectory(prefix="deeplight-") as folder:
        suffix = path.suffix if is_utf8(Path(path.suffix)) else ""
        stand_in = Path(folder) / f"picture{suffix}"
        if content is not None:
            stand_in.write_bytes(content)
        else:
            stand_in.symlink_to(path.absolute())
        yield str(stand_in)


def is_utf8(path: Path) -> bool:
    """Whether a path's bytes are UTF-8, as many libraries need it."""
    try:
        os.fsencode(path).decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True


def write_image(path: Path, spec: oiio.ImageSpec, pixels: np.ndarray) -> None:
    """Write an image whole or not at all; the same pixels give the same bytes.

    Raises:
        OSError: the file cannot be written.
        ImageFileError: no format of that suffix.
    """
    spec.attribute("DateTime", "")  # left out, OpenImageIO writes the time of day
    with replacing(path) as temporary:
        if not is_utf8(temporary):
            got = f"{ascii(str(path.parent))}, whose name is not UTF-8"
            raise ImageFileError("a folder to write into", got, "rename it, or give another")
        file = oiio.ImageOutput.create(str(temporary))
        if file is None:
            oiio.geterror()  # or OpenImageIO prints it when the process ends
            raise ImageFileError("a name ending in .exr or .hdr", f"{path}", "rename the output")
        written = file.open(str(temporary), spec) and file.write_image(np.ascontiguousarray(pixels))
        # Closing flushes, so a full disk may show only there.
        if not (file.close() and written):
            raise OSError(f"cannot write {path}: {file.geterror().strip() or 'disk full?'}")


def check_size(path: Path, width: int, height: int, max_pixels: int) -> None:
    """Refuse an image that is too large to decode.

    Raises:
        ImageFileError: a side over `MAX_SIDE`, or more than `max_pixels` in all.
    """
    if max(width, height) <= MAX_SIDE and width * height <= max_pixels:
        return
    expected = f"at most {MAX_SIDE} pixels a side and {max_pixels / 1e6:.0f} megapixels in all"
    raise ImageFileError(expected, f"{path} of {width} x {height}", "make it smaller first")


def not_an_image(path: Path, reason: str) -> ImageFileError:
    """Make the error for a file that no decoder takes."""
    if "Subsampled channels" in reason:
        got = f"{path} with luminance and chroma of fewer pixels"
        return ImageFileError("an EXR of red, green and blue", got, "save it as RGB")
    reason = _printable(" ".join(reason.replace(str(path), "the file").split()))[:160]
    got = f"{path}, which cannot be read ({reason})" if reason else f"{path}, which cannot be read"
    return ImageFileError("an image file", got, "check that it is a complete picture")


def damaged(path: Path, reason: str) -> ImageFileError:
    """Make the error for an image whose header is fine and whose pixels are not."""
    lines = reason.strip().splitlines() or ["decoding failed"]
    got = f"{path}, truncated or damaged ({_printable(lines[0])[:160]})"
    return ImageFileError("a complete image file", got, "copy or download it again")


def _printable(text: str) -> str:
    """Spell out what a damaged header brought into a library's words."""
    return text if text.isprintable() else ascii(text)[1:-1]
