"""From a folder of panoramas to a data set: plan the shards, film them, in parallel."""

import math
import os
import re
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from deeplight.dataset import (
    Example,
    ExampleMeta,
    Manifest,
    ShardJob,
    ShardPlan,
    Skipped,
    plan_split,
)
from deeplight.errors import ConfigError, DataSetError, InputError
from deeplight.io.atomic import only_run
from deeplight.jobs import LOCAL, Engine, run
from deeplight.simulate import panorama
from deeplight.simulate.many_phones import draw_phone, kept_phone
from deeplight.simulate.many_takes import drawn_height, film_many
from deeplight.simulate.panorama import Place
from deeplight.simulate.phone import PHONES
from deeplight.simulate.place_light import PlaceLight
from deeplight.simulate.take import Frame, film
from deeplight.simulate.vary import varied
from deeplight.sphere import PAPER_RIG

MADE_UP_GROUND = "its ground is made up"  # why a panorama is left out on purpose
_UNSAFE = re.compile(r"[^A-Za-z0-9_-]")  # in names of takes; their numbers keep them apart
_LONGEST_VISIT = {"v1": 4, "v2": 16}  # takes in a row in one place: it is read once for them all
_EV100 = {"indoor": (6.5, 1.5), "outdoor": (12.5, 1.5)}  # assumed for a place: mean and spread


@dataclass(frozen=True)
class Recipe:
    """What decides every byte of a simulated data set.

    Attributes:
        train_takes: takes in each training panorama.
        eval_takes: takes in each validation and test panorama.
        seen_takes: takes in each training panorama for the "seen" evaluation splits.
        frames: examples of each take.
        phone: camera preset.
        synthetic_ground: film, looking up, in panoramas whose ground is made up.
        shard_takes: takes in each shard.
        seed: another seed films other takes.
        varied: share of training takes filmed in a varied copy of their place (`vary`).
        phones: "v1" films everything with one good camera (`phone`); "v2" films each take with
            another one of a wide family, and half of the test takes with one kept for them.
    """

    train_takes: int = 64
    eval_takes: int = 8
    seen_takes: int = 1
    frames: int = 8
    phone: str = "paper"
    synthetic_ground: bool = False
    shard_takes: int = 64
    seed: int = 0
    varied: float = 0.0
    phones: str = "v1"

    def takes(self, split: str) -> int:
        """Takes in each place of a split of the data set."""
        if split == "train":
            return self.train_takes
        return self.seen_takes if split.startswith("seen") else self.eval_takes

    def __post_init__(self) -> None:
        least = {"train_takes": 0, "eval_takes": 0, "seen_takes": 0, "seed": 0}
        least |= {"frames": 1, "shard_takes": 1}
        for name, limit in least.items():
            if getattr(self, name) < limit:
                got = f"{getattr(self, name)}"
                raise ConfigError(f"recipe.{name} of at least {limit}", got, "correct it")
        if not 0 <= self.varied <= 1:
            raise ConfigError("recipe.varied from 0 to 1", f"{self.varied}", "correct it")
        if self.phone not in PHONES:
            raise ConfigError(f"a phone of {', '.join(PHONES)}", self.phone, "choose one of these")
        if self.phones not in _LONGEST_VISIT:
            raise ConfigError("recipe.phones v1 or v2", f"{self.phones!r}", "choose one of these")
        if self.phones == "v2" and self.phone != "paper":
            got = f"recipe.phone {self.phone} and recipe.phones v2"
            raise ConfigError("one phone for all takes with recipe.phones v1 only", got, "drop one")


