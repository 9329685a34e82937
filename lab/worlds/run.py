"""Made-up places into a folder of panoramas with its manifest."""

import csv
import io
import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import numpy as np

from deeplight.errors import ConfigError
from deeplight.io.atomic import replacing
from deeplight.io.radiance import write_exr
from deeplight.simulate.panorama import MANIFEST
from lab.worlds.landscape import draw_landscape
from lab.worlds.room import draw_room
from lab.worlds.settings import Worlds
from lab.worlds.trace import panoramas
from lab.worlds.world import World

KINDS = ("room", "sky")
LICENCE = "CC0, made by deeplight simulate"
PLAN = "worlds.json"  # next to the panoramas: what they were made with
COLUMNS = ("file", "split", "place", "scene", "licence", "synthetic_ground")


def world_of(kind: str, number: int, seed: int) -> World:
    """A place; the same whatever else is made."""
    rng = np.random.default_rng([seed, *kind.encode(), number])
    return draw_room(rng) if kind == "room" else draw_landscape(rng)


def make_worlds(
    folder: Path,
    rooms: int,
    skies: int,
    worlds: Worlds,
    progress: Callable[[int], None] = lambda places: None,
) -> int:
    """Write the panoramas that are missing and the manifest of all; give how many there are.

    A room has two panoramas or four: by day, in the evening, by night; open ground has three:
    clear, hazy, overcast. Every place is for training: what was made up can test nothing.

    Raises:
        ConfigError: a count below 0, or the folder holds panoramas of something else.
        MissingExtraError: Mitsuba is not installed.
        OSError: a file cannot be written.
    """
    if min(rooms, skies) < 0:
        raise ConfigError("rooms and skies from 0", f"{rooms} and {skies}", "correct them")
    _begin(folder, worlds)
    rows = []
    every = [("room", number) for number in range(rooms)]
    every += [("sky", number) for number in range(skies)]
    for kind, number in every:
        world = world_of(kind, number, worlds.seed)
        place = f"made_{kind}_{worlds.seed}_{number:04d}"
        files = {mood: f"{place}_{mood}.exr" for mood in world.moods}
        if not all((folder / file).is_file() for file in files.values()):
            grain = 16 * number + 8 * KINDS.index(kind)
            for mood, radiance in panoramas(world, worlds.height, worlds.samples, grain).items():
                write_exr(folder / files[mood], radiance)
        rows += [(file, "train", place, world.scene, LICENCE, "false") for file in files.values()]
        progress(1)
    table = io.StringIO()
    csv.writer(table, lineterminator="\n").writerows([COLUMNS, *rows])
    with replacing(folder / MANIFEST) as temporary:
        temporary.write_text(table.getvalue(), encoding="utf-8")
    return len(rows)


def _begin(folder: Path, worlds: Worlds) -> None:
    """Remember in the folder what it is made with; refuse one that holds anything else."""
    plan, made_with = folder / PLAN, asdict(worlds)
    if plan.is_file():
        if json.loads(plan.read_text(encoding="utf-8")) != made_with:
            raise ConfigError(
                f"the settings that {plan} began with", "others", "use another folder"
            )
    elif (folder / MANIFEST).exists():
        got = f"{folder} with panoramas of something else"
        raise ConfigError("a folder for made-up places alone", got, "use another folder")
    else:
        with replacing(plan) as temporary:
            temporary.write_text(json.dumps(made_with), encoding="utf-8")
