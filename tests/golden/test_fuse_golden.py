"""A session gives what the committed golden says: what a port to another language is held to."""

import json
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from scripts import loaded

pytestmark = pytest.mark.needs("cv2")


REMEDY = "after a change that is meant: python tests/golden/make_fuse.py, and commit"


@pytest.fixture(scope="module")
def make_fuse(root: Path) -> ModuleType:
    """The script that writes the golden file, as a module."""
    return loaded(root / "tests/golden/make_fuse.py")


def far(stored: object, fresh: object) -> float:
    """Largest difference of numbers, relative from 1 on; infinite where the shape differs."""
    if isinstance(stored, dict) and isinstance(fresh, dict) and stored.keys() == fresh.keys():
        return max(far(value, fresh[key]) for key, value in stored.items())
    if isinstance(stored, list) and isinstance(fresh, list) and len(stored) == len(fresh):
        return max(map(far, stored, fresh), default=0.0)
    if isinstance(stored, int | float) and isinstance(fresh, int | float):
        return abs(stored - fresh) / max(1.0, abs(stored))
    return np.inf


def test_the_session_is_the_golden_one(make_fuse: ModuleType) -> None:
    stored = json.loads(make_fuse.GOLDEN.read_text(encoding="utf-8"))
    assert far(stored, json.loads(json.dumps(make_fuse.golden()))) < 2e-3, REMEDY


def test_another_frame_would_be_noticed(
    make_fuse: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    stored = json.loads(make_fuse.GOLDEN.read_text(encoding="utf-8"))
    own = make_fuse.frame

    def darker(number: int, *brighter: int) -> np.ndarray:
        return np.minimum(own(number, *brighter), 150 if number == 2 else 255)

    monkeypatch.setattr(make_fuse, "frame", darker)
    assert far(stored, json.loads(json.dumps(make_fuse.golden()))) > 2e-3
