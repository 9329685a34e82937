"""A file is written whole or not at all."""

from pathlib import Path

import pytest

from deeplight.io.atomic import replacing


def test_the_file_appears_only_at_the_end(tmp_path: Path) -> None:
    target = tmp_path / "new" / "light.exr"
    with replacing(target) as temporary:
        temporary.write_text("whole")
        assert not target.exists()
        assert temporary.parent == target.parent  # a rename across disks would not be atomic
        assert temporary.suffix == ".exr"
    assert target.read_text() == "whole"
    assert [entry.name for entry in target.parent.iterdir()] == ["light.exr"]


@pytest.mark.parametrize("failure", [ValueError, KeyboardInterrupt])
def test_a_failure_keeps_the_old_file_and_leaves_nothing(
    tmp_path: Path, failure: type[BaseException]
) -> None:
    target = tmp_path / "light.exr"
    target.write_text("old")

    def write() -> None:
        with replacing(target) as temporary:
            temporary.write_text("half")
            raise failure

    with pytest.raises(failure):
        write()
    assert target.read_text() == "old"
    assert list(tmp_path.iterdir()) == [target]


def test_a_block_that_writes_nothing_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError), replacing(tmp_path / "light.exr"):
        pass


def test_a_very_long_name_can_be_written(tmp_path: Path) -> None:
    target = tmp_path / ("n" * 250 + ".exr")
    with replacing(target) as temporary:
        temporary.write_text("whole")
    assert target.read_text() == "whole"