@dataclass(frozen=True)
class Simulation:
    """A recipe and the places it is filmed in; small enough to hand to every process."""

    recipe: Recipe
    places: dict[str, tuple[Place, ...]]  # by split
    left_out: tuple[Skipped, ...] = field(default=())

    def examples(self, job: ShardJob) -> Iterator[Example | Skipped]:
        """The examples of one shard; a panorama of no use is reported once and skipped."""
        if job.split == "train" and job.number == 0:
            yield from self.left_out
        first = job.first // self.recipe.frames
        last = first + job.count // self.recipe.frames
        opened: tuple[Place, _Opened | None] | None = None
        for take in range(first, last):
            place = self._place(job.split, take)
            if opened is None or opened[0] != place:
                try:
                    opened = place, self._open(place)
                except (OSError, InputError) as error:
                    opened = place, None
                    yield Skipped(place.path.name, str(error))
            if opened[1] is not None:
                yield from self._take(job.split, place, opened[1], take)

    def _open(self, place: Place) -> "_Opened":
        radiance = panorama.load(place)
        return _Opened(radiance, _light(radiance, place) if self.recipe.phones == "v2" else None)

    def _place(self, split: str, take: int) -> Place:
        places = self.places[split]
        visit = math.gcd(
            self.recipe.takes(split), _LONGEST_VISIT[self.recipe.phones]
        )  # leaves no place short
        return places[take // visit % len(places)]

    def _take(self, split: str, place: Place, opened: "_Opened", take: int) -> Iterator[Example]:
        recipe, radiance, light = self.recipe, opened.radiance, opened.light
        name = f"{_UNSAFE.sub('_', place.path.stem)[:60]}-{take:05d}"
        other = np.random.default_rng([recipe.seed, *name.encode()])  # leaves the take's own alone
        made = split == "train" and other.random() < recipe.varied
        if made:
            radiance = varied(radiance, other)
            light = _light(radiance, place) if light else None
        seed = [recipe.seed, *split.encode(), *os.fsencode(place.path.stem)]
        if light:
            camera, frames = _filmed_by_many(light, place, split, recipe.frames, [*seed], take)
        else:
            rng = np.random.default_rng([*seed, take])
            camera, phone = recipe.phone, PHONES[recipe.phone]
            frames = film(radiance, phone, PAPER_RIG, recipe.frames, rng, place.synthetic_ground)
        for number, frame in enumerate(frames):
            yield _example(frame, number, split, place, name, camera, made)


@dataclass(frozen=True, eq=False)
class _Opened:
    """A panorama, and for recipe v2 its light."""

    radiance: np.ndarray
    light: PlaceLight | None


def _light(radiance: np.ndarray, place: Place) -> PlaceLight:
    rng = np.random.default_rng([*os.fsencode(place.name)])
    return PlaceLight.of(radiance, float(rng.normal(*_EV100[place.scene])))


def _filmed_by_many(
    light: PlaceLight, place: Place, split: str, frames: int, seed: list[int], take: int
) -> tuple[str, Iterator[Frame]]:
    """The camera of a take of recipe v2 and its frames.

    Test takes come in pairs, held in the same way: one of the family, then the camera kept for
    them, so that the two compare view by view.
    """
    paired = split.startswith("unseen")
    rng = np.random.default_rng([*seed, take // 2 if paired else take])
    own = np.random.default_rng([*seed, take, 1])
    phone = kept_phone(own) if paired and take % 2 else draw_phone(own)
    height = 1.0 if place.synthetic_ground else drawn_height(rng)
    seen = light if height == 1 else light.from_height(height)
    return phone.name, film_many(seen, phone, PAPER_RIG, frames, rng, place.synthetic_ground)


def plan(folder: Path, out: Path, recipe: Recipe) -> tuple[ShardPlan, Simulation]:
    """Decide every shard of the data set before anything is filmed.

    Raises:
        ConfigError: the recipe films nothing in these panoramas.
        DataSetError: no panoramas, or `out` holds a data set of another recipe.
    """
    jobs, simulation, described = arranged(folder, recipe)
    return ShardPlan.begin(out, jobs, {PAPER_RIG.name: PAPER_RIG.to_dict()}, described), simulation


def arranged(folder: Path, recipe: Recipe) -> tuple[list[ShardJob], Simulation, dict[str, Any]]:
    """The shards, what films them, and what a plan remembers of that; see `plan`."""
    everything = panorama.places_in(folder)
    usable = [p for p in everything if recipe.synthetic_ground or not p.synthetic_ground]
    left_out = tuple(Skipped(p.path.name, MADE_UP_GROUND) for p in everything if p not in usable)
    places: dict[str, list[Place]] = {}
    for place in usable:
        training = ["train"] if place.split == "train" else []
        for split in [*training, place.held_out_split]:
            if recipe.takes(split):
                places.setdefault(split, []).append(place)
    jobs = [
        job
        for split in sorted(places)
        for job in plan_split(
            split,
            recipe.takes(split) * len(places[split]) * recipe.frames,
            recipe.shard_takes * recipe.frames,
        )
    ]
    if not jobs:
        got = f"{len(usable)} panoramas with real ground and no takes in them"
        raise ConfigError("something to film", got, "add panoramas, or raise recipe.*_takes")
    simulation = Simulation(recipe, {s: tuple(p) for s, p in places.items()}, left_out)
    return jobs, simulation, _described(recipe, usable)


def simulate(
    shards: ShardPlan,
    simulation: Simulation,
    engine: Engine = LOCAL,
    progress: Callable[[int], None] = lambda examples: None,
) -> Manifest:
    """Film every shard that is missing and write the manifest.

    Each process holds one panorama and one shard's offsets, whatever the number of either.

    Args:
        shards, simulation: from `plan`.
        engine: where to film; the bytes are the same everywhere.
        progress: called with the number of examples of each finished shard.

    Raises:
        ConfigError: the engine cannot be reached, or another run is filming into the folder.
        DataSetError: no panorama could be used; the data set is removed again.
        OSError: the data set cannot be written; what is finished stays, to go on with.
    """
    with only_run(shards.folder):
        for done in run(shards.missing(), partial(_film_shard, shards, simulation), engine):
            if done.error:
                raise done.error
            progress(done.result or 0)
        manifest = shards.finish()
    if not any(manifest.examples(split) for split in manifest.splits):
        shards.discard()  # else a run with the panoramas repaired would take it for finished
        skipped = "; ".join(f"{item.file}: {item.reason}" for item in manifest.skipped)
        raise DataSetError("at least one usable panorama", f"none ({skipped[:400]})", "repair them")
    return manifest


def _film_shard(shards: ShardPlan, simulation: Simulation, job: ShardJob) -> int:
    return shards.write(job, simulation.examples(job)).examples


def _example(
    frame: Frame, number: int, split: str, place: Place, take: str, phone: str, made: bool
) -> Example:
    meta = ExampleMeta(
        place=place.name,
        take=take,
        frame=number,
        scene=place.scene,
        split=split,
        rig=PAPER_RIG.name,
        camera=phone,
        licence=place.licence,
        source=place.path.name,
        details={
            "world_from_camera": frame.pose.round(6).tolist(),
            "log_gain": [round(g, 6) for g in frame.setting.log_gain],
            **frame.known,
            **({"varied": True} if made else {}),
        },
    )
    truth = None if split == "train" else frame.true_lighting.radiance
    key = f"{take}-{number:03d}"
    return Example(key, frame.background, frame.spheres, meta, truth, frame.jpeg)


def _described(recipe: Recipe, places: list[Place]) -> dict[str, Any]:
    """What the plan remembers, so that a changed folder or setting is noticed."""
    files = {p.path.name: [p.name, p.split, p.scene] for p in places}
    settings = asdict(recipe)
    # Data sets older than these settings go on.
    if not recipe.varied:
        del settings["varied"]
    if recipe.phones == "v1":
        del settings["phones"]
    return {"made_by": "deeplight simulate", **settings, "panoramas": files}
