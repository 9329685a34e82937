"""Python reads what the live page saves."""

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from deeplight.io.environment_file import load_lighting
from deeplight.io.radiance import read_hdr


@pytest.fixture(scope="module")
def saved(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the .hdr and .json that the page's own code saved."""
    if not (root / "web/node_modules/.installed").exists() or shutil.which("npx") is None:
        pytest.skip("needs the page's tools: make web-test")
    folder = tmp_path_factory.mktemp("web")
    done = subprocess.run(
        ["npx", "vitest", "run", "packages/deeplight/src/save"],
        cwd=root / "web",
        env=os.environ | {"DEEPLIGHT_WEB_FILES": str(folder)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


def test_both_files_hold_the_same_light(saved: Path) -> None:
    lighting = load_lighting(saved / "web.json")
    panorama = read_hdr(saved / "web.hdr")
    assert panorama.shape == (256, 512, 3)
    largest = panorama.max(axis=-1, keepdims=True)
    assert np.all(np.abs(panorama - lighting.latlong(256)) <= largest / 100)
    mirrored = lighting.mirrored().latlong(256)
    assert not np.all(np.abs(panorama - mirrored) <= largest / 100)


def test_the_environment_comes_back_as_the_ball(saved: Path) -> None:
    exact, back = load_lighting(saved / "web.json"), load_lighting(saved / "web.hdr")
    np.testing.assert_allclose(back.power(), exact.power(), rtol=0.02)
