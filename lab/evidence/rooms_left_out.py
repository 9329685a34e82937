"""Whether Gardner 2017 finds lights in rooms it has not seen: each room is left out once.

    python -m lab.evidence.rooms_left_out HDRI OUT --starts landscape.onnx imagenet.npz

All indoor places, of every split, are dealt to `folds` parts. For each part the preset
gardner_2017-ours learns from the other parts, but for a few places that choose its step, and
answers for the part. Lights are looked for as `lab.evidence.light_masks` does; what chance gives
is the same network's answer for another room of its part. ImageNet's encoder has seen none of the
rooms; that of a network of ours has seen the training places' spheres. A trained rival in OUT is
used again, a training that was killed goes on.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
import tyro

from deeplight.camera import PinholeCamera
from deeplight.cli.main import run_command
from deeplight.cli.screen import progress_bar
from deeplight.evaluate.rivals.crops import Pair, all_pairs
from deeplight.evaluate.rivals.gardner_2017 import ROWS
from deeplight.evaluate.rivals.rival import PRESETS, Rival, load_rival
from deeplight.evaluate.rivals.training import train_rival
from deeplight.frames import rotation, turned
from deeplight.fuse.view import inside
from deeplight.mappings import latlong
from deeplight.simulate.panorama import Place, load, places_in
from lab.evidence.light_masks import HEAD, Mask, Scores, Texels, another_place, line, small
from lab.evidence.table_2 import FILTER_EPOCHS

PRESET = "gardner_2017-ours"
BUILDINGS = ("brown", "christmas", "studio")
"""First words of the names of places that are studios of one building each."""


@dataclass(frozen=True)
class Args:
    """Options of `python -m lab.evidence.rooms_left_out`."""

    hdri: tyro.conf.Positional[Path]
    """Folder of HDR panoramas."""
    out: tyro.conf.Positional[Path]
    """Folder of the trained rivals."""
    starts: tuple[Path, ...]
    """What the encoder is taken from, each in turn: ImageNet's (.npz) or a network of ours."""
    folds: int = 5
    """Parts."""
    set_aside: int = 6
    """Places of each training that choose its step."""
    views: int = 16
    """Measured of each panorama."""
    steps: int = 1000
    """Of each training."""


def unit_of(place: Place) -> str:
    """Its name; studios of one building are one, since a network that saw one knows the others."""
    first = place.name.split("_")[0]
    return first if first in BUILDINGS else place.name


def parts_of(rooms: Sequence[Place], folds: int, seed: int = 0) -> np.ndarray:
    """Each panorama's part: about as many units of every split in each."""
    random = np.random.default_rng(seed)
    part: dict[str, int] = {}
    for split in ("train", "val", "test"):
        units = sorted({unit_of(room) for room in rooms if room.split == split})
        for unit in random.permutation(units):
            part[str(unit)] = len(part) % folds
    return np.array([part[unit_of(room)] for room in rooms])


def set_aside(units: np.ndarray, count: int, seed: int) -> np.ndarray:
    """Which of a training's panoramas choose its step: those of some units."""
    chosen = np.random.default_rng([7, seed]).choice(np.unique(units), count, replace=False)
    return np.isin(units, chosen)


@dataclass(frozen=True, eq=False)
class Rooms:
    """All rooms and their views.

    Attributes:
        places: one per panorama.
        units: of each, what is left out together.
        parts: of each, when it is left out.
        pairs: its views.
    """

    places: Sequence[Place]
    units: np.ndarray
    parts: np.ndarray
    pairs: Sequence[Sequence[Pair]]

    @classmethod
    def of(cls, args: Args) -> "Rooms":
        """Film all of them."""
        rooms = [p for p in places_in(args.hdri) if p.scene == "indoor" and not p.synthetic_ground]
        plan = PRESETS[PRESET].views
        pairs = [all_pairs([load(room)], plan, seed) for seed, room in enumerate(rooms)]
        units = np.array([unit_of(room) for room in rooms])
        return cls(rooms, units, parts_of(rooms, args.folds), pairs)

    def some(self, mask: np.ndarray) -> list[Pair]:
        """Views of the chosen panoramas."""
        return [pair for number in np.flatnonzero(mask) for pair in self.pairs[int(number)]]


def trained(args: Args, rooms: Rooms, start: Path, part: int) -> Rival:
    """The rival in OUT that has not seen this part, or a new one."""
    path = args.out / f"{start.stem}_{part}.safetensors"
    if path.is_file():
        return load_rival(path)
    others = rooms.parts != part
    held_out = np.zeros(len(others), bool)
    held_out[others] = set_aside(rooms.units[others], args.set_aside, part)
    epoch = max(1, args.steps // FILTER_EPOCHS)
    config = replace(PRESETS[PRESET], steps=args.steps, epoch_steps=epoch)
    args.out.mkdir(parents=True, exist_ok=True)
    with progress_bar(path.stem, args.steps) as bar:
        rival = train_rival(
            config,
            rooms.some(others & ~held_out),
            rooms.some(held_out),
            start,
            path.with_suffix(".checkpoint"),
            lambda step, loss: bar(),
        )
    rival.save(path)
    return rival


def beyond(pair: Pair) -> Mask:
    """Texels of the panorama that a view does not show."""
    camera = PinholeCamera(pair.photo.shape[1], pair.photo.shape[0], pair.fov_rad)
    camera_from_level = rotation("x", pair.elevation_rad).T
    rays = turned(latlong.directions(ROWS, 2 * ROWS).reshape(-1, 3), camera_from_level)
    return ~inside(camera, rays).reshape(ROWS, 2 * ROWS)


def rows(args: Args, rooms: Rooms, start: Path) -> list[str]:
    """Lines of the table: every room answered for by a rival that has not seen it."""
    order = np.argsort(rooms.parts, kind="stable")
    units = np.repeat(rooms.units[order], args.views)
    splits = np.repeat([rooms.places[int(n)].split for n in order], args.views)
    parts = np.repeat(rooms.parts[order], args.views)
    pairs = [pair for number in order for pair in rooms.pairs[int(number)][: args.views]]
    answers: list[Texels] = []
    for part in range(args.folds):
        rival = trained(args, rooms, start, part)
        answers += [small(rival.panorama(pairs[n].photo)) for n in np.flatnonzero(parts == part)]
    true = [small(pair.panorama) for pair in pairs]
    firsts = np.searchsorted(parts, parts)  # of each view's part
    within = [another_place(units[parts == part]) for part in range(args.folds)]
    others = np.concatenate(within) + firsts
    scores = Scores.of(answers, true, others)
    unseen = Scores.of(answers, true, others, [beyond(pair) for pair in pairs])
    of = {
        "all rooms": (scores, splits != ""),
        "all rooms, lights that the photo does not show": (unseen, splits != ""),
        "training rooms": (scores, splits == "train"),
        "validation rooms": (scores, splits == "val"),
        "test rooms": (scores, splits == "test"),
    }
    return [line(f"{start.stem}, {name}", some, units, mask) for name, (some, mask) in of.items()]


def run(args: Args) -> None:
    torch.set_num_threads(1)
    rooms = Rooms.of(args)
    print(HEAD.format("encoder, rooms left out"))
    for start in args.starts:
        print("\n".join(rows(args, rooms, start)), flush=True)


if __name__ == "__main__":
    sys.exit(
        run_command("python -m lab.evidence.rooms_left_out", sys.modules[__name__], sys.argv[1:])
    )
