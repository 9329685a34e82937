"""Every example of docs/extend.md runs, in order."""

import re
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from deeplight.cli.main import main
from deeplight.io.photos import write_png

BLOCK = re.compile(r"```python([^\n]*)\n(.*?)```", re.DOTALL)


def title_of(head: str) -> str:
    """The file that a block is to be saved as."""
    return head.split('title="')[1].rstrip('"')


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    sys.modules.pop("sky_light", None)


def test_the_examples_run_in_order(root: Path, folder: Path) -> None:
    blocks = BLOCK.findall((root / "docs" / "extend.md").read_text())
    assert len(blocks) == 5
    photo = np.random.default_rng(0).integers(0, 255, (96, 64, 3), dtype=np.uint8)
    names = {"photo": photo}
    for head, code in blocks:
        if "title=" in head:
            (folder / title_of(head)).write_text(code)
        elif "import torch" not in code or find_spec("torch"):
            exec(compile(code, "docs/extend.md", "exec"), names)
    assert names["rendered"].shape == (32, 32, 3)


def test_the_command_takes_an_own_class(root: Path, folder: Path) -> None:
    head, code = BLOCK.findall((root / "docs" / "extend.md").read_text())[0]
    (folder / title_of(head)).write_text(code)
    write_png(folder / "photo.png", np.full((96, 64, 3), 90, np.uint8))
    words = ["estimate", "photo.png", "--model", "sky_light:SkyLight", "--out", "out"]
    assert main(words) == 0
    assert (folder / "out" / "photo.exr").is_file()
    assert main([*words[:3], "sky_light:Nothing", *words[4:]]) == 2
