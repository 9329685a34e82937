"""What the page's golden photos say of their cameras is what this package reads in the same files.

After a change that is meant: `python tests/golden/make_web_exif.py`, and commit.
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
    return web_maker(root, "make_web_exif")


def test_golden_values_are_those_of_the_package(make: ModuleType) -> None:
    stored, fresh = json.loads(make.FILE.read_text()), make.golden()
    assert stored.keys() == fresh.keys()
    for name, photo in stored.items():
        for entry in ("up", "vertical_fov_rad"):
            want = fresh[name][entry]
            assert (photo[entry] is None) == (want is None), name
            if want is not None:
                np.testing.assert_allclose(photo[entry], want, atol=1e-6, err_msg=name)


def test_the_photos_are_many_ways_up_and_of_many_lenses(make: ModuleType) -> None:
    photos = make.golden().values()
    ups, views = ([photo[entry] for photo in photos] for entry in ("up", "vertical_fov_rad"))
    assert len({tuple(np.round(up, 3)) for up in ups if up is not None}) >= 4
    assert len({round(view, 3) for view in views if view is not None}) >= 5
    assert min(ups.count(None), views.count(None)) >= 5
