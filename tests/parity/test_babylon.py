"""The light in Babylon.js, the first reader of EXT_lights_image_based, from the exported glTF."""

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
    MOST_L1,
    SIZE,
    TOWARDS,
    Balls,
    assert_wrong,
    keep,
    labelled,
    labels_seen,
    measured,
    mirrored,
    report,
)

MODULES = os.environ.get("DEEPLIGHT_NODE_MODULES", "")
CHROMIUM = os.environ.get("DEEPLIGHT_CHROMIUM") or shutil.which("chromium") or ""
SCRIPT = Path(__file__).parent / "tools" / "babylon_balls.mjs"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        not (MODULES and (Path(MODULES) / "babylonjs").is_dir() and CHROMIUM),
        reason="needs node, chromium and babylonjs: make round-trip",
    ),
]


def rendered(environment: Environment, folder: Path) -> Balls:
    """What Babylon.js makes of the exported glTF, default settings, its left-handed scene."""
    light = folder / "light.gltf"
    write_environment(environment, FileSpec(light))
    materials = [f"{name}={albedo}" for name, albedo in MATERIALS.items()]
    command = ["node", str(SCRIPT), str(light), str(folder), str(SIZE), *materials]
    environ = os.environ | {"DEEPLIGHT_CHROMIUM": CHROMIUM}
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=environ)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    pictures = {
        name: np.fromfile(folder / f"{name}.f32", "<f4").reshape(SIZE, SIZE, 4)[..., :3]
        for name in MATERIALS
    }
    return Balls(**pictures)


def test_babylon_sees_the_light_as_we_do(tmp_path: Path) -> None:
    """Grey by harmonics and main light together; the mirror shows all but the main light."""
    balls = rendered(labelled(), tmp_path)
    keep(balls, "Babylon.js, glTF")
    report("Babylon.js: masked L1 grey {:.4f}, mirror {:.4f}".format(*measured(balls)))
    assert measured(balls)[0] <= MOST_L1
    assert labels_seen(balls.mirror) == {name: name for name in TOWARDS}


def test_a_wrong_panorama_would_be_found_in_babylon(tmp_path: Path) -> None:
    assert_wrong(rendered(mirrored(), tmp_path))
