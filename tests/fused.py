"""A pan through a made-up place, and `deeplight fuse` on it, for the tests of that command."""

from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

import made_up_pans
from deeplight.cli.main import main
from lab.pans import Pan, Troubles

HEIGHT = 64


@lru_cache
def pan() -> Pan:
    return made_up_pans.pan(12, Troubles(0.0), things=700)


def fuse(out: Path, *words: str | Path, drawn: bool = False) -> int:
    """Run the command; its preview is black unless it is to be `drawn`, which takes long."""
    with pytest.MonkeyPatch.context() as patch:
        if not drawn:
            black = np.zeros((8, 8, 3), np.uint8)
            patch.setattr("deeplight.fuse.results.preview", lambda *_: black)
        return main(["fuse", *map(str, words), "--out", str(out), "--height", str(HEIGHT)])
