"""What the live page shares with Python is up to date; a change on this side shows here.

After a change that is meant, a new model for one: `python tests/golden/make_web.py`, and commit.
"""

import base64
import json
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from scripts import web_maker

REMEDY = "run python tests/golden/make_web.py and commit what it writes"


@pytest.fixture(scope="module")
def make_web(root: Path) -> ModuleType:
    """The script that writes the golden files, as a module."""
    return web_maker(root, "make_web")


def test_the_constants_are_those_of_the_package(make_web: ModuleType) -> None:
    assert make_web.GENERATED.read_text(encoding="utf-8") == make_web.generated(), REMEDY


@pytest.mark.parametrize("name", ["light", "photo"])
def test_golden_values_are_those_of_the_package(make_web: ModuleType, name: str) -> None:
    stored = json.loads((make_web.GOLDEN / f"{name}.json").read_text(encoding="utf-8"))
    fresh = getattr(make_web, f"{name}_golden")()
    assert differences(stored, json.loads(json.dumps(fresh))) == [], REMEDY


def test_a_photo_in_its_light_is_that_of_the_package(root: Path, make_web: ModuleType) -> None:
    make = web_maker(root, "make_web_scene")
    stored = json.loads(make.FILE.read_text(encoding="utf-8"))
    remedy = REMEDY.replace("make_web", "make_web_scene")
    assert differences(stored, json.loads(json.dumps(make.golden()))) == [], remedy


def test_a_changed_value_would_be_found() -> None:
    def packed(value: float) -> dict[str, Any]:
        text = base64.b64encode(np.array([1, value], "<f4").tobytes()).decode()
        return {"shape": [2], "float32": text}

    assert differences({"a": [packed(2)]}, {"a": [packed(2.00001)]}) == []
    assert differences({"a": [packed(2)]}, {"a": [packed(2.01)]}) == ["a.0"]
    assert differences({"a": 1, "b": "x"}, {"a": 1.001, "b": "y"}) == ["a", "b"]
    assert differences({"a": 1}, {"b": 1}) == ["a", "b"]


def differences(stored: Any, fresh: Any, path: str = "") -> list[str]:
    """Paths of entries that differ by more than rounding does between machines."""
    if isinstance(stored, list) and isinstance(fresh, list) and len(stored) == len(fresh):
        stored, fresh = (dict(enumerate(values)) for values in (stored, fresh))
    if isinstance(stored, dict) and isinstance(fresh, dict):
        if stored.keys() == fresh.keys() == {"shape", "float32"}:
            return [] if _close(_unpacked(stored), _unpacked(fresh)) else [path]
        keys = sorted({*stored, *fresh}, key=str)
        below = [f"{path}.{key}".removeprefix(".") for key in keys]
        return [
            found
            for key, name in zip(keys, below, strict=True)
            for found in differences(stored.get(key), fresh.get(key), name)
        ]
    if isinstance(stored, float | int) and isinstance(fresh, float | int):
        return [] if _close(np.array(stored, float), np.array(fresh, float)) else [path]
    return [] if stored == fresh else [path]


def _close(stored: np.ndarray, fresh: np.ndarray) -> bool:
    if stored.shape != fresh.shape:
        return False
    scale = max(float(np.abs(fresh).max(initial=0)), 1e-6)
    return bool(np.abs(stored - fresh).max(initial=0) <= 1e-4 * scale)


def _unpacked(packed: dict[str, Any]) -> np.ndarray:
    return np.frombuffer(base64.b64decode(packed["float32"]), "<f4").reshape(packed["shape"])
