"""The container of a glTF 2.0 file: its JSON, buffers, pictures, and the arrays in them.

Accessors are read as the specification says (section 3.6.2): normalised integers become fractions,
interleaved ones are taken apart, sparse ones patched. Nothing is allocated for a count that the
file's own bytes do not bear out, other than zeros within `MAX_NUMBERS`.
"""

import base64
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import unquote, unquote_to_bytes, urlsplit

import numpy as np
from jaxtyping import Num

from deeplight.errors import ImageFileError
from deeplight.io.json_text import parse_json
from deeplight.io.neighbour import neighbour

MAX_BYTES = 500_000_000
MAX_NUMBERS = 50_000_000
DO = "export it again, as plain glTF 2.0"

_DTYPES: Mapping[int, str] = {
    5120: "i1",
    5121: "u1",
    5122: "<i2",
    5123: "<u2",
    5125: "<u4",
    5126: "<f4",
}
_WIDTHS: Mapping[str, int] = {
    "SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16
}  # fmt: skip
_URL_SAFE = bytes.maketrans(b"-_", b"+/")
_MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")


class GltfFile:
    """One file, its buffers read when they are first asked for.

    Raises:
        ImageFileError: no glTF 2.0.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        content = path.read_bytes()
        text, self._chunk = _parts(content, path) if content[:4] == b"glTF" else (content, None)
        try:
            self.json = parse_json(text)
        except ValueError as error:
            raise self.fault(
                f"JSON that cannot be read ({' '.join(str(error).split())[:80]})"
            ) from error
        if not isinstance(self.json, dict) or "asset" not in self.json:
            raise ImageFileError("a glTF file", f"{path}, which is none", "give another file")
        version = str(self.json["asset"].get("version", ""))
        if not version.startswith("2."):
            raise ImageFileError("glTF 2.0", f"{path} of version {version[:10]}", DO)
        self._buffers: dict[int, bytes] = {}

    def fault(self, what: str) -> ImageFileError:
        """Make the error for a file that breaks the specification."""
        return ImageFileError("a whole glTF file", f"{self.path} with {what}", DO)

    def item(self, kind: str, index: Any) -> dict[str, Any]:
        """Give one entry of the JSON's lists, say ("meshes", 3)."""
        entries = self.json.get(kind)
        here = isinstance(entries, list) and isinstance(index, int) and 0 <= index < len(entries)
        if not here or not isinstance(entries[index], dict):
            raise self.fault(f"no {kind}[{str(index)[:10]}]")
        return dict(entries[index])

    def accessor(self, index: Any) -> Num[np.ndarray, "count width"]:
        """Read an accessor: float64 if it holds floats or fractions, int64 otherwise."""
        entry = self.item("accessors", index)
        count, width = int(entry["count"]), _WIDTHS.get(entry["type"], 0)
        if not 0 < count * width <= MAX_NUMBERS:
            raise self.fault(f"accessor {index} of {count:,} x {width}")
        dtype = np.dtype(_DTYPES[entry["componentType"]])
        if "bufferView" in entry:
            place = (entry["bufferView"], int(entry.get("byteOffset", 0)))
            values = self._table(*place, count, width, dtype).copy()
        else:
            values = np.zeros((count, width), dtype)
        if "sparse" in entry:
            self._patch(values, entry["sparse"])
        if dtype.kind == "f":
            return values.astype(np.float64)
        if not entry.get("normalized", False):
            return values.astype(np.int64)
        return np.maximum(values / float(np.iinfo(dtype).max), -1.0)

    def picture(self, index: Any) -> bytes:
        """Give an image's file content.

        Raises:
            OSError: it lies in a file of its own that cannot be read.
        """
        image = self.item("images", index)
        if "uri" in image:
            return self._at(str(image["uri"]))
        return self.view(image["bufferView"])

    def view(self, index: Any) -> bytes:
        """Give the bytes of a buffer view."""
        entry = self.item("bufferViews", index)
        squeezed = next((name for name in _MESHOPT if name in entry.get("extensions", {})), None)
        content = self._buffer(entry["buffer"], squeezed)
        start, length = int(entry.get("byteOffset", 0)), int(entry["byteLength"])
        if start < 0 or length < 0 or start + length > len(content):
            raise self.fault(f"buffer view {index} beyond its buffer's {len(content):,} bytes")
        return content[start : start + length]

    def _table(
        self, view: Any, offset: int, count: int, width: int, dtype: np.dtype[Any]
    ) -> Num[np.ndarray, "count width"]:
        content = self.view(view)
        packed = width * dtype.itemsize
        stride = int(self.item("bufferViews", view).get("byteStride", 0)) or packed
        end = offset + stride * (count - 1) + packed
        if offset < 0 or stride < packed or end > len(content):
            raise self.fault(f"an accessor that needs {end:,} of {len(content):,} bytes")
        return np.ndarray((count, width), dtype, content, offset, (stride, dtype.itemsize))

    def _patch(self, values: Num[np.ndarray, "count width"], sparse: Mapping[str, Any]) -> None:
        count, (length, width) = int(sparse["count"]), values.shape
        if not 0 < count <= length:
            raise self.fault(f"{count:,} sparse values of {length:,}")
        where, what = sparse["indices"], sparse["values"]
        kind = np.dtype(_DTYPES[where["componentType"]])
        rows = self._table(where["bufferView"], int(where.get("byteOffset", 0)), count, 1, kind)
        if kind.kind != "u" or rows.max() >= length:
            raise self.fault("sparse values of vertices that are not there")
        start = int(what.get("byteOffset", 0))
        values[rows[:, 0]] = self._table(what["bufferView"], start, count, width, values.dtype)

    def _buffer(self, index: Any, squeezed: str | None = None) -> bytes:
        if index not in self._buffers:
            entry = self.item("buffers", index)
            content = self._at(str(entry["uri"])) if "uri" in entry else self._chunk
            if index != 0 and "uri" not in entry:
                content = None  # only the first may be the container's chunk
            if content is None:
                what = (
                    f"arrays compressed by {squeezed}"
                    if squeezed
                    else f"no bytes of buffer {index}"
                )
                raise self.fault(what)
            if len(content) < int(entry["byteLength"]):
                raise self.fault(f"{len(content):,} of {entry['byteLength']:,} bytes of a buffer")
            self._buffers[index] = content
        return self._buffers[index]

    def _at(self, uri: str) -> bytes:
        """Read what a URI names: data written out, or a file (its name percent-encoded)."""
        if uri.startswith("data:"):
            head, _, text = uri.partition(",")
            data = unquote_to_bytes(text)
            if not head.endswith(";base64"):
                return data
            plain = b"".join(data.split()).translate(_URL_SAFE).rstrip(b"=")
            try:
                return base64.b64decode(plain + b"=" * (-len(plain) % 4), validate=True)
            except ValueError as error:
                raise self.fault("data that is no base64") from error
        try:
            return neighbour(self.path, unquote(uri), MAX_BYTES)
        except FileNotFoundError:
            if urlsplit(uri).scheme in ("http", "https", "file"):
                raise self.fault(f"a part at {uri[:40]}, not next to it") from None
            return neighbour(self.path, uri, MAX_BYTES)  # some writers do not encode


def _parts(content: bytes, path: Path) -> tuple[bytes, bytes | None]:
    """Take a .glb apart: its JSON and the chunk of bytes behind it, if any."""
    version = int.from_bytes(content[4:8], "little")
    if version != 2:
        raise ImageFileError("glTF 2.0", f"{path} of version {version}", DO)
    chunks: dict[bytes, bytes] = {}
    start = 12
    while start + 8 <= len(content):
        length, kind = (
            int.from_bytes(content[start : start + 4], "little"),
            content[start + 4 : start + 8],
        )
        if start + 8 + length > len(content):
            break
        chunks.setdefault(kind, content[start + 8 : start + 8 + length])
        start += 8 + length
    if b"JSON" not in chunks:
        raise ImageFileError("a whole glTF file", f"{path}, cut off", "copy or download it again")
    return chunks[b"JSON"], chunks.get(b"BIN\0")
