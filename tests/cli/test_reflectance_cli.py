"""`deeplight reflectance` from the outside: what it writes; broken folders are one line."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest

from deeplight.cli.main import main, run_command
from deeplight.io.basis_file import load_bases, load_provenance
from deeplight.io.photograph import read_photograph, write_photograph
from deeplight.io.radiance import write_exr

SMALL = "--stage.photo-px 40 --stage.spacing-deg 45 --stage.supersample 2 --stage.suffix .exr"


def photograph(words: list[str]) -> int:
    return run_command("python -m lab.light_stage", "lab.light_stage.__main__", words)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made") / "stage"
    words = f"--out {folder} --stage.materials diffuse {SMALL}"
    assert photograph(words.split()) == 0
    return folder


@pytest.fixture
def stage(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "stage"))


def reflectance(folder: Path, *words: str) -> int:
    out = folder.parent / "out" / "basis.npz"
    return main(["reflectance", str(folder), "--out", str(out), *words])


def test_basis_certificate_and_picture_are_written(stage: Path, capfd) -> None:
    assert reflectance(stage) == 0
    out = stage.parent / "out"
    names = {path.name for path in out.iterdir()}
    assert names == {"basis.npz", "basis.certificate.json", "basis.picture.png"}
    certificate = json.loads((out / "basis.certificate.json").read_text())
    sphere = certificate["spheres"]["diffuse"]
    basis = load_bases(out / "basis.npz")["diffuse"]
    mask = basis.view.mask()
    assert basis.furnace()[mask].mean() == pytest.approx(sphere["measured"], rel=1e-5)
    assert load_provenance(out / "basis.npz")["certificate"] == certificate
    printed = capfd.readouterr().out
    assert f"{sphere['measured']:.4f}" in printed


def test_a_killed_stage_goes_on_with_what_is_missing(stage: Path) -> None:
    before = {path: path.read_bytes() for path in stage.rglob("light_*.exr")}
    gone = sorted(before)[3]
    gone.unlink()
    kept = sorted(before)[5].stat().st_mtime_ns
    words = f"--out {stage} --stage.materials diffuse {SMALL}"
    assert photograph(words.split()) == 0
    after = {path: path.read_bytes() for path in stage.rglob("light_*.exr")}
    assert set(after) == set(before)
    assert sorted(after)[5].stat().st_mtime_ns == kept
    np.testing.assert_array_equal(read_photograph(gone, 1).shape, (40, 40, 3))


def test_other_settings_do_not_mix_with_earlier_photographs(stage: Path, capfd) -> None:
    words = f"--out {stage} --stage.materials diffuse {SMALL} --stage.seed 5"
    assert photograph(words.split()) == 2
    assert "truth.json began with" in capfd.readouterr().err


def spoil(stage: Path, kind: str) -> list[str]:
    """Break one thing; give further words of the command."""
    photograph = stage / "diffuse" / "light_003.exr"
    lights = json.loads((stage / "lights.json").read_text())
    if kind == "NaN":
        write_exr(photograph, np.full((40, 40, 3), np.nan, np.float32))
    elif kind == "missing":
        photograph.unlink()
    elif kind == "size":
        write_photograph(photograph, np.zeros((20, 40, 3), np.float32))
    elif kind == "truncated":
        photograph.write_bytes(photograph.read_bytes()[:500])
    elif kind == "text":
        photograph.write_text("no image")
    elif kind == "JSON":
        (stage / "lights.json").write_text("{")
    elif kind == "list":
        (stage / "lights.json").write_text("[1, 2]")
    elif kind == "direction":
        lights["lights"][1]["direction"] = [0, None, 1]
    elif kind == "escape":
        lights["lights"][1]["file"] = "../light_001.exr"
    elif kind == "twice":
        lights["lights"][1]["file"] = "light_000.exr"
    elif kind == "scale":
        lights["calibrated"] = False
    elif kind == "undirected":
        for light in lights["lights"]:
            del light["direction"]
    elif kind == "camera":
        (stage / "camera.json").write_text('{"vertical_fov_deg": "wide"}')
    elif kind == "fov":
        (stage / "camera.json").unlink()
    elif kind == "csv":
        (stage / "lights.csv").write_text("file,x,y,z\nlight_000.exr,0,up,1\n")
        return ["--lights", str(stage / "lights.csv")]
    elif kind == "empty":
        shutil.rmtree(stage / "diffuse")
    elif kind == "gone":
        shutil.rmtree(stage)
    if stage.exists() and kind not in ("JSON", "list"):
        (stage / "lights.json").write_text(json.dumps(lights))
    return []


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("NaN", "NaN or infinite"),
        ("missing", "light_003.exr"),
        ("size", "of 40 x 20"),
        ("truncated", "light_003.exr"),
        ("text", "light_003.exr"),
        ("JSON", "JSON"),
        ("list", "lights.json"),
        ("direction", "light_001.exr"),
        ("escape", "plain file name"),
        ("twice", "of its own"),
        ("scale", "--reflectivity"),
        ("undirected", "directions"),
        ("camera", "vertical_fov_deg"),
        ("fov", "--fov"),
        ("csv", "column y"),
        ("empty", "--material"),
        ("gone", "folder of photographs"),
    ],
)
def test_a_broken_folder_is_one_line_and_nothing_written(stage, capfd, kind, message) -> None:
    words = spoil(stage, kind)
    assert reflectance(stage, *words) == 2
    (line,) = capfd.readouterr().err.strip().splitlines()
    assert line.startswith("deeplight reflectance: ")
    assert message in line
    assert not (stage.parent / "out").exists()


@pytest.mark.parametrize(
    "words",
    [
        "--reflectivity diffuse",
        "--reflectivity diffuse=2",
        "--reflectivity copper=0.5",
        "--passes 0",
        "--fov 200",
        "--linear --gamma 2",
        "--circle 10 10 1",
        "--out basis.txt",
    ],
)
def test_impossible_options_are_one_line(stage: Path, capfd, words: str) -> None:
    assert reflectance(stage, *words.split()) == 2
    assert len(capfd.readouterr().err.strip().splitlines()) == 1
