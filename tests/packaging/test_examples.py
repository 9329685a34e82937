"""The numbered examples: public names only, and they run."""

import ast
import json
import runpy
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import deeplight

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("*.py"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_uses_public_names_only(path: Path) -> None:
    used = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            assert not (node.module or "").startswith("deeplight"), node.module
        if isinstance(node, ast.Import):
            assert all(name.name == "deeplight" for name in node.names if "deep" in name.name)
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            used |= {node.attr} if node.value.id == "deeplight" else set()
    assert used
    assert used <= set(deeplight.__all__)


def test_a_filmed_frame_is_a_photo_of_the_panorama(tmp_path: Path, root: Path) -> None:
    """A lamp straight ahead of a level camera is in the middle of the photo; EXIF has its lens."""
    radiance = np.full((256, 512, 3), 0.2, np.float32)
    radiance[120:136, 248:264] = 20.0
    panorama = tmp_path / "a.exr"
    deeplight.convert(deeplight.Environment(radiance, unit="file"), panorama)
    film = runpy.run_path(str(root / "examples/03_film_a_frame.py"))["main"]
    film(panorama, tmp_path / "ahead.jpg", 0.0, 0.0)
    film(panorama, tmp_path / "right.jpg", 20.0, 0.0)  # the twin: turned, the lamp moves away
    photos = [
        np.asarray(Image.open(tmp_path / f"{name}.jpg").convert("L")) for name in ("ahead", "right")
    ]
    assert photos[0].shape == (960, 540)
    assert photos[0][480, 270] > 240
    assert photos[1][480, 270] < 200
    assert deeplight.estimate(tmp_path / "ahead.jpg", height=64).frame == "camera"
    assert Image.open(tmp_path / "ahead.jpg").getexif().get_ifd(0x8769)[0xA405] > 0


def test_the_notebook_runs_from_top_to_bottom(tmp_path: Path, root: Path, monkeypatch) -> None:
    """Its code in one process, in order; what it writes lands in a folder of ours."""
    notebook = json.loads((root / "examples/light_of_a_photo.ipynb").read_text())
    (tmp_path / "examples").symlink_to(root / "examples")
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    for number, code in enumerate(cells):
        exec(compile(code, f"cell {number}", "exec"), names)
    assert len(cells) >= 8
    assert (tmp_path / "out/notebook/light.glb").stat().st_size > 1000
    assert all(cell.get("outputs", []) == [] for cell in notebook["cells"])  # kept small
