"""Damaged files of every format, for a few seconds; `make fuzz` tries thousands."""

import os
import sys
import time
from pathlib import Path

import pytest

from lab.fuzz import readers, run
from lab.fuzz.run import Case, damaged, fuzz
from lab.fuzz.seeds import available

SECONDS = 4.0
SEED = 20785  # the same files everywhere; `make fuzz` and another --seed try others
SLOW = ("onnx", "tflite", "safetensors", "npz")  # each in a process of its own, or with torch


def test_no_damaged_file_does_harm(tmp_path: Path) -> None:
    kinds = [kind for kind in available() if kind not in SLOW]
    result = fuzz(kinds, 1000, seed=SEED, seconds=SECONDS, keep=tmp_path)
    harm = [f"{found.case} {found.reader}: {found.what}" for found in result.findings]
    assert not harm, "\n".join(harm)
    assert result.cases >= len(kinds)  # the good files; how many more depends on the machine
    assert result.largest_bytes < run.MOST_BYTES


def test_a_case_is_the_same_file_every_time() -> None:
    good = bytes(range(256)) * 4
    assert damaged(Case("png", 7, 1), good) == damaged(Case("png", 7, 1), good)
    assert damaged(Case("png", 7, 1), good) != damaged(Case("png", 8, 1), good)


def raises(path: Path) -> None:
    raise IndexError("list index out of range")


def dies(path: Path) -> None:
    os._exit(7)


def hangs(path: Path) -> None:
    time.sleep(60)


@pytest.mark.skipif(sys.platform != "linux", reason="sends readers by name to a child")
@pytest.mark.parametrize(
    ("reader", "what"), [(raises, "IndexError"), (dies, "exit code 7"), (hangs, "no answer")]
)
def test_harm_is_noticed(
    reader: object, what: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(run, "HANG_S", 3.0 if reader is hangs else 60.0)
    monkeypatch.setattr(run, "readers_of", lambda kind: (reader,))
    assert readers.readers_of("bmp")
    (found,) = fuzz(["bmp"], 1, keep=tmp_path).findings
    assert what in found.what
    assert (tmp_path / "0-0.bmp").read_bytes()[:2] == b"BM"
