"""The light in Blender: its own Cycles, through the script that `deeplight convert` writes.

`make round-trip` installs Blender's Python module into an environment of its own, whose Python
`DEEPLIGHT_BLENDER_PYTHON` names.
"""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

from deeplight.environment import Environment
from deeplight.formats.files import FileSpec, write_environment
from deeplight.io.radiance import read_hdr
from round_trips import (
    MATERIALS,
    SIZE,
    Balls,
    assert_right,
    assert_wrong,
    labelled,
    mirrored,
    quarter_turned,
)

PYTHON = os.environ.get("DEEPLIGHT_BLENDER_PYTHON", sys.executable)
SCRIPT = Path(__file__).parent / "tools" / "blender_balls.py"

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        sys.executable == PYTHON and importlib.util.find_spec("bpy") is None,
        reason="needs Blender's module bpy: make round-trip",
    ),
]


def rendered(environment: Environment, folder: Path, samples: int = 256) -> Balls:
    """What Blender makes of the exported script and its EXR."""
    light = folder / "light.py"
    write_environment(environment, FileSpec(light))
    materials = [f"{name}={albedo}" for name, albedo in MATERIALS.items()]
    command = [PYTHON, str(SCRIPT), str(light), str(folder), str(SIZE), str(samples), *materials]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return Balls(**{name: read_hdr(folder / f"{name}.exr") for name in MATERIALS})


def test_blender_sees_the_light_as_we_do(tmp_path: Path) -> None:
    assert_right(rendered(labelled(), tmp_path), "Blender, Cycles")


@pytest.mark.parametrize("wrong", [mirrored, quarter_turned])
def test_a_wrong_panorama_would_be_found_in_blender(tmp_path: Path, wrong) -> None:
    assert_wrong(rendered(wrong(), tmp_path, samples=64))
