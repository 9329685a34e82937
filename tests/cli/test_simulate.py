"""`deeplight simulate` on what people really hand it: broken folders, odd names, no room."""

from pathlib import Path

import numpy as np
import pytest

from deeplight.cli.main import main
from deeplight.dataset import open_dataset
from deeplight.io.radiance import write_exr

LIT = np.full((64, 128, 3), 0.5, np.float32)
QUICK = "--workers 1 --recipe.train-takes 1 --recipe.eval-takes 1 --recipe.frames 1".split()


@pytest.fixture
def hdri(tmp_path: Path) -> Path:
    folder = tmp_path / "hdri"
    folder.mkdir()
    return folder


def simulate(hdri: Path, *words: str) -> int:
    return main(["simulate", "--hdri", str(hdri), "--out", str(hdri.parent / "out"), *words])


def spoil(hdri: Path, kind: str) -> None:
    pixels = LIT.copy()
    if kind == "nan":
        pixels[3, 3] = np.nan
    elif kind == "black":
        pixels[:] = 0
    elif kind == "square":
        pixels = pixels[:, :64]
    if kind != "empty folder":
        write_exr(hdri / "room.exr", pixels)
    if kind == "truncated":
        (hdri / "room.exr").write_bytes((hdri / "room.exr").read_bytes()[:400])
    columns = "file,split,place,scene,synthetic_ground\n"
    manifests = {
        "manifest of bytes": b"\xff\xfe\x00",
        "manifest without columns": b"name\nroom.exr\n",
        "unknown split": f"{columns}room.exr,validation,room,indoor,\n".encode(),
        "unknown scene": f"{columns}room.exr,train,room,forest,\n".encode(),
        "made-up ground only": f"{columns}room.exr,train,room,indoor,true\n".encode(),
    }
    if kind in manifests:
        (hdri / "manifest.csv").write_bytes(manifests[kind])


@pytest.mark.parametrize(
    "kind",
    [
        "nan",
        "black",
        "square",
        "truncated",
        "empty folder",
        "manifest of bytes",
        "manifest without columns",
        "unknown split",
        "unknown scene",
        "made-up ground only",
    ],
)
def test_nothing_usable_is_one_line_and_no_folder(hdri, capfd, kind):
    spoil(hdri, kind)
    assert simulate(hdri, *QUICK) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert line.startswith("deeplight simulate: expected ")
    assert not (hdri.parent / "out").exists()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--recipe.seed -1", "recipe.seed of at least 0"),
        ("--recipe.frames 0", "recipe.frames of at least 1"),
        ("--recipe.phone brick", "brick"),
        ("--workers -1", "at least 0 workers"),
        ("--recipe.train-takes 0 --recipe.seen-takes 0 --recipe.eval-takes 0", "to film"),
    ],
)
def test_impossible_settings_are_one_line(hdri, capfd, words, message):
    write_exr(hdri / "room.exr", LIT)
    assert simulate(hdri, *words.split()) == 2
    (line,) = capfd.readouterr().err.splitlines()
    assert message in line


@pytest.mark.parametrize("stem", ["my room.v2", "写真 [b]", "x" * 150])
def test_a_panorama_may_have_any_name(hdri, stem):
    write_exr(hdri / f"{stem}.exr", LIT)
    assert simulate(hdri, *QUICK) == 0
    data = open_dataset(hdri.parent / "out")
    assert {meta.source for meta in (e.meta for e in data.examples(data.splits[0]))} == {
        f"{stem}.exr"
    }


def test_a_file_in_the_way_is_reported(hdri, capfd):
    write_exr(hdri / "room.exr", LIT)
    (hdri.parent / "out").write_text("in the way")
    assert simulate(hdri, *QUICK) == 2
    assert len(capfd.readouterr().err.splitlines()) == 1
    assert (hdri.parent / "out").read_text() == "in the way"
