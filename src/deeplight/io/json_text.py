"""Read JSON that a stranger wrote: bounded in size, depth and numbers."""

import json
import math
import stat
from pathlib import Path
from typing import Any, NoReturn

MAX_BYTES = 100_000_000
MAX_VALUES = 5_000_000
"""Most commas and opened brackets, which bounds the number of values before any is made."""


def parse_json(text: bytes | str, finite: bool = True) -> Any:
    """Give the value of a JSON text; every fault of the text is one ValueError.

    Stricter than `json.loads`: no NaN, no infinity and no number beyond float64, none of which
    JSON has; nor enough values that they would fill the memory, nor nesting without end.

    Args:
        text: UTF-8 if bytes, with or without a byte order mark.
        finite: refuse NaN and infinities; only files of our own making may hold them.

    Raises:
        ValueError: not JSON (json.JSONDecodeError), or beyond the limits above.
    """
    if len(text) > MAX_BYTES:
        raise ValueError(f"{len(text) / 1e6:.0f} MB of JSON")
    if isinstance(text, bytes):
        text = text.decode("utf-8-sig")
    values = sum(text.count(mark) for mark in ",[{")
    if values > MAX_VALUES:
        raise ValueError(f"JSON of {values:,} values")
    try:
        if not finite:
            return json.loads(text, parse_int=_bounded)
        return json.loads(text, parse_constant=_refused, parse_float=_finite, parse_int=_bounded)
    except RecursionError:
        raise ValueError("JSON nested too deep") from None


def read_json(path: Path) -> Any:
    """Give the value of a JSON file; see `parse_json`.

    Raises:
        OSError: there is no such file, or reading it is not permitted.
        ValueError: no JSON in UTF-8, no regular file, or beyond the limits above.
    """
    status = path.stat()
    if not stat.S_ISREG(status.st_mode) and not stat.S_ISDIR(status.st_mode):
        raise ValueError("a device or pipe")
    if status.st_size > MAX_BYTES:
        raise ValueError(f"{status.st_size / 1e6:.0f} MB of JSON")
    return parse_json(path.read_bytes())


def _refused(word: str) -> NoReturn:
    raise ValueError(f"{word}, which is no JSON")


def _finite(digits: str) -> float:
    value = float(digits)
    if not math.isfinite(value):
        raise ValueError(f"the number {digits[:20]}, too large")
    return value


def _bounded(digits: str) -> int:
    if len(digits) > 20:
        raise ValueError(f"a whole number of {len(digits)} digits")
    return int(digits)
