"""Where the page's golden photos have up is what this package reads in the same files.

After a change that is meant: `python tests/golden/make_web_tilt.py`, and commit.
"""

import json
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from scripts import loaded


@pytest.fixture(scope="module")
def make(root: Path) -> ModuleType:
    """The script that writes the golden file, as a module."""
    if not (root / "web").exists():
        pytest.skip("no web folder in this distribution")
    return loaded(root / "tests/golden/make_web_tilt.py")


def test_golden_values_are_those_of_the_package(make: ModuleType) -> None:
    stored, fresh = json.loads(make.FILE.read_text()), make.golden()
    assert stored.keys() == fresh.keys()
    for name, photo in stored.items():
        assert (photo["up"] is None) == (fresh[name]["up"] is None), name
        if photo["up"] is not None:
            np.testing.assert_allclose(photo["up"], fresh[name]["up"], atol=1e-6, err_msg=name)


def test_the_photos_are_many_ways_up(make: ModuleType) -> None:
    ups = [photo["up"] for photo in make.golden().values()]
    known = {tuple(np.round(up, 3)) for up in ups if up is not None}
    assert len(known) >= 4
    assert ups.count(None) >= 5
