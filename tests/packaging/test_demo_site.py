"""The built page in the wheel, and its size. `make web` builds it; without it those are skipped."""

import gzip
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from deeplight.demo.site import MODEL

MOST_SCRIPT_BYTES = 300 * 1024  # gzipped, without the runtime
MOST_MODEL_BYTES = 10 * 10**6
SITE = "deeplight/demo/site/"


@pytest.fixture(scope="module")
def site(root: Path) -> Path:
    """The page that `make web` built here."""
    folder = root / "src" / SITE
    if not (folder / "index.html").exists():
        pytest.skip("needs the built page: make web")
    return folder


def wheel_of(project: Path, to: Path) -> Path:
    hatchling = pytest.importorskip("hatchling.builders.wheel")
    builder = hatchling.WheelBuilder(str(project))
    return Path(next(builder.build(directory=str(to), versions=["standard"])))


@pytest.fixture
def project(root: Path, tmp_path: Path) -> Path:
    """A copy of what the wheel is built from, without a built page."""
    copy = tmp_path / "project"
    for name in ("pyproject.toml", "README.md", "LICENSE", ".gitignore"):
        (copy / name).parent.mkdir(exist_ok=True)
        shutil.copy(root / name, copy / name)
    leave = shutil.ignore_patterns("site", "__pycache__", "*.onnx")
    shutil.copytree(root / "src/deeplight", copy / "src/deeplight", ignore=leave)
    return copy


def test_the_wheel_has_the_page_but_the_network_only_once(project: Path, tmp_path: Path) -> None:
    for name in ("index.html", "assets/page-1.js", MODEL):
        (project / "src" / SITE / name).parent.mkdir(parents=True, exist_ok=True)
        (project / "src" / SITE / name).touch()
    with zipfile.ZipFile(wheel_of(project, tmp_path)) as archive:
        inside = {name.removeprefix(SITE) for name in archive.namelist() if SITE in name}
    assert inside == {"index.html", "assets/page-1.js"}


def test_a_wheel_without_the_page_says_what_to_do(project: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(wheel_of(project, tmp_path)) as archive:
        assert not any(SITE in name for name in archive.namelist())
        archive.extractall(tmp_path / "installed")
    done = subprocess.run(
        [sys.executable, "-m", "deeplight", "demo"],
        cwd=tmp_path / "installed",
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "expected the built page" in done.stderr
    assert "make web" in done.stderr


def test_the_page_is_light(site: Path) -> None:
    scripts = [p for p in site.rglob("*.*js") if p.relative_to(site).parts[0] != "runtime"]
    assert len(scripts) > 1
    assert sum(len(gzip.compress(path.read_bytes())) for path in scripts) <= MOST_SCRIPT_BYTES
    assert (site / MODEL).stat().st_size <= MOST_MODEL_BYTES


def test_the_page_asks_nobody_else(site: Path) -> None:
    page = (site / "index.html").read_text(encoding="utf-8")
    assert "Content-Security-Policy" in page
    assert 'src="http' not in page
    assert 'href="http' not in page
