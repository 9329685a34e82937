"""Read NumPy's .npz and .npy files that a stranger wrote, within a bound."""

import io
import math
import stat
import zipfile
from pathlib import Path

import numpy as np
from numpy.lib import format as npy

MAX_BYTES = 1_000_000_000
_PLAIN = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}


def read_arrays(path: Path | str, max_bytes: int = MAX_BYTES) -> dict[str, np.ndarray]:
    """Give all arrays of an .npz by name; pickled objects are refused.

    Nothing is unpacked before the sizes that the archive announces are found to fit, and each
    array's header has to agree with the bytes behind it.

    Raises:
        OSError: there is no such file, or reading it is not permitted.
        ValueError: no .npz, damaged, encrypted, or of more than `max_bytes` unpacked.
    """
    path = Path(path)
    _refuse_irregular(path)
    with path.open("rb") as file:
        try:
            archive = zipfile.ZipFile(file)
            members = archive.infolist()
            total = sum(member.file_size for member in members)
            if total > max_bytes:
                raise ValueError(f"{total / 1e6:,.0f} MB unpacked")
            return {
                member.filename.removesuffix(".npy"): array_of(_unpacked(archive, member))
                for member in members
            }
        except ValueError:
            raise
        except Exception as error:  # zipfile's and zlib's own, and what they run into
            raise ValueError(f"a damaged or odd archive ({error})") from error


def read_array(path: Path | str, max_bytes: int = MAX_BYTES) -> np.ndarray:
    """Give the array of a .npy file.

    Raises:
        OSError: there is no such file, or reading it is not permitted.
        ValueError: no .npy, damaged, or of more than `max_bytes`.
    """
    path = Path(path)
    _refuse_irregular(path)
    if path.stat().st_size > max_bytes:
        raise ValueError(f"{path.stat().st_size / 1e6:,.0f} MB")
    return array_of(path.read_bytes())


def array_of(content: bytes) -> np.ndarray:
    """Give the array that the content of a .npy file holds.

    Raises:
        ValueError: it is damaged: its header and the bytes behind it disagree.
    """
    file = io.BytesIO(content)
    try:
        reader = _HEADERS[npy.read_magic(file)]
        shape, by_column, dtype = reader(file)
    except Exception as error:  # NumPy reads the header as Python
        raise ValueError(f"a header that is none ({type(error).__name__})") from error
    start = file.tell()
    size = math.prod(shape) * dtype.itemsize
    if dtype.hasobject or min(shape, default=0) < 0 or len(content) - start != size:
        raise ValueError(f"an array of {shape} {dtype} in {len(content) - start:,} bytes")
    values = np.frombuffer(content, dtype, offset=start)
    return values.reshape(shape, order="F" if by_column else "C").copy()


def _unpacked(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> bytes:
    if member.flag_bits & 1:
        raise ValueError("an encrypted archive")
    if member.compress_type not in _PLAIN:
        raise ValueError(f"an archive compressed by method {member.compress_type}")
    with archive.open(member) as file:
        return file.read(member.file_size + 1)  # never more than announced


def _refuse_irregular(path: Path) -> None:
    if not stat.S_ISREG(path.stat().st_mode) and not path.is_dir():
        raise ValueError("a device or pipe")
