"""Python reads what the live page saves."""

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from deeplight.fuse.session import Session
from deeplight.io.environment_file import load_lighting
from deeplight.io.radiance import read_hdr


@pytest.fixture(scope="module")
def saved(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the files that the page's own code saved; it reads one of ours."""
    if not (root / "web/node_modules/.installed").exists() or shutil.which("npx") is None:
        pytest.skip("needs the page's tools: make web-test")
    folder = tmp_path_factory.mktemp("web")
    pytest.importorskip("cv2")
    ours = Session(1.0, no_network)
    for level in (90, 160):
        frame = np.full((64, 36, 3), level, np.uint8)
        ours.add(frame, turned(level / 100), np.zeros((32, 32, 3), np.float32))
    ours.save(folder / "python.npz")
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


def test_a_session_goes_on_in_python(saved: Path) -> None:
    light = np.fromfile(saved / "web.f32", "<f4").reshape(64, 128, 3)
    session = Session.load(saved / "web.npz", no_network)
    assert apart(session, light) < 2e-3
    assert [view.number for view in session.views] == [0, 1, 2]
    another = np.full((96, 54, 3), 90, np.uint8)
    session.add(another, turned(0.9), np.full((32, 32, 3), 2, np.float32))
    assert apart(session, light) > 0.1


def apart(session: Session, light: np.ndarray) -> float:
    """In ln, but for 3 % of the texels: at a picture's edge the two round to other pixels."""
    return float(np.quantile(np.abs(np.log(session.environment(height=64).radiance / light)), 0.97))


def no_network(_: np.ndarray) -> np.ndarray:
    raise AssertionError("every frame here brings its own estimate")


def turned(yaw: float) -> np.ndarray:
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
