"""A clip's frames, stretch by stretch: the same whoever looks, and nothing looked at twice."""

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest

from deeplight.cli.fuse import Args, _kept
from deeplight.errors import ConfigError
from deeplight.fuse import clip as clip_module
from deeplight.fuse.clip import STRETCH_S, clip_frames
from deeplight.fuse.frame import SourceFrame
from deeplight.io.kept_folder import KeptFolder
from deeplight.io.video_writer import VideoWriter

pytestmark = pytest.mark.needs("av")

RATE_HZ, FRAMES = 4.0, 100  # two stretches and a half


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A camera that turns to the right for 25 s."""
    rng = np.random.default_rng(0)
    place = np.full((64, 1024, 3), 120, np.uint8)
    for _ in range(300):
        centre = int(rng.integers(1024)), int(rng.integers(64))
        cv2.circle(place, centre, int(rng.integers(2, 9)), rng.integers(0, 255, 3).tolist(), -1)
    path = tmp_path_factory.mktemp("film") / "a.mp4"
    with VideoWriter(path, 96, 64, RATE_HZ) as writer:
        for k in range(FRAMES):
            writer.write(place[:, 4 * k : 4 * k + 96])
    return path


def listed(frames: Iterator[SourceFrame]) -> list[tuple[str, int, float, bytes]]:
    return [(f.name, f.number, f.time_s, f.pixels.tobytes()) for f in frames]


def kept(folder: Path) -> KeptFolder:
    return KeptFolder(folder / ".kept", b"key")


def test_workers_and_kept_stretches_give_the_same_frames(film: Path, tmp_path: Path) -> None:
    wanted = listed(clip_frames(film, None))
    times = [time_s for _, _, time_s, _ in wanted]
    assert len(wanted) > 10
    assert {int(time_s // STRETCH_S) for time_s in times} == {0, 1, 2}
    np.testing.assert_allclose(times, [number / RATE_HZ for _, number, _, _ in wanted], atol=1e-3)
    assert listed(clip_frames(film, kept(tmp_path / "1"))) == wanted
    assert listed(clip_frames(film, kept(tmp_path / "2"), workers=2)) == wanted


def test_a_killed_run_goes_on_with_the_stretch_it_was_in(
    film: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    wanted = listed(clip_frames(film, None))
    looked, moving = [], clip_module.moving

    def killed(stills: Iterator[object]) -> Iterator[object]:
        looked.append(len(looked))
        if len(looked) == 2:
            raise KeyboardInterrupt
        yield from moving(stills)

    monkeypatch.setattr(clip_module, "moving", killed)
    with pytest.raises(KeyboardInterrupt):
        list(clip_frames(film, kept(tmp_path)))
    assert kept(tmp_path).has("stretch_000000")
    assert not kept(tmp_path).has("stretch_000001")
    assert listed(clip_frames(film, kept(tmp_path))) == wanted
    assert len(looked) == 4  # the first once, the second twice, the third once


def test_a_finished_stretch_is_taken_as_it_is(film: Path, tmp_path: Path) -> None:
    """The twin: what lies in the folder decides, so the tests above could fail."""
    folder = kept(tmp_path)
    wanted = listed(clip_frames(film, folder))
    held = folder.arrays("stretch_000001")
    assert held is not None
    folder.keep("stretch_000001", **{**held, "pixels": held["pixels"] // 2})
    assert listed(clip_frames(film, folder)) != wanted


def test_a_run_with_other_settings_leaves_the_parts_of_one_that_is_going(
    film: Path, tmp_path: Path
) -> None:
    one, other = Args(sources=(film,), out=tmp_path), Args(sources=(film,), out=tmp_path, fov=50)
    with _kept([film], one) as going:
        going.keep("tracked", places=np.arange(3))
        with pytest.raises(ConfigError, match="still going"), _kept([film], other):
            pass
        assert going.has("tracked")
    assert list(tmp_path.iterdir()) == []


def test_parts_of_other_settings_are_thrown_away(tmp_path: Path) -> None:
    kept(tmp_path).keep("tracked", places=np.arange(3))
    assert kept(tmp_path).has("tracked")
    assert not KeptFolder(tmp_path / ".kept", b"another key").has("tracked")


def test_each_stretch_is_read_once(
    film: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder, read = kept(tmp_path), []
    arrays = KeptFolder.arrays

    def noted(self: KeptFolder, name: str) -> dict[str, np.ndarray] | None:
        read.append(name)
        return arrays(self, name)

    monkeypatch.setattr(KeptFolder, "arrays", noted)
    frames = clip_frames(film, folder)
    next(frames)
    assert [name for name in read if name.startswith("stretch")] == ["stretch_000000"]
    list(frames)
    assert len(read) == len(set(read)) > 2
