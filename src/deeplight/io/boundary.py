"""The one place where what decoders raise becomes one line about one file."""

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import ParamSpec, TypeVar

from deeplight.errors import ImageFileError, InputError

MAX_REASON = 160  # characters of a library's own words

_Arguments = ParamSpec("_Arguments")
_Result = TypeVar("_Result")


@contextmanager
def reading(path: Path | str, error: type[InputError] = ImageFileError) -> Iterator[None]:
    """Turn any exception met while `path` is read into one `InputError` that names it.

    Decoders of broken files raise whatever their code runs into: IndexError, RuntimeError,
    RecursionError, an OSError of their own making. None of that may end a batch. Kept as they are:
    an `InputError` raised on purpose, an OSError of the operating system (it has a number), and a
    package that is not installed. What was raised is the new error's `__cause__`.

    In a generator it covers reading alone: what the caller does with an item is not its business,
    since Python does not raise a caller's exception inside the generator.

    Raises:
        error: anything else was raised inside.
    """
    try:
        yield
    except (InputError, ModuleNotFoundError):
        raise
    except OSError as cause:
        if cause.errno is not None:
            raise
        raise unreadable(path, cause, error) from cause
    except MemoryError as cause:
        got = f"{path}, which needs more memory than there is"
        raise error("a file that fits into memory", got, "make it smaller first") from cause
    except Exception as cause:
        raise unreadable(path, cause, error) from cause


def reads_as(
    error: type[InputError],
) -> Callable[[Callable[_Arguments, _Result]], Callable[_Arguments, _Result]]:
    """Put `reading` around a function whose first argument is the file's path.

    Libraries' warnings about the file are left out: what counts becomes an error or a note.

    Args:
        error: what a file that cannot be read becomes.
    """

    def bound(function: Callable[_Arguments, _Result]) -> Callable[_Arguments, _Result]:
        @wraps(function)
        def bounded(*args: _Arguments.args, **options: _Arguments.kwargs) -> _Result:
            path = str(args[0] if args else options["path"])
            with reading(path, error), warnings.catch_warnings(action="ignore"):
                return function(*args, **options)

        return bounded

    return bound


reads = reads_as(ImageFileError)
"""The same for pictures and light."""


def unreadable(
    path: Path | str, cause: BaseException, error: type[InputError] = ImageFileError
) -> InputError:
    """Make the error for a file whose reader failed with `cause`."""
    reason = " ".join(str(cause).split()) or type(cause).__name__
    if isinstance(cause, UnicodeDecodeError):  # its words hold the whole undecodable text
        reason = "text in it is not UTF-8"
    elif isinstance(cause, RecursionError):
        reason = "nested too deep"
    reason = ascii(reason)[1:-1] if not reason.isprintable() else reason
    got = f"{path}, truncated or damaged ({reason[:MAX_REASON]})"
    return error("a complete file", got, "copy or download it again")
