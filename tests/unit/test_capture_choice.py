"""Frame choice: every frame left out has its cause."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from clips import picture, write_clip
from deeplight.capture.choice import ChoiceSettings, Chooser, causes_by_log
from deeplight.capture.quality import QualityLog, measured
from deeplight.errors import ConfigError
from deeplight.io.video import video_frames

SETTINGS = ChoiceSettings()


def chosen(path: Path, how: ChoiceSettings = SETTINGS) -> Chooser:
    log = QualityLog()
    for _ in log.watch(video_frames(path)):
        pass
    chooser = Chooser(causes_by_log(log, how), how.alike)
    kept = [still.number for still in chooser.keep(video_frames(path))]
    assert kept == [n for n, cause in enumerate(chooser.causes) if not cause]
    return chooser


def test_a_frame_of_each_kind_meets_its_fate(tmp_path: Path) -> None:
    frames = [picture(4 * n) for n in range(12)]
    frames[3] = frames[2]
    frames[6] = picture(24, blur_px=25)
    frames[9] = picture(36, gain=30.0)
    frames[11] = picture(44, gain=0.0)
    chooser = chosen(write_clip(tmp_path / "c.mp4", frames))
    found = {n: cause for n, cause in enumerate(chooser.causes) if cause}
    expected = {3: "duplicated", 6: "blurred", 9: "badly_exposed", 11: "badly_exposed"}
    assert found == expected
    assert chooser.dropped == {"duplicated": 1, "badly_exposed": 2, "blurred": 1}
    assert chooser.kept == 8


def test_near_duplicates_are_thinned_out_unless_all_are_wanted(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    still = picture(0).astype(float)
    frames = [(still + rng.normal(0, 4, still.shape)).clip(0, 255).astype(np.uint8)]
    frames += [(still + rng.normal(0, 4, still.shape)).clip(0, 255).astype(np.uint8) for _ in "abc"]
    frames += [picture(40), picture(80)]
    path = write_clip(tmp_path / "c.mp4", frames)
    dropped = chosen(path).dropped
    assert sum(dropped.values()) == 3
    assert dropped["near_duplicate"] >= 2
    assert "near_duplicate" not in chosen(path, replace(SETTINGS, alike=0.0)).dropped


def test_a_jump_of_exposure_is_a_cause_when_asked_for(tmp_path: Path) -> None:
    frames = [picture(4 * n, gain=0.4 if n >= 5 else 1.0) for n in range(10)]
    path = write_clip(tmp_path / "c.mp4", frames)
    assert chosen(path).dropped == {}
    chooser = chosen(path, replace(SETTINGS, jump_stops=1.0))
    assert [n for n, cause in enumerate(chooser.causes) if cause] == [5]


def test_a_clip_that_is_blurred_throughout_has_no_sharp_frame(tmp_path: Path) -> None:
    path = write_clip(tmp_path / "c.mp4", [picture(4 * n, blur_px=20) for n in range(6)])
    assert chosen(path).dropped == {}
    assert chosen(path, replace(SETTINGS, least_sharpness=0.2)).dropped == {"blurred": 6}


def test_a_view_that_lies_otherwise_in_memory_measures_the_same() -> None:
    luma = np.ascontiguousarray(picture(0)[..., 1])
    lying = np.rot90(np.ascontiguousarray(np.rot90(luma, -1)))
    assert not lying.flags.c_contiguous
    off = measured(luma, 60).astype(int) - measured(lying, 60)
    assert abs(off).max() <= 1  # rounding


def test_the_log_is_small(tmp_path: Path) -> None:
    log = QualityLog()
    count = sum(1 for _ in log.watch(video_frames(write_clip(tmp_path / "c.mp4"))))
    assert len(log) == count == 10
    assert log.at("change", 0) == np.inf
    assert log.column("time_s") == pytest.approx(np.arange(10) / 30, abs=1e-3)
    assert log.at("sharpness", 7) == log.column("sharpness")[7]


def test_settings_that_make_no_sense_are_refused() -> None:
    for wrong in ({"blur": -1.0}, {"alike": float("nan")}, {"least_kept": 0}):
        with pytest.raises(ConfigError, match="choice"):
            ChoiceSettings(**wrong)  # type: ignore[arg-type]
