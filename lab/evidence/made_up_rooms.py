"""Whether Gardner 2017 finds lights in new rooms where there are enough rooms to learn from.

    python -m lab.worlds --rooms 120 --out WORLDS --worlds.height 96 --worlds.samples 6
    python -m lab.evidence.made_up_rooms WORLDS OUT --start landscape.onnx

Trains preset gardner_2017-ours on views of the first few made-up rooms, and of all that
are neither for validation nor for the test, and looks for lights as `lab.evidence.light_masks`
does, in the rooms it learnt from and in new ones. A trained rival in OUT is used again.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tyro

from deeplight.cli.main import run_command
from deeplight.cli.screen import progress_bar
from deeplight.errors import ConfigError
from deeplight.evaluate.rivals.crops import all_pairs
from deeplight.evaluate.rivals.rival import PRESETS, Rival, load_rival
from deeplight.evaluate.rivals.training import train_rival
from deeplight.simulate.panorama import Place, load, places_in
from lab.evidence.light_masks import HEAD, Look, row
from lab.evidence.table_2 import FILTER_EPOCHS

PRESET = "gardner_2017-ours"


@dataclass(frozen=True)
class Args:
    """Options of `python -m lab.evidence.made_up_rooms`."""

    worlds: tyro.conf.Positional[Path]
    """Folder that `lab.worlds` made, of rooms."""
    out: tyro.conf.Positional[Path]
    """Folder of the trained rivals."""
    start: Path
    """Network of ours that the encoder is taken from."""
    rooms: tuple[int, ...] = (20, 84)
    """To learn from."""
    validation: int = 12
    """Rooms, after those."""
    test: int = 24
    """Rooms, the last."""
    views: int = 8
    """Of each panorama; a room has one by day, one in the evening, and so on."""
    steps: int = 300
    """Of each training."""


def splits(args: Args) -> tuple[list[Place], list[Place], list[Place]]:
    """Panoramas to learn from, to choose the step with, and to test on: of different rooms.

    Raises:
        ConfigError: there are too few rooms.
    """
    places = places_in(args.worlds)
    names = np.unique([place.name for place in places])
    wanted = max(args.rooms) + args.validation + args.test
    if len(names) < wanted:
        raise ConfigError(f"{wanted} rooms in {args.worlds}", f"{len(names)}", "make more")
    first, second = wanted - args.validation - args.test, wanted - args.test
    parts = [set(part) for part in np.split(names[:wanted], [first, second])]
    train, validation, test = ([p for p in places if p.name in part] for part in parts)
    return train, validation, test


def trained(args: Args, train: Sequence[Place], validation: Sequence[Place], name: str) -> Rival:
    """The rival in OUT, or a new one."""
    path = args.out / f"{name}.safetensors"
    if path.is_file():
        return load_rival(path)
    views = replace(PRESETS[PRESET].views, per_panorama=args.views)
    epoch = max(1, args.steps // FILTER_EPOCHS)
    config = replace(PRESETS[PRESET], views=views, steps=args.steps, epoch_steps=epoch)
    args.out.mkdir(parents=True, exist_ok=True)
    pairs, held_out = (all_pairs([load(p) for p in part], views) for part in (train, validation))
    checkpoint = path.with_suffix(".checkpoint")
    with progress_bar(f"{name}: {len(pairs)} views", args.steps) as bar:
        rival = train_rival(
            config, pairs, held_out, args.start, checkpoint, lambda step, loss: bar()
        )
    rival.save(path)
    return rival


def run(args: Args) -> None:
    train, validation, test = splits(args)
    names = np.unique([place.name for place in train])
    for count in args.rooms:
        some = [place for place in train if place.name in set(names[:count])]
        rival = trained(args, some, validation, f"rooms_{count}")
        print(HEAD.format(f"{count} rooms, {len(some)} panoramas"))
        few = some[:: max(1, len(some) // 40)]
        for name, places in {"other views of those rooms": few, "new rooms": test}.items():
            print(row(name, rival, Look(places, 8, 8)), flush=True)


if __name__ == "__main__":
    sys.exit(
        run_command("python -m lab.evidence.made_up_rooms", sys.modules[__name__], sys.argv[1:])
    )
