"""Arrays and JSON that a stranger made: bounded, and one kind of error."""

import io
import json
import os
import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deeplight.dataset.manifest import read_json as read_data_set_json
from deeplight.errors import DataSetError, ImageFileError
from deeplight.io.arrays_file import array_of, read_array, read_arrays
from deeplight.io.json_text import MAX_VALUES, parse_json, read_json
from deeplight.io.lighting_file import read_lighting_json

CASES = Path(__file__).parents[3] / "shared" / "cases" / "hostile"
VALUES = {"a": np.arange(12, dtype="<f4").reshape(3, 4), "b": np.asfortranarray(np.eye(3)), "c": 7}


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_arrays_come_back_as_they_were_saved(save: Any, tmp_path: Path) -> None:
    save(tmp_path / "a.npz", **VALUES)
    found = read_arrays(tmp_path / "a.npz")
    assert found.keys() == VALUES.keys()
    for name, value in VALUES.items():
        assert np.array_equal(found[name], value)
        np.save(tmp_path / "a.npy", value)
        assert np.array_equal(read_array(tmp_path / "a.npy"), value)
    found["a"][0] = 1  # and may be written to


def npy(header: str, content: bytes = bytes(16)) -> bytes:
    text = header.encode().ljust(118)
    return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + content


HEADER = "{'descr': '<f4', 'fortran_order': False, 'shape': (4,), }"
LIES = {
    "4 TiB": npy(HEADER.replace("(4,)", "(1099511627776,)")),
    "overflow": npy(HEADER.replace("(4,)", "(4294967296, 4294967296)")),
    "too short": npy(HEADER, bytes(15)),
    "too long": npy(HEADER, bytes(17)),
    "negative": npy(HEADER.replace("(4,)", "(-4, -1)")),
    "objects": npy(HEADER.replace("<f4", "|O")),
    "code": npy("__import__('os').abort()"),
    "deep": npy("(" * 110),
    "no magic": b"NUMPY",
    "nothing": b"",
    "version": b"\x93NUMPY\x09\x00" + npy(HEADER)[8:],
}


def test_the_header_that_the_lies_change_is_right() -> None:
    assert array_of(npy(HEADER)).shape == (4,)


@pytest.mark.parametrize("lie", LIES)
def test_a_lying_array_is_a_value_error(lie: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"\w"):
        array_of(LIES[lie])
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("a.npy", LIES[lie])
    with pytest.raises(ValueError, match=r"\w"):
        read_arrays(tmp_path / "a.npz")


def archive(change: Any = None, content: bytes = npy(HEADER)) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as made:
        made.writestr("a.npy", content)
    written = bytearray(file.getvalue())
    if change is not None:
        central = written.index(b"PK\x01\x02")
        for start, at in ((0, 6), (central, 8)):  # flags, then the method, in both headers
            change(written, start + at)
    return bytes(written)


def encrypted(written: bytearray, at: int) -> None:
    written[at] |= 1


def odd(written: bytearray, at: int) -> None:
    written[at + 2] = 99


@pytest.mark.parametrize(
    "content",
    [
        archive(encrypted),
        archive(odd),
        archive()[:-30],
        archive()[:60],
        b"PK\x03\x04",
        b"",
        b"x" * 99,
    ],
    ids=["encrypted", "odd method", "cut off", "a header", "a mark", "empty", "no archive"],
)
def test_an_odd_archive_is_a_value_error(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "a.npz").write_bytes(content)
    with pytest.raises(ValueError, match=r"\w"):
        read_arrays(tmp_path / "a.npz")


def test_a_zip_bomb_is_not_unpacked(tmp_path: Path) -> None:
    bomb = archive(content=npy(HEADER.replace("(4,)", "(5000000,)"), bytes(20_000_000)))
    assert len(bomb) < 30_000
    (tmp_path / "a.npz").write_bytes(bomb)
    with pytest.raises(ValueError, match="20 MB unpacked"):
        read_arrays(tmp_path / "a.npz", max_bytes=10_000_000)
    assert read_arrays(tmp_path / "a.npz", max_bytes=30_000_000)["a"].shape == (5_000_000,)
    lying = bytearray(bomb)  # it announces sixteen bytes
    central = lying.index(b"PK\x01\x02")
    lying[central + 24 : central + 28] = struct.pack("<I", 16)
    (tmp_path / "a.npz").write_bytes(lying)
    with pytest.raises(ValueError, match=r"\w"):
        read_arrays(tmp_path / "a.npz", max_bytes=10_000_000)


def test_pipes_are_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for read in (read_arrays, read_array, read_json):
        with pytest.raises(ValueError, match="pipe"):
            read(tmp_path / "pipe")


BAD_JSON = {
    "deep": "[" * 100_000,
    "deep objects": '{"a":' * 50_000,
    "infinity": "[Infinity]",
    "nan": '{"a": NaN}',
    "beyond float64": "[1e999]",
    "digits": "9" * 5000,
    "cut off": '{"a": [1, 2',
    "empty": "",
    "not UTF-8": b'{"a": "\xff"}',
    "many": "[" + "0," * (MAX_VALUES + 1) + "0]",
}


@pytest.mark.parametrize("kind", BAD_JSON)
def test_bad_json_is_a_value_error(kind: str, tmp_path: Path) -> None:
    text = BAD_JSON[kind]
    content = text if isinstance(text, bytes) else text.encode()
    with pytest.raises(ValueError, match=r"\w"):
        parse_json(content)
    (tmp_path / "plan.json").write_bytes(content)
    with pytest.raises(DataSetError) as refused:
        read_data_set_json(tmp_path / "plan.json")
    assert "\n" not in str(refused.value)
    with pytest.raises(ImageFileError):
        read_lighting_json(tmp_path / "plan.json")


def test_json_is_read_as_python_reads_it() -> None:
    value = {"a": [1, -2.5, 1e-300, 2**60], "b": {"c": None, "d": True}, "é": "ü"}
    assert parse_json(json.dumps(value)) == value
    assert parse_json(b"\xef\xbb\xbf" + json.dumps(value, ensure_ascii=False).encode()) == value
    assert parse_json("[Infinity]", finite=False) == [float("inf")]


@pytest.mark.skipif(not CASES.exists(), reason="needs ../shared/cases")
def test_the_collected_files_are_refused() -> None:
    for name in ("lie.npz", "enc.npz", "method99.npz"):
        with pytest.raises(ValueError, match=r"\w"):
            read_arrays(CASES / name)
    for name in ("deep.json", "size_inf.json", "empty.json"):
        with pytest.raises(ImageFileError) as refused:
            read_lighting_json(CASES / name)
        assert "\n" not in str(refused.value)
