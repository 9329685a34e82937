"""What a request asks for besides an address: by which name, which bytes, in which coding."""

import gzip
import ipaddress
import re
from functools import lru_cache
from pathlib import Path

SHRINKS = (".css", ".html", ".js", ".json", ".mjs", ".svg", ".txt", ".wasm", ".webmanifest")


def host_of(field: str) -> str:
    """Give the host of a Host header, without its port, in lower case; "" if it is none."""
    found = re.fullmatch(r"(\[[0-9a-f:.%]+\]|[^\[\]:/@\s]+)(:\d{1,5})?", field.strip().lower())
    return found[1].strip("[]").rstrip(".") if found else ""


def is_ours(field: str | None, names: frozenset[str], reachable: bool) -> bool:
    """Whether a Host header names this server.

    A page elsewhere can have its own name resolve to this machine (DNS rebinding) and would then
    read what we serve as its own; its requests carry that name.

    Args:
        field: the header; None, as HTTP/1.0 may leave it out, passes: browsers never do.
        names: what the server is called.
        reachable: by other machines, who may use any of its addresses.
    """
    if field is None:
        return True
    host = host_of(field)
    if host in names:
        return True
    try:
        address = ipaddress.ip_address(host)
    except ValueError:
        return False
    return reachable or address.is_loopback


def byte_range(field: str, size: int) -> tuple[int, int] | None:
    """Give (first, last) of a Range header that asks for one range; None is the whole file.

    Raises:
        ValueError: no byte of that range is there.
    """
    found = re.fullmatch(r"bytes=(\d{0,18})-(\d{0,18})", field.strip())
    if found is None or not (found[1] or found[2]):
        return None  # several ranges, or another unit: the whole is always allowed
    if not found[1]:
        first, last = max(size - int(found[2]), 0), size - 1
    else:
        first, last = int(found[1]), min(int(found[2] or size), size - 1)
        if found[2] and int(found[2]) < first:
            return None
    if first > last or not size:
        raise ValueError(f"{field} of {size}")
    return first, last


def takes_gzip(field: str) -> bool:
    """Whether an Accept-Encoding header allows gzip."""
    for part in field.lower().split(","):
        name, _, quality = part.partition(";")
        if name.strip() in ("gzip", "x-gzip", "*"):
            weight = re.fullmatch(r"\s*q\s*=\s*([01](?:\.\d*)?)\s*", quality)
            return weight is None or float(weight[1]) > 0
    return False


@lru_cache(maxsize=256)
def gzipped(path: Path, _tag: str) -> bytes | None:
    """Give a file compressed, once; None where that gains nothing.

    Raises:
        OSError: it cannot be read.
    """
    if path.suffix.lower() not in SHRINKS:
        return None
    content = path.read_bytes()
    small = gzip.compress(content, 6, mtime=0)
    return small if len(small) < 0.9 * len(content) else None
