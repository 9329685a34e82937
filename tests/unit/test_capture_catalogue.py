"""What is known of clips: from a table, from a simulation, from their names."""

import json
from pathlib import Path

import pytest

from deeplight.capture.catalogue import drawn_split, find_clips
from deeplight.errors import ConfigError, DataSetError


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for name in ("a.mp4", "b.MOV", "notes.txt", ".hidden.mp4"):
        (tmp_path / name).write_bytes(b"x")
    return tmp_path


def table(folder: Path, *rows: str) -> Path:
    path = folder / "clips.csv"
    path.write_text("\n".join(["clip,place,scene,split,licence", *rows]))
    return path


def test_folders_are_searched_for_videos(folder: Path) -> None:
    clips = find_clips([folder, folder / "a.mp4"])
    assert [clip.path.name for clip in clips] == ["a.mp4", "b.MOV"]
    assert [clip.place for clip in clips] == ["a", "b"]


def test_a_table_decides(folder: Path) -> None:
    rows = table(folder, "a.mp4,hall,indoor,test,CC0", "b.MOV,park,outdoor,seen,")
    one, two = find_clips([folder], rows)
    assert (one.place, one.split, one.licence) == ("hall", "unseen_indoor", "CC0")
    assert (two.place, two.split, two.licence) == ("park", "seen_outdoor", "not stated")


def test_a_simulated_clips_truth_is_asked_without_a_table(folder: Path) -> None:
    truth = {"place": "mill", "scene": "outdoor", "split": "val", "licence": "CC0"}
    (folder / "a.truth.json").write_text(json.dumps(truth))
    assert find_clips([folder])[0].split == "val_outdoor"
    assert find_clips([folder], table(folder))[0].place == "a"


def test_names_draw_80_10_10_and_always_the_same() -> None:
    drawn = [drawn_split(f"clip{n}") for n in range(3000)]
    assert drawn == [drawn_split(f"clip{n}") for n in range(3000)]
    for split, share in (("train", 0.8), ("val", 0.1), ("test", 0.1)):
        assert drawn.count(split) / 3000 == pytest.approx(share, abs=0.02)


def test_two_clips_of_one_name_are_refused(folder: Path) -> None:
    (folder / "sub").mkdir()
    (folder / "sub" / "a.mov").write_bytes(b"x")
    with pytest.raises(ConfigError, match=r"a\.mp4 and .*a\.mov"):
        find_clips([folder, folder / "sub"])
    with pytest.raises(ConfigError, match="at least one clip"):
        find_clips([])


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (["a.mp4,hall,indoor,"], "complete"),
        (["a.mp4,hall,cellar,val,x"], "scene 'cellar'"),
        (["a.mp4,hall,indoor,val_outdoor,x"], "val_outdoor"),
        (["a.mp4,hall,indoor,train,x", "b.MOV,hall,indoor,val,x"], "hall"),
    ],
)
def test_a_table_that_contradicts_itself_is_reported(
    folder: Path, rows: list[str], message: str
) -> None:
    with pytest.raises(DataSetError, match=message):
        find_clips([folder], table(folder, *rows))
