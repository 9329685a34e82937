"""Whether Gardner 2017 finds lights: where its answer is brightest, and where the room's light is.

    python -m lab.evidence.light_masks HDRI RIVAL.safetensors ... [--views 4]

A room's lights are the texels of its 32 x 64 panorama that are brightest and hold half its power.
As large a part of the sphere, where the answer is brightest, is what a rival takes for lights. Its
recall is the part of the true lights in there; average precision asks for every size of that part.
What chance gives is the answer to a view of another room, held against this one's lights: it knows
that lights hang above, too. So for the azimuth of the main light. Intervals are over rooms.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tyro
from jaxtyping import Bool, Float, Int

from deeplight.camera_response import LUMINANCE
from deeplight.cli.main import run_command
from deeplight.evaluate.bootstrap import PlaceBootstrap
from deeplight.evaluate.report_tables import interval
from deeplight.evaluate.rivals.crops import Pair, pairs_of
from deeplight.evaluate.rivals.gardner_2017 import ROWS
from deeplight.evaluate.rivals.rival import Rival, load_rival
from deeplight.harmonics import dominant_light_of_latlong
from deeplight.mappings import latlong, resample
from deeplight.simulate.panorama import Place, load, places_in

HALF = 0.5
"""Of the power, which the lights hold."""
HEAD = (
    "| {} | views | azimuth off | of another room | recall | of another room | more "
    "| average precision | of another room | more |\n"
    "|---|---|---|---|---|---|---|---|---|---|"
)
Texels = Float[np.ndarray, "rows columns"]
Mask = Bool[np.ndarray, "rows columns"]


@dataclass(frozen=True)
class Args:
    """Options of `python -m lab.evidence.light_masks`."""

    hdri: tyro.conf.Positional[Path]
    """Folder of HDR panoramas."""
    rivals: tyro.conf.Positional[tuple[Path, ...]]
    """Trained by `lab.evidence.table_2`."""
    views: int = 4
    """Of each panorama."""


def lights_of(luminance: Texels) -> Mask:
    """The brightest texels, which together hold half of the power."""
    power = (luminance * latlong.solid_angles(*luminance.shape)).ravel()
    order = np.argsort(-luminance.ravel(), kind="stable")
    before = np.cumsum(power[order]) - power[order]
    lights = np.zeros(luminance.size, bool)
    lights[order[before < HALF * power.sum()]] = True
    return lights.reshape(luminance.shape)


def found(answer: Texels, lights: Mask) -> tuple[float, float]:
    """Recall within the answer's brightest texels, as large as the lights; average precision.

    Both NaN where there are no lights.
    """
    solid = latlong.solid_angles(*answer.shape).ravel()
    order = np.argsort(-answer.ravel(), kind="stable")
    taken, right = np.cumsum(solid[order]), np.cumsum((solid * lights.ravel())[order])
    if right[-1] == 0:
        return float("nan"), float("nan")
    recall = np.interp(right[-1], taken, right) / right[-1]
    precision = right / taken
    average = float((precision * np.diff(right, prepend=0.0)).sum() / right[-1])
    return float(recall), average


@dataclass(frozen=True)
class Look:
    """Which views of which places: `drawn` of each with this seed, the first `views` are taken."""

    places: Sequence[Place]
    views: int
    drawn: int
    seed: int = 1

    def pairs(self, rival: Rival) -> list[Pair]:
        """The views, as the rival's training has them."""
        plan = replace(rival.config.views, per_panorama=self.drawn)
        random = np.random.default_rng(self.seed)
        of_each = [list(pairs_of(load(place), plan, random)) for place in self.places]
        return [pair for some in of_each for pair in some[: self.views]]


def small(panorama: Float[np.ndarray, "rows columns 3"]) -> Texels:
    """Luminance, of `ROWS` rows."""
    at_rows = panorama if len(panorama) == ROWS else resample.shrink_latlong(panorama, ROWS)
    return np.asarray(at_rows @ LUMINANCE)


def azimuth_deg(luminance: Texels) -> float:
    """Of the main light, from the middle of the view to the right."""
    light, _ = dominant_light_of_latlong(np.repeat(luminance[..., None], 3, axis=2))
    return float(np.degrees(np.arctan2(light.direction[0], -light.direction[2])))


