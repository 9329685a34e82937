"""Camera raw files: developed as they were shot, or refused as raw where LibRaw is missing."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from jaxtyping import UInt16

from deeplight.errors import MissingExtraError
from deeplight.io.exif import MAKE, MODEL, Exif, camera_name, exif_directories, number
from deeplight.io.image_file import check_size, damaged
from deeplight.io.quiet import overheard

RAW_SUFFIXES = frozenset(
    ".3fr .arw .cr2 .cr3 .dcr .dng .erf .fff .iiq .kdc .mef .mos .mrw .nef .nrw .orf .pef .raf .raw"
    " .rw2 .rwl .srw .x3f".split()
)
"""What a folder is searched for; what counts is the content."""

_STARTS = (b"FUJIFILMCCD-RAW", b"IIRO", b"IIRS", b"MMOR", b"IIU\0", b"FOVb", b"\0MRM")
_TIFF = {b"II*\0": "<", b"MM\0*": ">"}
_COLOUR_FILTER_ARRAY, _LINEAR_RAW = 32803, 34892  # DNG 1.7: PhotometricInterpretation
_SUB_FOLDERS, _EXIF_FOLDER, _BASELINE_EXPOSURE = 330, 34665, 50730
_PHOTOMETRIC, _FOCAL, _FOCAL_35MM = 262, 37386, 41989
_MAX_FOLDERS, _MAX_ENTRIES = 32, 4096
_MAX_STOPS = 4  # of a baseline exposure that is believed
_KINDS = {1: "B", 3: "H", 4: "I", 5: "II", 7: "B", 9: "i", 10: "ii", 13: "I"}

_EXIF_OF_FLIP = (1, 2, 4, 3, 5, 8, 6, 7)  # LibRaw's: 1 mirrors, 2 turns over, 4 swaps axes first


@dataclass(frozen=True, eq=False)
class RawPhoto:
    """A developed raw file, not yet upright.

    Attributes:
        linear: linear sRGB, SIGNAL_MAX where the sensor or the first channel saturates.
        exif: what is known of the camera; its orientation is that of the pixels.
    """

    linear: UInt16[np.ndarray, "height width 3"]
    exif: Exif


def is_raw(path: Path, start: bytes) -> bool:
    """Whether a file that starts with `start` holds sensor values instead of a picture.

    A TIFF is raw if any of its directories has a colour filter array or linear raw; the first is
    often a thumbnail.

    Raises:
        OSError: the file cannot be read.
    """
    if start.startswith(_STARTS) or start[8:10] == b"CR" or start[4:12] == b"ftypcrx ":
        return True
    if start[:4] not in _TIFF:
        return False
    kinds = (folder.get(_PHOTOMETRIC, (0,))[0] for folder in _folders(path))
    return any(kind in (_COLOUR_FILTER_ARRAY, _LINEAR_RAW) for kind in kinds)


def develop(path: Path, max_pixels: int) -> RawPhoto:
    """Develop a raw file with LibRaw: as-shot white balance, the exposure that it was shot with.

    Nothing is brightened but by the baseline exposure that a DNG names; no look is applied.

    Raises:
        MissingExtraError: the `raw` extra is not installed.
        ImageFileError: too many pixels, or cut off.
        rawpy.LibRawError: LibRaw cannot read it.
    """
    try:
        import rawpy
    except ImportError as error:
        raise MissingExtraError("raw", f"reading {path.name}, a camera's raw file,") from error
    tags: dict[int, tuple[float, ...]] = {}
    for folder in _folders(path):
        tags = {**folder, **tags}  # the first directory's own go first
    with overheard() as complaints, rawpy.imread(str(path)) as file:
        check_size(path, file.sizes.width, file.sizes.height, max_pixels)
        focal_length, flip = number(file.other.focal_length) or 0.0, file.sizes.flip
        linear = file.postprocess(
            gamma=(1, 1),
            no_auto_bright=True,
            adjust_maximum_thr=0,
            use_camera_wb=True,
            output_bps=16,
            output_color=rawpy.ColorSpace.sRGB,
            user_flip=0,
        )
    if complaints:  # LibRaw prints that a file is cut off, and fills up with black
        raise damaged(path, complaints[0].removeprefix(f"{path}: "))
    named = exif_directories(path).main  # none of a raw file that is no TIFF
    exif = Exif(
        orientation=_EXIF_OF_FLIP[flip & 7],
        focal_length_35mm_mm=number(tags.get(_FOCAL_35MM)) or 0.0,
        focal_length_mm=number(tags.get(_FOCAL)) or focal_length,
        camera=camera_name(named.get(MAKE), named.get(MODEL)),
    )
    return RawPhoto(_brightened(linear, number(tags.get(_BASELINE_EXPOSURE)) or 0.0), exif)


def _brightened(
    linear: UInt16[np.ndarray, "height width 3"], stops: float
) -> UInt16[np.ndarray, "height width 3"]:
    if not 0 < abs(stops) <= _MAX_STOPS:
        return linear
    values = np.arange(65536) * 2.0**stops
    return np.minimum(values, 65535).astype(np.uint16)[linear]


def _folders(path: Path) -> Iterator[dict[int, tuple[float, ...]]]:
    """The directories of a TIFF with their sub-directories: numbers by tag; none of other files."""
    with path.open("rb") as file:
        order = _TIFF.get(file.read(4))
        if order is None:
            return
        seen: set[int] = set()
        waiting = list(struct.unpack(f"{order}I", file.read(4)))
        while waiting and len(seen) < _MAX_FOLDERS:
            at = waiting.pop(0)
            if at in seen or at == 0:
                continue
            seen.add(at)
            try:
                file.seek(at)
                (count,) = struct.unpack(f"{order}H", file.read(2))
                entries = file.read(12 * min(count, _MAX_ENTRIES))
                (following,) = struct.unpack(f"{order}I", file.read(4))
                folder: dict[int, tuple[float, ...]] = {}
                for entry in range(0, len(entries) - 11, 12):
                    tag, values = _entry(file, order, entries[entry : entry + 12])
                    folder[tag] = values
            except (struct.error, OSError, OverflowError):
                continue  # cut off: what LibRaw or the TIFF reader will say in its own words
            yield folder
            deeper = folder.get(_SUB_FOLDERS, ()) + folder.get(_EXIF_FOLDER, ())
            waiting += [int(place) for place in deeper] + [following]


def _entry(file: BinaryIO, order: str, entry: bytes) -> tuple[int, tuple[float, ...]]:
    tag, kind, count, inline = struct.unpack(f"{order}HHI4s", entry)
    form = _KINDS.get(kind)
    if form is None or not 0 < count <= 64:
        return tag, ()
    size = struct.calcsize(f"{order}{form * count}")
    content = inline[:size]
    if size > 4:
        file.seek(struct.unpack(f"{order}I", inline)[0])
        content = file.read(size)
    values = struct.unpack(f"{order}{form * count}", content)
    if len(form) == 2:
        values = tuple(
            a / b if b else float("nan") for a, b in zip(values[::2], values[1::2], strict=True)
        )
    return tag, values
