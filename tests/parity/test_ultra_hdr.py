"""The gain-map JPEG read by libultrahdr, the format's own library (through imagecodecs).

`DEEPLIGHT_IMAGECODECS_PYTHON` names a Python that has imagecodecs; see `make round-trip`.
"""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from deeplight.formats.files import FileSpec, write_environment
from round_trips import labelled, report

PYTHON = os.environ.get("DEEPLIGHT_IMAGECODECS_PYTHON", sys.executable)
DECODE = """
import sys, imagecodecs, numpy
with open(sys.argv[1], "rb") as file:
    pixels = imagecodecs.ultrahdr_decode(file.read(), dtype="float16")
pixels[..., :3].astype("<f4").tofile(sys.argv[2])
"""
LIBRARY_CLIPS_AT = 49.0

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        sys.executable == PYTHON and importlib.util.find_spec("imagecodecs") is None,
        reason="needs imagecodecs: make round-trip",
    ),
]


def decoded(path: Path, shape: tuple[int, ...]) -> np.ndarray:
    out = path.with_suffix(".f32")
    done = subprocess.run(
        [PYTHON, "-c", DECODE, str(path), str(out)], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return np.fromfile(out, "<f4").reshape(shape)


def test_libultrahdr_reads_our_radiance(tmp_path: Path) -> None:
    radiance = labelled().radiance
    write_environment(labelled(), FileSpec(tmp_path / "light.jpg"))
    back = decoded(tmp_path / "light.jpg", radiance.shape)
    shown = np.minimum(radiance, LIBRARY_CLIPS_AT)
    error = np.abs(back - shown) / (shown + 0.05)
    report(f"libultrahdr: median error {np.median(error):.4f}, 95 % {np.percentile(error, 95):.4f}")
    assert np.median(error) < 0.03
    # The twin: the picture the other way round is far off.
    wrong = np.abs(back[:, ::-1] - shown) / (shown + 0.05)
    assert np.percentile(wrong, 75) > 0.2
