"""What `deeplight estimate` is asked to work on, and what its results are called."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import count
from pathlib import Path

from deeplight.errors import InputError
from deeplight.io.atomic import fitted
from deeplight.io.photos import Photo, photo_paths, read_photo
from deeplight.io.video import frames, is_video

RESULT_SUFFIXES = (".exr", ".hdr", ".json", ".preview.png", ".webxr.json")


@dataclass(frozen=True)
class Source:
    """One photo or video.

    Attributes:
        path: the file.
        stem: name of its results, without suffix; a video's frames add their number to it.
    """

    path: Path
    stem: str

    def photos(self, max_side: int | None = None) -> Iterator[tuple[str, Photo]]:
        """Read the photo, or the video's frames one by one, each with the name of its results.

        Args:
            max_side: of a photo, as `read_photo` takes it.

        Raises:
            OSError: the file cannot be read.
            InputError: it is no photo or video, or damaged; for a video raised where it is met.
        """
        if not is_video(self.path):
            yield self.stem, read_photo(self.path, max_side)
            return
        for index, photo in enumerate(frames(self.path)):
            yield f"{self.stem}_{index:06d}", photo


def find_sources(
    paths: Iterable[Path], out: Path
) -> tuple[list[Source], list[InputError | OSError]]:
    """Find the photos and videos that `paths` name, and why the other paths name none.

    No two sources get the same name, and no result gets the name of a source: photos of equal name
    from two folders are distinguished by their folder, and else by their suffix or a number.
    """
    files: list[Path] = []
    failures: list[InputError | OSError] = []
    for path in paths:
        try:
            files += [file for file in photo_paths([path]) if file not in files]
        except (InputError, OSError) as error:
            failures.append(error)
    inputs = {_key(file) for file in files}
    taken: set[str] = set()
    sources = []
    for file in files:
        stem = next(name for name in _names(file) if _is_free(name, out, taken, inputs))
        taken.add(stem.casefold())
        sources.append(Source(file, stem))
    return sources, failures


def _names(file: Path) -> Iterator[str]:
    """Give names for the results of `file`, the nicest first; shortened if they must be."""
    yield fitted(file.stem)
    if file.resolve().parent.name:
        yield fitted(f"{file.resolve().parent.name}_{file.stem}")
    yield fitted(f"{file.stem}_{file.suffix.removeprefix('.')}")
    yield from (f"{fitted(file.stem)}_{number}" for number in count(2))


def _is_free(name: str, out: Path, taken: set[str], inputs: set[str]) -> bool:
    overwrites = {_key(out / f"{name}{suffix}") for suffix in RESULT_SUFFIXES} & inputs
    return name.casefold() not in taken and not overwrites


def _key(path: Path) -> str:
    """Give one key per file; some file systems take upper and lower case for the same."""
    return str(path.resolve()).casefold()
