"""Panning clips of benchmark v2: named by what they hold, measured against known light."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from deeplight.errors import DataSetError
from deeplight.estimators.open import open_model
from deeplight.evaluate.leaderboard import read_leaderboard, update_entries
from deeplight.lighting import Lighting
from lab.evidence.pan_clips import (
    clip_sha256,
    entry,
    lights,
    refuse_other_bytes,
    scored,
)
from lab.pans import Pan, Sweep, Troubles, film_pan

pytestmark = pytest.mark.needs("onnxruntime")


@pytest.fixture(scope="module")
def pan() -> Pan:
    coarse = np.exp(np.random.default_rng(3).normal(0, 0.7, (8, 16, 3))).astype(np.float32)
    place = np.kron(coarse, np.ones((8, 8, 1), np.float32))
    return film_pan(place, Sweep(4), Troubles(), np.random.default_rng(1), (96, 54))


def test_a_clip_is_named_by_pixels_poses_and_light(pan: Pan) -> None:
    first, *rest = pan.frames
    brighter = first.pixels.copy()
    brighter[3, 4, 1] ^= 1
    others = [
        replace(pan, frames=[replace(first, pixels=brighter), *rest]),
        replace(pan, frames=[replace(first, rotation=rest[0].rotation), *rest]),
        replace(pan, panorama=pan.panorama * np.float32(1.001)),
        replace(pan, frames=rest),
    ]
    names = {clip_sha256(other) for other in [pan, *others]}
    assert len(names) == 5
    assert clip_sha256(replace(pan)) == clip_sha256(pan)


def test_missing_further_and_other_clips_are_refused() -> None:
    refuse_other_bytes({"a": "1", "b": "2"}, {"a": "1", "b": "2"})
    for found in ({"a": "1"}, {"a": "1", "b": "3"}, {"a": "1", "b": "2", "c": "4"}):
        with pytest.raises(DataSetError, match=r"1 of \d with other bytes, the first [bc]"):
            refuse_other_bytes(found, {"a": "1", "b": "2"})


def test_the_true_light_has_no_error_and_looking_around_helps(pan: Pan) -> None:
    """A turn of known poses sees most of the place, so fused light must be nearer to it."""
    true = pan.true_lighting()
    perfect = scored([true], [true])
    assert perfect["l1_diffuse"][0] < 0.002
    assert perfect["direction_deg"][0] < 0.1
    found = lights(pan, open_model())
    errors = {name: scored([light], [true])["l1_mirror"][0] for name, light in found.items()}
    assert errors["fused"] < errors["first frame"]
    twice = scored([Lighting(true.radiance * 2)], [true])
    assert twice["energy_stops"][0] == pytest.approx(1, abs=1e-3)


def test_results_go_into_a_leaderboard_and_are_verified(pan: Pan, tmp_path: Path) -> None:
    true = pan.true_lighting()
    columns = scored([Lighting(true.radiance * 1.5)] * 2, [true] * 2)
    row = entry("fused", "test", columns, ["a", "b"], ("clips", "model"))
    board = tmp_path / "board.json"
    assert [len(part) for part in update_entries(board, [row])] == [0, 1]
    assert [len(part) for part in update_entries(board, [row])] == [1, 0]
    assert read_leaderboard(board) == [row]
    wrong = replace(row, numbers={**row.numbers, "l1_diffuse": [0.5, 0.5, 0.5]})
    with pytest.raises(DataSetError, match="l1_diffuse"):
        update_entries(board, [wrong])
