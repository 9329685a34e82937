"""The clips to work on, and what is known of each: place, scene, split, licence.

A table in CSV names them (columns clip, place, scene, split; optional licence). Without one a
simulated clip's truth next to it is asked, never for geometry; every other clip is its own place.
"""

import hashlib
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from deeplight.capture.truth import true_place
from deeplight.dataset import SPLITS
from deeplight.dataset.example import SCENES
from deeplight.dataset.splits import check_places
from deeplight.errors import ConfigError, DataSetError
from deeplight.io.video import is_video
from deeplight.report.table import read_table

COLUMNS = ("clip", "place", "scene", "split")
UNKNOWN_LICENCE = "not stated"
_SPLIT_WORDS = {"train": "train", "seen": "seen_{}", "val": "val_{}", "test": "unseen_{}"}


@dataclass(frozen=True)
class Clip:
    """One video and what is known of it.

    Attributes:
        path: of the video.
        place: its venue; all clips of one venue are in one kind of split.
        scene: "indoor" or "outdoor".
        split: of the data set.
        licence: as stated.
    """

    path: Path
    place: str
    scene: str
    split: str
    licence: str = UNKNOWN_LICENCE

    @property
    def stem(self) -> str:
        """Its name in the data set and its report's."""
        return self.path.stem


def find_clips(
    paths: Sequence[Path], table: Path | None = None, scene: str = "indoor"
) -> tuple[Clip, ...]:
    """Give the clips that `paths` name, files or folders of videos, sorted by name.

    Args:
        paths: files of any suffix, and folders, which are searched for videos.
        table: a CSV of what is known of them; clips it does not name are left to the rest.
        scene: of clips of which nothing else is known.

    Raises:
        ConfigError: no clip, or two of one name.
        OSError: the table cannot be read.
        DataSetError: a broken table, or a place that is both trained on and held out.
    """
    if scene not in SCENES:
        raise ConfigError(f"a scene of {', '.join(SCENES)}", repr(scene), "choose one")
    found: dict[str, Path] = {}
    for path in _files(paths):
        other = found.setdefault(path.stem, path)
        if other.resolve() != path.resolve():
            got = f"{other} and {path}"
            raise ConfigError("clips of different names, for their reports", got, "rename one")
    if not found:
        raise ConfigError("at least one clip or folder of clips", "none", "name one")
    rows = {}
    if table is not None:
        rows = {Path(row["clip"]).name: row for row in read_table(table, COLUMNS)}
    clips = tuple(_known(path, rows, table is not None, scene) for _, path in sorted(found.items()))
    places: dict[str, set[str]] = {}
    for clip in clips:
        places.setdefault(clip.split, set()).add(clip.place)
    check_places(places)
    return clips


def _files(paths: Sequence[Path]) -> Iterable[Path]:
    for path in paths:
        if not path.is_dir():
            yield path
            continue
        videos = sorted(entry for entry in path.iterdir() if entry.is_file() and is_video(entry))
        yield from (video for video in videos if not video.name.startswith("."))


def _known(path: Path, rows: Mapping[str, dict[str, str]], has_table: bool, scene: str) -> Clip:
    row = rows.get(path.name) or rows.get(path.stem)
    if row is None:
        row = {} if has_table else true_place(path)
    try:
        scene = str(row.get("scene") or scene)
        split = _split(str(row.get("split") or drawn_split(path.stem)), scene)
    except ValueError as error:
        raise DataSetError(
            f"scenes of {', '.join(SCENES)} and splits of {', '.join(_SPLIT_WORDS)}",
            f"{error} for {path.name}",
            "correct the table of clips",
        ) from None
    place, licence = row.get("place") or path.stem, row.get("licence") or UNKNOWN_LICENCE
    return Clip(path, str(place), scene, split, str(licence))


def drawn_split(stem: str) -> str:
    """Draw a split from a name: 80 % train, 10 % val, 10 % test; the same name, the same split."""
    draw = int.from_bytes(hashlib.sha256(os.fsencode(stem)).digest()[:4], "big") / 2**32
    return "train" if draw < 0.8 else "val" if draw < 0.9 else "test"


def _split(word: str, scene: str) -> str:
    if scene not in SCENES:
        raise ValueError(f"scene {scene!r}")
    split = _SPLIT_WORDS.get(word, word).format(scene)
    if split not in SPLITS or (split != "train" and not split.endswith(scene)):
        raise ValueError(f"split {word!r} of an {scene} clip")
    return split
