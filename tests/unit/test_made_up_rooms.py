"""Made-up rooms to learn from, to choose with and to test on are different rooms."""

from pathlib import Path

import pytest

from deeplight.errors import ConfigError
from lab.evidence.made_up_rooms import Args, splits


def worlds(folder: Path, rooms: int) -> Path:
    rows = ["file,split,place,scene,licence,synthetic_ground"]
    for number in range(rooms):
        for mood in ("day", "night"):
            file = f"made_room_0_{number:04d}_{mood}.exr"
            (folder / file).touch()
            rows.append(f"{file},train,made_room_0_{number:04d},indoor,CC0,false")
    (folder / "manifest.csv").write_text("\n".join(rows) + "\n")
    return folder


def test_no_room_is_in_two_parts(tmp_path: Path) -> None:
    args = Args(worlds(tmp_path, 12), tmp_path, tmp_path, rooms=(2, 5), validation=3, test=4)
    names = [{place.name for place in part} for part in splits(args)]
    assert [len(part) for part in names] == [5, 3, 4]
    assert len(set.union(*names)) == 12
    assert all(len(part) == 2 * len(own) for part, own in zip(splits(args), names, strict=True))


def test_too_few_rooms_are_refused(tmp_path: Path) -> None:
    args = Args(worlds(tmp_path, 6), tmp_path, tmp_path, rooms=(2, 5), validation=3, test=4)
    with pytest.raises(ConfigError, match="12 rooms"):
        splits(args)
