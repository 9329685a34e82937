"""The light in three.js, drawn by headless Chromium (software WebGL) from the exported module.

`make round-trip` installs what it needs; `DEEPLIGHT_NODE_MODULES` names the folder with three and
playwright-core in it.
"""

import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from deeplight.environment import Environment
from deeplight.formats.files import FileSpec, write_environment
from round_trips import (
    MATERIALS,
    SIZE,
    Balls,
    assert_right,
    assert_wrong,
    labelled,
    labels_seen,
    measured,
    mirrored,
    quarter_turned,
    report,
)

MODULES = os.environ.get("DEEPLIGHT_NODE_MODULES", "")
CHROMIUM = os.environ.get("DEEPLIGHT_CHROMIUM") or shutil.which("chromium") or ""
SCRIPT = Path(__file__).parent / "tools" / "three_balls.mjs"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not ((Path(MODULES) / "three").is_dir() and MODULES and CHROMIUM and shutil.which("node")),
        reason="needs node, chromium and three: make round-trip",
    ),
]


def rendered(
    environment: Environment, folder: Path, way: str = "environment", wrong_faces: bool = False
) -> Balls:
    """What three.js makes of the exported files."""
    light = folder / "light.js"
    write_environment(environment, FileSpec(light))
    if way == "cube":
        tool = "webxr" if wrong_faces else "three"
        write_environment(
            environment, FileSpec(folder / "light.exr", mapping="cube", made_for=tool)
        )
    if way == "gain-map":
        write_environment(environment, FileSpec(folder / "light.jpg", made_for="three"))
    materials = [f"{name}={albedo}" for name, albedo in MATERIALS.items()]
    command = ["node", str(SCRIPT), str(light), str(folder), str(SIZE), way, *materials]
    environ = os.environ | {"DEEPLIGHT_CHROMIUM": CHROMIUM}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environ)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    pictures = {
        name: np.fromfile(folder / f"{name}.f32", "<f4").reshape(SIZE, SIZE, 4)[..., :3]
        for name in MATERIALS
    }
    return Balls(**pictures)


@pytest.mark.parametrize("way", ["environment", "cube"])
def test_three_sees_the_light_as_we_do(tmp_path: Path, way: str) -> None:
    assert_right(rendered(labelled(), tmp_path, way), f"three.js, {way}")


def test_harmonics_and_a_directional_light_are_the_same_light(tmp_path: Path) -> None:
    """E(harmonics) + E(main light) = E(all), in three.js's own shaders."""
    grey, _ = measured(rendered(labelled(), tmp_path, "lights"))
    report(f"three.js, harmonics and main light: masked L1 grey {grey:.4f}")
    assert grey <= 0.03


def test_the_gain_map_jpeg_is_read_right_side_up(tmp_path: Path) -> None:
    """three.js's own loader bends the curve of gain maps, so the brightness is its affair."""
    balls = rendered(labelled(), tmp_path, "gain-map")
    report("three.js, gain map: masked L1 grey {:.4f}, mirror {:.4f}".format(*measured(balls)))
    assert all(name == seen for name, seen in labels_seen(balls.mirror).items())


@pytest.mark.parametrize("wrong", [mirrored, quarter_turned])
def test_a_wrong_panorama_would_be_found_in_three(tmp_path: Path, wrong) -> None:
    assert_wrong(rendered(wrong(), tmp_path))


def test_faces_of_another_convention_would_be_found_in_three(tmp_path: Path) -> None:
    assert_wrong(rendered(labelled(), tmp_path, "cube", wrong_faces=True))
