"""Write and read transfer files: small, little-endian, checked; docs/transfer.md has every byte."""

import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from deeplight.errors import ImageFileError
from deeplight.io.atomic import replacing
from deeplight.io.boundary import reads_as
from deeplight.transfer.clusters import Clusters
from deeplight.transfer.ground import MIDDLE_STEP, MOST_POINTS, Ground
from deeplight.transfer.mesh import MAX_VERTICES
from deeplight.transfer.precompute import MAX_ORDER, Glossy, Shadowed, Transfer

MAGIC, VERSION = b"DLPT", 1
GLOSSY, GROUND, COLOURS = 1, 2, 4  # flags
WIDE = 4  # columns of a table that get 16 bits
_HEADER = struct.Struct("<4sHHII4BIIHH3f3f3f2f2f12x")
_CHECKED_FROM = 16  # the checksum covers everything behind itself
_LIMITS = {"vertices": MAX_VERTICES, "triangles": 2_000_000, "ground": MOST_POINTS, "clusters": 64}
_LARGEST = 1_000_000  # number that a header, a table's scale or a matrix's may hold

LAYOUT: dict[str, Any] = {
    "magic": int.from_bytes(MAGIC, "little"),
    "version": VERSION,
    "header_bytes": _HEADER.size,
    "checked_from": _CHECKED_FROM,
    "flags": {"glossy": GLOSSY, "ground": GROUND, "colours": COLOURS},
    "wide_columns": WIDE,
    "most": {**_LIMITS, "order": MAX_ORDER, "number": _LARGEST},
    "ground_middle_step": MIDDLE_STEP,
}
"""What another reader has to know; the page's is made from it."""


@dataclass(frozen=True)
class _Header:
    flags: int
    order: int
    bounces: int
    clusters: int
    components: int
    vertices: int
    triangles: int
    ground: int
    numbers: tuple[float, ...]  # low, high, reflectivity; glossy's two; ground's two

    @property
    def coefficients(self) -> int:
        return (self.order + 1) ** 2

    @property
    def index(self) -> np.dtype[np.unsignedinteger]:
        return np.dtype("<u2" if self.vertices <= 65_536 else "<u4")

    def sections(self) -> list[tuple[str, int]]:
        """Names and bytes of what follows the header, each filled up to 4 bytes."""
        n, c = self.vertices, self.coefficients
        sizes = [("vertices", 6 * n), ("normals", 4 * n)]
        sizes.append(("triangles", 3 * self.triangles * self.index.itemsize))
        if self.flags & COLOURS:
            sizes.append(("colours", 3 * n))
        sizes.append(("diffuse", _table_bytes(n, c)))
        if self.flags & GLOSSY:
            rows = self.clusters * (self.components + 1)
            sizes += [("cluster", n), ("weights", _table_bytes(n, self.components))]
            sizes.append(("matrices", 4 * rows + rows * c * c))
        if self.flags & GROUND:
            sizes.append(("ground", _table_bytes(self.ground**2, c)))
        return sizes


def write(path: Path | str, transfer: Transfer) -> None:
    """Write a transfer, whole or not at all.

    Raises:
        OSError: the file cannot be written.
    """
    content = encode(transfer)
    with replacing(path) as temporary:
        temporary.write_bytes(content)


@reads_as(ImageFileError)
def read(path: Path | str) -> Transfer:
    """Read a transfer.

    Raises:
        OSError: there is no such file.
        ImageFileError: it is none, damaged, or larger than any that is written.
    """
    return decode(Path(path).read_bytes(), str(path))


def encode(transfer: Transfer) -> bytes:
    """The bytes of a transfer file."""
    header = _header_of(transfer)
    low, high = np.array(header.numbers[:3]), np.array(header.numbers[3:6])
    span = np.maximum(high - low, 1e-9)
    steps = np.round((transfer.vertices - low) / span * 65_535)
    parts = {
        "vertices": np.clip(steps, 0, 65_535).astype("<u2").tobytes(),
        "normals": _octahedral(transfer.normals).tobytes(),
        "triangles": transfer.triangles.astype(header.index).tobytes(),
        "diffuse": _table(transfer.diffuse),
    }
    if transfer.colours is not None:
        parts["colours"] = transfer.colours.tobytes()
    if transfer.glossy is not None:
        clusters = transfer.glossy.clusters
        parts["cluster"] = clusters.cluster.astype(np.uint8).tobytes()
        parts["weights"] = _table(clusters.weights)
        parts["matrices"] = _matrices(clusters.matrices)
    if transfer.shadowed is not None:
        parts["ground"] = _table(transfer.shadowed.transfer)
    body = b"".join(_filled(parts[name], size) for name, size in header.sections())
    fields = [header.order, header.bounces, header.clusters, header.components]
    fields += [header.vertices, header.triangles, header.ground, 0]
    total = _HEADER.size + len(body)
    head = _HEADER.pack(MAGIC, VERSION, header.flags, total, 0, *fields, *header.numbers)
    checksum = zlib.crc32(body, zlib.crc32(head[_CHECKED_FROM:]))
    return head[:12] + struct.pack("<I", checksum) + head[_CHECKED_FROM:] + body


