"""Places to film in: HDR panoramas, where they were taken, and which split they belong to."""

import hashlib
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from deeplight.dataset.example import SCENES
from deeplight.errors import DataSetError, ImageFileError
from deeplight.io.environment_file import SUFFIXES, read_environment
from deeplight.mappings import latlong, resample
from deeplight.report.table import read_table

MANIFEST = "manifest.csv"
WORKING_HEIGHT = 512  # finer than the 192 x 135 photo needs; keeps a 16k panorama small
MIN_HEIGHT = 64
UNKNOWN_LICENCE = "not stated"

_HELD_OUT = {"val": "val_{}", "test": "unseen_{}"}
_COLUMNS = ("file", "split", "place", "scene")
_VALUES = {"split": ("train", *_HELD_OUT), "scene": SCENES}


@dataclass(frozen=True)
class Place:
    """One panorama and what is known about it.

    Attributes:
        path: the panorama.
        name: the venue; panoramas of one venue share it, and their split.
        scene: "indoor" or "outdoor".
        split: "train", "val" or "test".
        licence: as stated where it was found.
        synthetic_ground: its lower half is made up, so nothing real is seen looking down.
    """

    path: Path
    name: str
    scene: str
    split: str
    licence: str = UNKNOWN_LICENCE
    synthetic_ground: bool = False

    @property
    def held_out_split(self) -> str:
        """The evaluation split of takes made here: new takes of a training place are "seen"."""
        return _HELD_OUT.get(self.split, "seen_{}").format(self.scene)


def places_in(folder: Path) -> list[Place]:
    """Every panorama of a folder, sorted by file.

    With a `manifest.csv` (columns file, split, place, scene; optional licence,
    synthetic_ground) those it names. Without one every .hdr and .exr: each file is its own
    place, its split is drawn from its name (80 % train, 10 % val, 10 % test), and its scene
    is guessed from the light overhead.

    Raises:
        DataSetError: no such folder, no panorama in it, or a broken manifest.
    """
    if not folder.is_dir():
        raise DataSetError(
            "a folder of HDR panoramas", f"{folder}", "give a folder of .hdr or .exr"
        )
    manifest = folder / MANIFEST
    places = list(_listed(manifest) if manifest.is_file() else _found(folder))
    if not places:
        raise DataSetError(f"panoramas ({', '.join(SUFFIXES)}) in {folder}", "none", "add some")
    return sorted(places, key=lambda place: place.path.name)


def load(place: Place) -> Float[np.ndarray, "height width 3"]:
    """Radiance of a panorama, at most 512 x 1024, in the file's own scale.

    Raises:
        OSError, ImageFileError: missing, broken, of no mapping's shape, too small, black.
    """
    radiance = read_environment(place.path, max_height=WORKING_HEIGHT).radiance
    if len(radiance) < MIN_HEIGHT:
        got = f"{len(radiance)} in {place.path}"
        raise ImageFileError(f"a panorama of at least {MIN_HEIGHT} rows", got, "give a finer one")
    return radiance


def guessed_scene(radiance: Float[np.ndarray, "height width 3"]) -> str:
    """ "outdoor" if the light overhead is blue or much brighter than the floor, else "indoor".

    A guess for folders without a manifest: right for 77 % of 135 panoramas of known scene.
    """
    small = resample.shrink_latlong(radiance, 32)
    weight = latlong.solid_angles(*small.shape[:2])
    overhead, floor = (np.average(small[r], axis=(0, 1), weights=weight[r]) for r in _CAPS)
    blue = overhead[2] / max(float(overhead.sum()), 1e-9)
    return "outdoor" if blue > 0.36 or overhead.sum() > 6 * floor.sum() else "indoor"


_CAPS = (slice(0, 10), slice(-10, None))


def _listed(manifest: Path) -> Iterator[Place]:
    for row in read_table(manifest, _COLUMNS):
        for column, allowed in _VALUES.items():
            if row[column] not in allowed:
                expected = f"{column} of {', '.join(allowed)} in {manifest}"
                raise DataSetError(expected, f"{row[column]!r} for {row['file']}", "correct it")
        yield Place(
            manifest.parent / row["file"],
            row["place"],
            row["scene"],
            row["split"],
            row.get("licence") or UNKNOWN_LICENCE,
            (row.get("synthetic_ground") or "").lower() in ("true", "yes", "1"),
        )


def split_drawn_for(name: str) -> str:
    """The split of a place of which nothing but its name is known: 80 % train, 10 % val, test."""
    draw = int.from_bytes(hashlib.sha256(os.fsencode(name)).digest()[:4], "big") / 2**32
    return "train" if draw < 0.8 else "val" if draw < 0.9 else "test"


def _found(folder: Path) -> Iterator[Place]:
    for path in sorted(folder.iterdir()):
        if path.suffix.lower() in SUFFIXES and path.is_file():
            split = split_drawn_for(path.stem)
            place = Place(path, path.stem, "outdoor", split)
            try:
                scene = guessed_scene(load(place))
            except (OSError, ImageFileError):
                scene = "outdoor"  # the run meets the file again and records why it is skipped
            yield Place(path, path.stem, scene, split)
