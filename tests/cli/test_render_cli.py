"""`deeplight transfer`: a file, or one clear line."""

from pathlib import Path

import pytest

from deeplight.cli.main import main
from deeplight.transfer.file import read

pytestmark = pytest.mark.needs("embreex")


CUBE = """v 0 0 0
v 1 0 0
v 0 1 0
v 1 1 0
v 0 0 1
v 1 0 1
v 0 1 1
v 1 1 1
f 1 3 4 2
f 5 6 8 7
f 1 2 6 5
f 3 7 8 4
f 1 5 7 3
f 2 4 8 6
f 1 1 2
"""
FEW_RAYS = ["--samples", "32", "--bounces", "1"]
QUICK = [*FEW_RAYS, "--ground-points", "6"]


@pytest.fixture
def cube(tmp_path: Path) -> Path:
    pytest.importorskip("trimesh")
    path = tmp_path / "cube.obj"
    path.write_text(CUBE)
    return path


def test_a_mesh_file_becomes_a_transfer(
    cube: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "new" / "cube.transfer"
    words = [str(cube), "--out", str(out), *QUICK, "--order", "3", "--longest-edge", "0.5"]
    assert main(["transfer", *words]) == 0
    printed = capsys.readouterr().out
    assert "left out 1 triangles without area" in printed
    assert "split 12 triangles" in printed
    transfer = read(out)
    assert transfer.order == 3
    assert transfer.glossy is not None
    assert transfer.shadowed is not None
    assert transfer.shadowed.ground.size == 6


def test_parts_can_be_left_out(cube: Path, tmp_path: Path) -> None:
    out = tmp_path / "cube.transfer"
    words = [str(cube), "--out", str(out), *FEW_RAYS, "--silver", "None", "--ground", "None"]
    assert main(["transfer", *words, "--diffuse", "own"]) == 0
    transfer = read(out)
    assert (transfer.glossy, transfer.shadowed) == (None, None)
    assert transfer.colours is not None


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["chair.glb"], "chair.glb: No such file"),
        (["chair.stl"], "ending in .glb"),
        (["sphere", "--order", "12"], "an order of 1 to 8"),
        (["sphere", "--samples", "1"], "16 to 65,536 samples"),
        (["sphere", "--ground-points", "1"], "2 to 256 points"),
        (["sphere", "--ground", "1.5"], "a reflectivity from 0 to 1"),
    ],
)
def test_what_cannot_be_is_reported_in_one_line(
    words: list[str], message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "made" / "a.transfer"
    assert main(["transfer", *words, "--out", str(out)]) == 2
    line = capsys.readouterr().err
    assert message in line
    assert line.count("\n") == 1
    assert not out.parent.exists()


def test_a_folder_is_no_file_to_write(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["transfer", "sphere", "--out", str(tmp_path)]) == 2
    assert "a folder" in capsys.readouterr().err
