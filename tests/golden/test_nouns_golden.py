"""Pictures of the nouns at work, and a perturbed twin of each that must not pass.

A change that means to alter them runs `python tests/golden/make_nouns.py`, looks at the new
pictures and commits them with the reason.
"""

from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from deeplight.lighting import Lighting
from deeplight.sphere import PAPER_RIG
from scripts import loaded

Compare = Callable[[str, np.ndarray], int]
LEVELS = 1  # rounding may differ between machines


@pytest.fixture(scope="module")
def make() -> ModuleType:
    """The script that made the goldens."""
    return loaded(Path(__file__).parent / "make_nouns.py")


def test_spheres(make: ModuleType, differs_from_golden: Compare) -> None:
    assert differs_from_golden("spheres", make.spheres(make.light(), PAPER_RIG)) <= LEVELS


def test_twin_spheres_in_mirrored_light(make: ModuleType, differs_from_golden: Compare) -> None:
    wrong = make.spheres(make.light().mirrored(), PAPER_RIG)
    assert differs_from_golden("spheres", wrong) > 20


def test_twin_spheres_5_percent_brighter(make: ModuleType, differs_from_golden: Compare) -> None:
    wrong = make.spheres(Lighting(make.light().radiance * np.float32(1.05)), PAPER_RIG)
    assert differs_from_golden("spheres", wrong) > LEVELS


def test_twin_spheres_of_the_mirrored_rig(make: ModuleType, differs_from_golden: Compare) -> None:
    wrong = make.spheres(make.light(), PAPER_RIG.mirrored())
    assert differs_from_golden("spheres", wrong) > 5


def test_mappings(make: ModuleType, differs_from_golden: Compare) -> None:
    assert differs_from_golden("mappings", make.mappings(make.light())) <= LEVELS


def test_twin_mappings_turned_by_3_degrees(make: ModuleType, differs_from_golden: Compare) -> None:
    wrong = make.mappings(make.light(yaw_deg=3))
    assert differs_from_golden("mappings", wrong) > 20