def decode(content: bytes, name: str = "the transfer") -> Transfer:
    """A transfer from its bytes; `name` is what errors call it.

    Raises:
        ImageFileError: no transfer, or a damaged one.
    """
    header = _checked(content, name)
    parts, at = {}, _HEADER.size
    for section, size in header.sections():
        parts[section] = content[at : at + size]
        at += size + (-size) % 4
    n, c = header.vertices, header.coefficients
    low, high = np.array(header.numbers[:3]), np.array(header.numbers[3:6])
    steps = np.frombuffer(parts["vertices"], "<u2").reshape(n, 3)
    triangles = np.frombuffer(parts["triangles"], header.index).reshape(-1, 3).astype(np.int64)
    if triangles.max() >= n:
        raise _damaged(name, "a triangle of vertices that are not there")
    colours = None
    if header.flags & COLOURS:
        colours = np.frombuffer(parts["colours"], np.uint8).reshape(n, 3)
    red, green, blue = header.numbers[6:9]
    return Transfer(
        order=header.order,
        bounces=header.bounces,
        vertices=(low + steps * ((high - low) / 65_535)).astype(np.float32),
        normals=_from_octahedral(np.frombuffer(parts["normals"], "<i2").reshape(n, 2)),
        triangles=triangles,
        reflectivity=(red, green, blue),
        colours=colours,
        diffuse=_from_table(parts["diffuse"], n, c, name),
        glossy=_glossy(header, parts, name) if header.flags & GLOSSY else None,
        shadowed=_shadowed(header, parts["ground"], name) if header.flags & GROUND else None,
    )


def _header_of(transfer: Transfer) -> _Header:
    glossy, shadowed = transfer.glossy, transfer.shadowed
    low, high = transfer.vertices.min(0), transfer.vertices.max(0)
    numbers: Sequence[float] = [*low.tolist(), *high.tolist(), *transfer.reflectivity]
    shape = glossy.clusters.matrices.shape if glossy else (0, 1, 0, 0)
    about_glossy = (glossy.reflectivity, glossy.roughness) if glossy else (0.0, 0.0)
    plane = shadowed.ground if shadowed else None
    about_ground = (plane.half, plane.reflectivity) if plane else (0.0, 0.0)
    flags = GLOSSY * (glossy is not None) + GROUND * (plane is not None)
    return _Header(
        flags=flags + COLOURS * (transfer.colours is not None),
        order=transfer.order,
        bounces=transfer.bounces,
        clusters=shape[0],
        components=shape[1] - 1,
        vertices=len(transfer.vertices),
        triangles=len(transfer.triangles),
        ground=plane.size if plane else 0,
        numbers=(*numbers, *about_glossy, *about_ground),
    )


def _checked(content: bytes, name: str) -> _Header:
    """The header of a file whose size and checksum are right."""
    if len(content) < _HEADER.size or content[:4] != MAGIC:
        raise ImageFileError("a transfer file", f"{name}, which is none", "make it again")
    _, version, flags, total, checksum, *rest = _HEADER.unpack_from(content)
    if version != VERSION:
        got = f"{name} of version {version}"
        raise ImageFileError(f"a transfer file of version {VERSION}", got, "make it again")
    order, bounces, clusters, components, vertices, triangles, ground, _, *numbers = rest
    header = _Header(
        flags, order, bounces, clusters, components, vertices, triangles, ground, tuple(numbers)
    )
    counts = {"vertices": vertices, "triangles": triangles, "ground": ground, "clusters": clusters}
    fits = all(counts[what] <= most for what, most in _LIMITS.items())
    some = min(vertices, triangles, order) >= 1 and flags < 8
    some = some and (not flags & GLOSSY or min(clusters, components) >= 1)
    some = some and (not flags & GROUND or (ground >= 2 and 0 <= numbers[12] <= 1))
    if not (fits and some and order <= MAX_ORDER and _sane(numbers)):
        raise _damaged(name, "a header with numbers out of range")
    size = _HEADER.size + sum(size + (-size) % 4 for _, size in header.sections())
    if len(content) != size or total != size:
        raise _damaged(name, f"{len(content):,} bytes where its header says {size:,}")
    if zlib.crc32(content[_CHECKED_FROM:]) != checksum:
        raise _damaged(name, "another checksum than its own")
    return header


