"""Comparing pictures with committed ones; on failure got, want and error lie in `build/golden`."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

FOLDER = Path(__file__).parent


def _save(pixels: np.ndarray, path: Path) -> None:
    Image.fromarray(pixels).resize((pixels.shape[1] * 4, pixels.shape[0] * 4), 0).save(path)


@pytest.fixture
def differs_from_golden(root: Path) -> Callable[[str, np.ndarray], int]:
    """Largest difference, in 8-bit levels, of a picture from the committed one."""

    def compare(name: str, pixels: np.ndarray) -> int:
        want = np.asarray(Image.open(FOLDER / f"{name}.png").convert("RGB"))
        assert want.shape == pixels.shape
        error = np.abs(want.astype(int) - pixels.astype(int)).astype(np.uint8)
        if error.max() > 1:
            folder = root / "build" / "golden"
            folder.mkdir(parents=True, exist_ok=True)
            for kind, picture in (("got", pixels), ("want", want), ("error", 8 * error)):
                _save(picture, folder / f"{name}-{kind}.png")
        return int(error.max())

    return compare
