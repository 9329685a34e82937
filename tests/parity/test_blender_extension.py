"""The packed Blender extension lights a scene from a photo, in Blender's own module.

`make round-trip` installs that module; `DEEPLIGHT_BLENDER_PYTHON` names its Python.
"""

import importlib.util
import json
import math
import os
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from deeplight.io.radiance import read_hdr
from round_trips import VIEW, report
from scripts import loaded

PYTHON = os.environ.get("DEEPLIGHT_BLENDER_PYTHON", sys.executable)
SCENE = Path(__file__).parent / "tools" / "blender_extension_scene.py"
HAS_BLENDER = sys.executable != PYTHON or importlib.util.find_spec("bpy") is not None
PITCH = -0.3


@pytest.fixture(scope="module")
def archive(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The extension as it is published."""
    if not (root / "blender").exists():
        pytest.skip("no blender folder in this distribution")
    return loaded(root / "blender/build.py").build(tmp_path_factory.mktemp("extension"))


def test_the_archive_is_an_extension_with_this_package_s_version(archive: Path, root: Path) -> None:
    with zipfile.ZipFile(archive) as packed:
        names = packed.namelist()
        manifest = tomllib.loads(packed.read("blender_manifest.toml").decode())
    assert {"__init__.py", "scene.py", "program.py"} <= set(names)
    assert (
        manifest["version"]
        == tomllib.loads((root / "pyproject.toml").read_text())["project"]["version"]
    )
    assert manifest["schema_version"] == "1.0.0"
    assert all(len(line) <= 64 for line in (manifest["tagline"], *manifest["permissions"].values()))


@pytest.mark.parametrize(
    ("tilt", "pitch_deg"),
    [
        ({"pitch_deg": -32.0, "scale_deg": 0.0}, -32.0),
        ({"pitch_deg": -9.0, "scale_deg": 8.0}, -9.0),
        ({"pitch_deg": -9.0, "scale_deg": 40.0}, None),
        (None, None),
    ],
)
def test_the_camera_is_pitched_as_the_photo_says(
    root: Path, tilt: dict[str, float] | None, pitch_deg: float | None
) -> None:
    if not (root / "blender").exists():
        pytest.skip("no blender folder in this distribution")
    program = loaded(root / "blender/deeplight/program.py")
    record = {} if tilt is None else {"camera_tilt": tilt}
    found = program.pitch_of(record)
    assert (found is None) == (pitch_deg is None)
    assert found is None or math.degrees(found) == pytest.approx(pitch_deg)


@pytest.fixture(scope="module")
def made(
    archive: Path, root: Path, tmp_path_factory: pytest.TempPathFactory
) -> tuple[dict[str, Any], Path]:
    """What stands in the scene, and the folder of its pictures and of the program's files."""
    folder = tmp_path_factory.mktemp("blender")
    program = folder / "deeplight"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m deeplight "$@"\n')
    program.chmod(0o755)
    photo = root / "examples/photos/hall.jpg"
    command = [PYTHON, SCENE, archive, program, photo, folder]
    done = subprocess.run(
        [str(part) for part in command], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    _run("estimate", photo, "--out", folder / "own")
    own = folder / "own/hall.json"
    _run("convert", own, "--out", folder / "apart.json", "--lamps-apart", "--size", "64")
    _run("convert", own, "--out", folder / "mitsuba.exr", "--for", "mitsuba")
    return json.loads((folder / "scene.json").read_text()), folder


@pytest.mark.slow
@pytest.mark.skipif(not HAS_BLENDER, reason="needs Blender's module bpy: make round-trip")
class TestInBlender:
    """One photo, one scene."""

    def test_the_lamps_are_suns_as_the_program_has_them(self, made) -> None:
        facts, folder = made
        lamps = json.loads((folder / "apart.json").read_text())["lamps"]["lamps"]
        assert facts["result"] == ["FINISHED"]
        assert len(facts["suns"]) == len(lamps) > 0
        for sun, lamp in zip(facts["suns"], lamps, strict=True):
            want = in_blender(np.array(lamp["direction"]), PITCH)
            assert angle_deg(np.array(sun["towards"]), want) < 0.1
            assert (
                angle_deg(np.array(sun["towards"]), in_blender(np.array(lamp["direction"]), 0)) > 2
            )
            np.testing.assert_allclose(sun["energy"], lamp["irradiance"], rtol=0.01)
            assert sun["angle"] == pytest.approx(2 * lamp["angular_radius_rad"], rel=1e-3)

    def test_the_environment_stands_where_the_camera_saw_it(self, made) -> None:
        _, folder = made
        seen = read_hdr(folder / "around.exr")[..., :3]
        want = read_hdr(folder / "apart.exr")
        assert seen.shape == want.shape == (64, 128, 3)
        right = apart(seen, want)
        assert right < 0.01
        assert apart(seen[:, ::-1], want) > 3 * right  # a hall is nearly the same mirrored
        assert apart(seen[::-1], want) > 3 * right

    def test_camera_background_and_floor_are_there(self, made) -> None:
        facts, folder = made
        record = json.loads((folder / "own/hall.json").read_text())
        assert facts["size"] == [record["photo"]["width"], record["photo"]["height"]]
        assert facts["angle_y"] == pytest.approx(
            math.radians(record["framing"]["vertical_fov_deg"]), abs=1e-4
        )
        np.testing.assert_allclose(facts["view"], [0, math.cos(PITCH), math.sin(PITCH)], atol=1e-5)
        assert facts["background"] == facts["catchers"] == 1
        assert math.degrees(facts["own_pitch"]) == pytest.approx(
            record["camera_tilt"]["pitch_deg"], abs=0.01
        )

    def test_a_grey_ball_is_lit_as_in_mitsuba(self, made) -> None:
        pytest.importorskip("mitsuba")
        _, folder = made
        mitsuba_export = loaded(Path(__file__).parent / "test_mitsuba_export.py")
        theirs = coarse(mitsuba_export.ball("diffuse", folder / "mitsuba.exr", 512))
        ours = coarse(read_hdr(folder / "ball.exr")[..., :3])
        right = apart(ours, theirs)
        power = ours.mean() / theirs.mean()
        report(
            f"Blender's ball off Mitsuba's by {100 * right:.1f} % of its mean, power {power:.3f}"
        )
        assert right < 0.025
        assert power == pytest.approx(1, abs=0.01)
        assert apart(ours[:, ::-1], theirs) > 1.5 * right  # a hall, as above
        assert apart(ours[::-1], theirs) > 3 * right

    def test_a_file_that_is_no_photo_is_refused_in_blender_s_way(self, made) -> None:
        facts, _ = made
        assert "expected" in facts["bad"]
        assert facts["lamps_after"] == len(facts["suns"])


def _run(*arguments: object) -> None:
    command = [sys.executable, "-m", "deeplight", *map(str, arguments)]
    subprocess.run(command, check=True, capture_output=True)


def in_blender(direction: np.ndarray, pitch: float) -> np.ndarray:
    """From the camera's frame to Blender's, for a camera that looks `pitch` above +Y."""
    x, y, z = direction
    forward, up = -z, y
    cosine, sine = math.cos(pitch), math.sin(pitch)
    return np.array([x, cosine * forward - sine * up, sine * forward + cosine * up])


def angle_deg(a: np.ndarray, b: np.ndarray) -> float:
    cosine = a @ b / np.linalg.norm(a) / np.linalg.norm(b)
    return math.degrees(math.acos(min(max(cosine, -1), 1)))


def coarse(ball: np.ndarray) -> np.ndarray:
    """Means of 8 x 8 pixels of a ball: their noise is an eighth of a pixel's."""
    rows = (ball * VIEW.mask()[..., None]).reshape(8, 8, 8, 8, 3)
    return rows.mean(axis=(1, 3))


def apart(a: np.ndarray, b: np.ndarray) -> float:
    """Mean difference as a share of the mean."""
    return float(np.abs(a - b).mean() / b.mean())
