"""What every test shares."""

import os
from pathlib import Path

import pytest

# Before numpy or torch is loaded: the workers of pytest-xdist share the cores, and each library
# starting a thread per core in each worker makes the suite several times slower.
for _variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_variable, "1")

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def root() -> Path:
    """The top of the repository."""
    return ROOT


@pytest.fixture(scope="session")
def shared() -> Path:
    """Panoramas and weights next to the repository; without it tests are skipped."""
    folder = ROOT.parent / "shared"
    if not (folder / "hdri").exists():
        pytest.skip("needs ../shared/hdri")
    return folder


@pytest.fixture(scope="session")
def cases() -> Path:
    """Files of other programs that were once read wrongly; tests of them are skipped without."""
    folder = ROOT.parent / "shared/cases"
    if not folder.exists():
        pytest.skip("needs ../shared/cases")
    return folder
