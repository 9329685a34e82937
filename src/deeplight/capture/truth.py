"""What `python -m lab.film` left next to a clip; used for what the filmer would know.

Never for geometry: a simulated clip is captured exactly like a real one.
"""

from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float32

from deeplight.io.arrays_file import read_arrays
from deeplight.io.json_text import read_json


def true_place(clip: Path) -> dict[str, str]:
    """Give place, scene, split and licence of a simulated clip; nothing of any other."""
    values = _described(clip)
    names = ("place", "scene", "split", "licence")
    return {name: values[name] for name in names} if set(names) <= set(values) else {}


def true_lighting(clip: Path) -> dict[int, Float32[np.ndarray, "light light 3"]]:
    """Give the light of some frames of a simulated clip, by their position in the file."""
    path = clip.with_suffix(".truth.npz")
    try:
        truth = read_arrays(path)
        light, frames = truth["true_lighting"], truth["true_lighting_frames"].tolist()
        dropped = np.array([frame["dropped"] for frame in _described(clip)["frames"]], bool)
    except (OSError, ValueError, KeyError, TypeError):
        return {}
    position = np.cumsum(~dropped) - 1  # the file lacks the dropped frames
    pairs = zip(frames, light.astype(np.float32), strict=True)
    return {int(position[n]): value for n, value in pairs if not dropped[n]}


def _described(clip: Path) -> dict[str, Any]:
    try:
        values = read_json(clip.with_suffix(".truth.json"))
    except (OSError, ValueError):
        return {}
    return values if isinstance(values, dict) else {}
