"""The exceptions DeepLight raises on purpose.

    DeepLightError
    └── InputError              the caller's input is at fault: exit code 2, one line
        ├── ImageFileError      a photo, video or HDR file cannot be used
        ├── ShapeError          an array has another shape or range than it must have
        ├── ModelError          a model file is missing, broken or made for something else
        ├── DataSetError        a data set folder is missing, broken or breaks its own rules
        ├── ConfigError         settings that contradict each other or an earlier run
        ├── DownloadError       a file from the network that did not come, or another one came
        └── MissingExtraError   an optional dependency is not installed

Every `InputError` says what was expected, what was found and what to do about it.
"""

import re
from typing import Self


def _printable(text: str) -> str:
    """Give a message in one line, with control characters, as damaged files have them, written out.

    What such a file or a library says may have several lines.
    """
    text = re.sub(r"\s*[\n\r\t]\s*", " ", text)
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


class DeepLightError(Exception):
    """Base class of every error DeepLight raises on purpose."""


class InputError(DeepLightError):
    """Input that cannot be used, in one line a person can act on."""

    def __init__(self, expected: str, got: str, do: str) -> None:
        self.expected, self.got, self.do = (_printable(text) for text in (expected, got, do))
        super().__init__(f"expected {self.expected}; got {self.got}; {self.do}")

    def __reduce__(self) -> tuple[type[Self], tuple[str, ...]]:
        # The default would rebuild from the one joined message and fail, losing the
        # error on its way back from a worker process.
        return type(self), (self.expected, self.got, self.do)


class ImageFileError(InputError):
    """A photo, video or HDR file that cannot be used."""


class ShapeError(InputError):
    """An array of another shape, type or range than the function needs."""


class ModelError(InputError):
    """A model file that is missing, broken or made for something else."""


class DataSetError(InputError):
    """A data set that is missing, broken or breaks its own rules."""


class ConfigError(InputError):
    """Settings that contradict each other or an earlier run."""


class DownloadError(InputError):
    """A file that the network did not give, or not the one that was announced."""


class MissingExtraError(InputError):
    """An optional dependency is needed and not installed."""

    def __init__(self, extra: str, needed_for: str) -> None:
        self.extra, self.needed_for = extra, needed_for
        super().__init__(
            f"the optional packages of '{extra}' for {needed_for}",
            "an installation without them",
            f'run: pip install ".[{extra}]" in deeplight\'s folder',
        )

    def __reduce__(self) -> tuple[type[Self], tuple[str, ...]]:
        return type(self), (self.extra, self.needed_for)
