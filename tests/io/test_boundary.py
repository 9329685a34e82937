"""Whatever a reader raises, its caller sees one line with the file's name."""

import errno
from collections.abc import Iterator
from pathlib import Path

import pytest

from deeplight.errors import DataSetError, ImageFileError, MissingExtraError, ModelError
from deeplight.io.boundary import reading, reads

FAULTS = [
    IndexError("list index out of range"),
    RuntimeError("Failed to decode frame 0:\nno planes"),
    EOFError(),
    RecursionError("maximum recursion depth exceeded"),
    OverflowError("too large"),
    AttributeError("'NoneType' object has no attribute 'width'"),
    UnicodeDecodeError("utf-8", b"\xff" * 50_000, 0, 1, "invalid start byte"),
    MemoryError(),
    OSError("image file is truncated"),
    KeyError("\x1b[31m\x00"),
]


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: type(fault).__name__)
def test_every_exception_becomes_one_line_that_names_the_file(fault: Exception) -> None:
    with pytest.raises(ImageFileError) as caught, reading("a/photo.png"):
        raise fault
    line = str(caught.value)
    assert "a/photo.png" in line
    assert line.isprintable()
    assert len(line) < 300
    assert caught.value.__cause__ is fault


KEPT = [
    ModelError("this", "that", "do"),
    MissingExtraError("heic", "reading it"),
    FileNotFoundError(errno.ENOENT, "No such file", "a.png"),
    ModuleNotFoundError("No module named 'av'", name="av"),
]


@pytest.mark.parametrize("kept", KEPT, ids=lambda kept: type(kept).__name__)
def test_what_was_raised_on_purpose_stays(kept: Exception) -> None:
    with pytest.raises(type(kept)) as caught, reading("a.png"):
        raise kept
    assert caught.value is kept


def test_an_interruption_is_no_fault_of_the_file() -> None:
    with pytest.raises(KeyboardInterrupt), reading("a.png"):
        raise KeyboardInterrupt


def test_the_kind_of_error_can_be_chosen() -> None:
    with pytest.raises(DataSetError), reading("a.json", DataSetError):
        raise ZeroDivisionError


def test_a_reader_is_wrapped_with_its_first_argument() -> None:
    @reads
    def first_line(path: Path | str, number: int = 0) -> str:
        return Path(path).read_text().splitlines()[number]

    with pytest.raises(ImageFileError, match=r"test_boundary\.py"):
        first_line(__file__, number=100_000)
    assert first_line(__file__).startswith('"""')


def test_a_callers_exception_passes_through_a_generator_untouched() -> None:
    def numbers() -> Iterator[int]:
        with reading("a.mp4"):
            yield from (1, 2)
            raise IndexError

    with pytest.raises(ZeroDivisionError):
        [1 // (number - 1) for number in numbers()]
    with pytest.raises(ImageFileError):
        list(numbers())
