"""The tilts that the page must see in its golden pictures are what this package sees in them.

After a change that is meant: `python tests/golden/make_web_edges.py`, and commit.
"""

import json
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from scripts import web_maker


@pytest.fixture(scope="module")
def make(root: Path) -> ModuleType:
    """The script that writes the golden file, as a module."""
    return web_maker(root, "make_web_edges")


def test_golden_values_are_those_of_the_package(make: ModuleType) -> None:
    stored, fresh = json.loads(make.FILE.read_text(encoding="utf-8")), make.golden()
    assert stored.keys() == fresh.keys()
    for name, case in fresh["cases"].items():
        assert stored["cases"][name]["rgb"] == case["rgb"]
        for guess, tilt in case["tilts"].items():
            other = stored["cases"][name]["tilts"][guess]
            assert (other is None) == (tilt is None)
            if tilt is not None:
                np.testing.assert_allclose(other["up"], tilt["up"], atol=1e-5)
                assert other["scaleRad"] == pytest.approx(tilt["scaleRad"], abs=1e-5)


def test_edges_are_sure_in_two_pictures_and_missing_in_one(make: ModuleType) -> None:
    cases = make.golden()["cases"]
    seen = {name: case["tilts"]["none"] is not None for name, case in cases.items()}
    assert seen == {"upright": True, "rolled": True, "without edges": False}
    assert abs(cases["rolled"]["tilts"]["doubtful"]["up"][0]) > 0.05