def row(name: str, rival: Rival, look: Look) -> str:
    """A line of the table: own answers, those to another place's views, and the difference."""
    pairs = look.pairs(rival)
    names = np.repeat([place.name for place in look.places], look.views)
    answers = [small(rival.panorama(pair.photo)) for pair in pairs]
    true = [small(pair.panorama) for pair in pairs]
    return line(name, Scores.of(answers, true, another_place(names)), names)


@dataclass(frozen=True, eq=False)
class Scores:
    """Of each view's own answer, and of another place's, which is what chance gives.

    Attributes:
        off_deg: of the azimuth of the main light.
        found: recall and average precision.
    """

    off_deg: tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]
    found: tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, "n 2"]]

    @classmethod
    def of(
        cls,
        answers: Sequence[Texels],
        true: Sequence[Texels],
        others: Int[np.ndarray, " n"],
        beyond: Sequence[Mask] | None = None,
    ) -> "Scores":
        """Answers held against the truth.

        Args:
            others: numbers the answer that is each view's chance.
            beyond: texels that each photo does not show: only lights there are looked for, only
                there; and the azimuth only where that is most of the lights.
        """
        towards, wanted = (np.array([azimuth_deg(x) for x in some]) for some in (answers, true))
        apart = [np.abs((some - wanted + 180) % 360 - 180) for some in (towards, towards[others])]
        lights = [lights_of(light) for light in true]
        within = [np.ones_like(mask) for mask in lights] if beyond is None else beyond
        parts = [mask & part for mask, part in zip(lights, within, strict=True)]
        shown = [2 * part.sum() < mask.sum() for part, mask in zip(parts, lights, strict=True)]
        own, chance = (
            np.array(
                [
                    found(np.where(part, answers[n], -np.inf), mask)
                    for n, part, mask in zip(of, within, parts, strict=True)
                ]
            )
            for of in (range(len(true)), others)
        )
        off, off_chance = (np.where(shown, np.nan, some) for some in apart)
        return cls((off, off_chance), (own, chance))


def line(
    name: str, scores: Scores, places: np.ndarray, chosen: Bool[np.ndarray, " n"] | None = None
) -> str:
    """A line of the table, of the chosen views (all)."""
    mask = np.ones(len(places), bool) if chosen is None else chosen
    draws = PlaceBootstrap(places[mask])
    cells = [f"{np.isfinite(scores.found[0][mask, 0]).sum()}"]
    cells += [f"{interval(draws.median(off[mask]), 0)}°" for off in scores.off_deg]
    own, chance = (some[mask] for some in scores.found)
    for mine, theirs in zip(own.T, chance.T, strict=True):
        more = interval(draws.difference(mine, theirs), 2)
        cells += [f"{np.nanmean(mine):.2f}", f"{np.nanmean(theirs):.2f}", more]
    return f"| {name} | {' | '.join(cells)} |"


def another_place(names: np.ndarray) -> np.ndarray:
    """For each view one of another place."""
    random = np.random.default_rng(9)
    return np.array([random.choice(np.flatnonzero(names != name)) for name in names])


def run(args: Args) -> None:
    rooms = [p for p in places_in(args.hdri) if p.scene == "indoor" and not p.synthetic_ground]
    by_split = {s: [p for p in rooms if p.split == s] for s in ("train", "val", "test")}
    for path in args.rivals:
        rival = load_rival(path)
        seen, few, many = rival.config.views.per_panorama, args.views, 4 * args.views
        print(HEAD.format(path.stem))
        for name, look in {
            "views it learnt from": Look(by_split["train"], few, seen, rival.config.seed),
            "other views of those rooms": Look(by_split["train"], few, few),
            "validation rooms": Look(by_split["val"], many, many),
            "test rooms": Look(by_split["test"], many, many),
        }.items():
            print(row(name, rival, look), flush=True)


if __name__ == "__main__":
    sys.exit(run_command("python -m lab.evidence.light_masks", sys.modules[__name__], sys.argv[1:]))