def _sane(numbers: Any) -> bool:
    return bool((np.abs(numbers) <= _LARGEST).all())  # nan is not


def _damaged(name: str, how: str) -> ImageFileError:
    return ImageFileError("a whole transfer file", f"{name} with {how}", "make it again")


def _glossy(header: _Header, parts: dict[str, bytes], name: str) -> Glossy:
    c, count = header.coefficients, header.clusters
    shape = count, header.components + 1, c, c
    cluster = np.frombuffer(parts["cluster"], np.uint8).astype(np.int64)
    if cluster.max() >= count:
        raise _damaged(name, "a cluster that is not there")
    weights = _from_table(parts["weights"], header.vertices, header.components, name)
    rows = shape[0] * shape[1]
    scale = np.frombuffer(parts["matrices"][: 4 * rows], "<f4")
    steps = np.frombuffer(parts["matrices"][4 * rows :], np.int8).reshape(rows, -1)
    if not _sane(scale):
        raise _damaged(name, "numbers out of range")
    matrices = (steps * scale[:, None]).astype(np.float32).reshape(shape)
    reflectivity, roughness = header.numbers[9:11]
    return Glossy(reflectivity, roughness, Clusters(cluster, weights, matrices))


def _shadowed(header: _Header, table: bytes, name: str) -> Shadowed:
    half, reflectivity = header.numbers[11:13]
    transfer = _from_table(table, header.ground**2, header.coefficients, name)
    return Shadowed(Ground(header.ground, half, reflectivity), transfer)


def _filled(part: bytes, size: int) -> bytes:
    assert len(part) == size
    return part + b"\0" * (-size % 4)


def _table_bytes(rows: int, columns: int) -> int:
    wide = min(WIDE, columns)
    return 8 * columns + 2 * rows * wide + rows * (columns - wide)


def _table(values: np.ndarray) -> bytes:
    """Columns of numbers in even steps between each column's least and greatest."""
    columns = values.shape[1]
    wide = min(WIDE, columns)
    levels = np.array([65_535] * wide + [255] * (columns - wide), np.float32)
    low = values.min(0).astype("<f4")
    step = ((values.max(0) - low) / levels).astype("<f4")
    number = np.round((values - low) / np.maximum(step, 1e-30))
    number = np.clip(number, 0, levels).T
    first, rest = number[:wide].astype("<u2").tobytes(), number[wide:].astype(np.uint8).tobytes()
    return np.stack([low, step], -1).tobytes() + first + rest


def _from_table(part: bytes, rows: int, columns: int, name: str) -> np.ndarray:
    wide, at = min(WIDE, columns), 8 * columns
    low, step = np.frombuffer(part[:at], "<f4").reshape(columns, 2).T
    if not (_sane(low) and _sane(step)):
        raise _damaged(name, "numbers out of range")
    first = np.frombuffer(part[at : at + 2 * rows * wide], "<u2").reshape(wide, rows)
    rest = np.frombuffer(part[at + 2 * rows * wide :], np.uint8).reshape(columns - wide, rows)
    number = np.concatenate([first.astype(np.float32), rest.astype(np.float32)])
    result: np.ndarray = low + number.T * step
    return result


def _matrices(matrices: np.ndarray) -> bytes:
    """A scale for each matrix, then signed bytes."""
    flat = matrices.reshape(-1, matrices.shape[2] * matrices.shape[3])
    scale = (np.abs(flat).max(1) / 127).astype("<f4")
    steps = np.round(flat / np.maximum(scale, 1e-30)[:, None]).astype(np.int8)
    return scale.tobytes() + steps.tobytes()


def _octahedral(normals: np.ndarray) -> np.ndarray:
    """Unit vectors as two numbers: an octahedron unfolded onto a square (Meyer et al. 2010)."""
    flat = normals / np.abs(normals).sum(-1, keepdims=True)
    side = np.where(flat[:, :2] >= 0, 1.0, -1.0)
    folded = (1 - np.abs(flat[:, 1::-1])) * side
    square = np.where(flat[:, 2:] >= 0, flat[:, :2], folded)
    return np.round(np.clip(square, -1, 1) * 32_767).astype("<i2")


def _from_octahedral(square: np.ndarray) -> np.ndarray:
    flat = np.clip(square / 32_767.0, -1, 1)
    height = 1 - np.abs(flat).sum(-1, keepdims=True)
    folded = (1 - np.abs(flat[:, ::-1])) * np.where(flat >= 0, 1.0, -1.0)
    vectors = np.concatenate([np.where(height >= 0, flat, folded), height], -1)
    unit: np.ndarray = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return unit.astype(np.float32)
