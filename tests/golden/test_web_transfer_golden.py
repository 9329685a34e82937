"""The page's golden object of transfer is what this package makes of the same file.

After a change that is meant: `python tests/golden/make_web_transfer.py`, and commit.
"""

import base64
import json
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from scripts import loaded

pytestmark = pytest.mark.needs("embreex")


@pytest.fixture(scope="module")
def make(root: Path) -> ModuleType:
    """The script that writes the golden file, as a module."""
    if not (root / "web").exists():
        pytest.skip("no web folder in this distribution")
    return loaded(root / "tests/golden/make_web_transfer.py")


def unpacked(entry: dict[str, Any]) -> np.ndarray:
    values = np.frombuffer(base64.b64decode(entry["float32"]), "<f4")
    return values.reshape(entry["shape"])


def test_golden_values_are_those_of_the_package(make: ModuleType) -> None:
    stored = json.loads(make.FILE.read_text())
    fresh = make.golden(base64.b64decode(stored["file"]))
    assert stored.keys() == fresh.keys()
    for name in ("light", "positions", "normals", "diffuse", "met", "shadow"):
        np.testing.assert_allclose(unpacked(fresh[name]), unpacked(stored[name]), atol=1e-4)
    for name in ("diffuse", "glossy"):
        pictures = (unpacked(one["pictures"][name]) for one in (fresh, stored))
        assert (
            np.quantile(np.abs(np.subtract(*pictures)), 0.99) < 0.1
        )  # rays along edges may differ
    changed = unpacked(stored["diffuse"]) * 1.01
    assert np.abs(unpacked(fresh["diffuse"]) - changed).max() > 1e-3
