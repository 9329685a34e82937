"""Why the main light wanders while one turns for the first time, and what holds it still.

    python -m lab.evidence.wandering PANORAMAS [--split val]

One level turn of 12 frames in each place. Prints Markdown: jumps of the main light by what it
leaves and what it goes to; then ways of choosing the main light of each step. To hold on by a
factor means that the chosen light is kept until another cone has that many times its excess of
power; to rest within an angle, that it is not moved for less than that. Last, what a session shows
steadily (`fuse.steady`) with other values of CLEARLY, and what that costs: L1 (diffuse / silver /
mirror, in the first frame's camera and white) as a mean over four steps, and at the turn's end.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro
from jaxtyping import Float

from deeplight.camera_response import LUMINANCE
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.evaluate.light_metrics import brightest
from deeplight.frames import normalised, turned
from deeplight.fuse import steady
from deeplight.lighting import Lighting
from deeplight.mappings import mirror_ball, resample
from deeplight.simulate.panorama import load, places_in
from lab.pans import Sweep
from lab.pans_table import SETS, USUAL, Case, Scores, case_of

CONE_RAD = 0.35  # of `harmonics.dominant_light`
WAYS = ((1.0, 0.0), (1.25, 0.0), (2.0, 0.0), (1.25, 10.0), (1.25, 15.0), (1.25, 20.0), (1.25, 30.0))
"""Factors by which to hold on, and degrees within which to rest."""
JUMP_DEG = 20.0  # of a step of 30 degrees
ROWS = 64
BALL = 32
_DIRECTIONS = mirror_ball.pixel_directions(BALL).reshape(-1, 3)
_SOLID_ANGLE = mirror_ball.solid_angles(BALL).ravel()
_NEAR = np.cos(CONE_RAD) < _DIRECTIONS @ _DIRECTIONS.T


@dataclass(frozen=True)
class Args:
    """Options of `python -m lab.evidence.wandering`."""

    panoramas: Annotated[Path, tyro.conf.Positional]
    """Folder of HDR panoramas."""
    split: Literal["val", "test"] = "val"
    """Which places."""
    clearly: tuple[float, ...] = (0.0, 1.0, 1.1, 1.25, 1.5, 2.0, 3.0)
    """How much brighter a place must be for the session's lamp to go there; 0: not steadily."""


@dataclass(frozen=True, eq=False)
class Step:
    """What is known after a frame, in the world's frame.

    Attributes:
        light: luminance of the light as fused.
        known: the same with the truth wherever one looked.
        only_seen: the truth where one looked, and nothing elsewhere.
        seen: share of each pixel.
    """

    light: Float[np.ndarray, " pixels"]
    known: Float[np.ndarray, " pixels"]
    only_seen: Float[np.ndarray, " pixels"]
    seen: Float[np.ndarray, " pixels"]


def steps_of(case: Case) -> list[Step]:
    """One level turn, frame by frame."""
    session = case.session([])
    true = resample.shrink_latlong(case.pan.panorama * np.exp(case.pan.frames[0].log_gain), ROWS)
    found = []
    for k in SETS["a turn"]:
        session.add(case.pan.frames[k].pixels, case.pan.frames[k].rotation, case.estimates[k])
        now = session.environment(np.eye(3), height=ROWS)
        share = np.zeros(now.radiance.shape[:2]) if now.seen is None else now.seen
        share = share[..., None].astype(np.float32)
        parts = (now.radiance, now.radiance + share * (true - now.radiance), share * true)
        light, known, only_seen = (_ball(part) @ LUMINANCE for part in parts)
        found.append(Step(light, known, only_seen, _ball(np.repeat(share, 3, axis=2))[:, 0]))
    return found


def _ball(radiance: np.ndarray) -> Float[np.ndarray, "pixels 3"]:
    return Lighting.from_latlong(radiance.astype(np.float32)).radiance.reshape(-1, 3)


def excesses(light: Float[np.ndarray, " pixels"]) -> Float[np.ndarray, " pixels"]:
    """Power that the cone about each pixel has over the mean outside it."""
    power = light * _SOLID_ANGLE
    inside, angle = _NEAR @ power, _NEAR @ _SOLID_ANGLE
    outside = (power.sum() - inside) / (_SOLID_ANGLE.sum() - angle)
    result: np.ndarray = np.where(_SOLID_ANGLE > 0, inside - outside * angle, -np.inf)
    return result


def centre(light: Float[np.ndarray, " pixels"], pixel: int) -> Float[np.ndarray, "3"]:
    """Where in a cone the power is."""
    near = _NEAR[pixel]
    outside = (light * _SOLID_ANGLE)[~near].sum() / _SOLID_ANGLE[~near].sum()
    weight = np.where(near, np.maximum(light - outside, 0), 0) * _SOLID_ANGLE
    return normalised(weight @ _DIRECTIONS)


def chosen(
    lights: Sequence[Float[np.ndarray, " pixels"]], factor: float = 1.0, rest_deg: float = 0.0
) -> np.ndarray:
    """Directions of the main light, step by step, holding on by a factor."""
    found: list[np.ndarray] = []
    for light in lights:
        excess = excesses(light)
        pixel = int(excess.argmax())
        if found:
            near = _DIRECTIONS @ found[-1] > np.cos(CONE_RAD / 2)
            kept = int(np.where(near, excess, -np.inf).argmax())
            if excess[pixel] < factor * excess[kept]:
                pixel = kept
        now = centre(light, pixel)
        rests = bool(found) and found[-1] @ now > np.cos(np.radians(rest_deg))
        found.append(found[-1] if rests else now)
    return np.stack(found)


def angles(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Degrees between directions."""
    return np.degrees(np.arccos(np.clip((one * other).sum(-1), -1, 1)))


def jumps_table(cases: Sequence[tuple[list[Step], np.ndarray]]) -> None:
    """Jumps by whether what is left and what is found had been seen, and how near they were."""
    kinds: Counter[str] = Counter()
    moved: dict[str, float] = {}
    ratios: dict[str, list[float]] = {}
    for steps, _ in cases:
        found = chosen([step.light for step in steps])
        by = angles(found[1:], found[:-1])
        for k in np.flatnonzero(by > JUMP_DEG):
            step = steps[k + 1]
            at = [int((_DIRECTIONS @ found[n]).argmax()) for n in (k, k + 1)]
            old, new = ("seen" if step.seen[pixel] > 0.5 else "unseen" for pixel in at)
            fresh = " just now" if steps[k].seen[at[1]] < 0.5 < step.seen[at[1]] else ""
            name = f"from {old} to {new}{fresh}"
            kinds[name] += 1
            moved[name] = moved.get(name, 0.0) + float(by[k])
            excess = excesses(step.light)
            ratios.setdefault(name, []).append(float(excess[at[1]] / max(excess[at[0]], 1e-9)))
        small = float(by[by <= JUMP_DEG].sum())
        moved["steps below a jump"] = moved.get("steps below a jump", 0.0) + small
        kinds["steps below a jump"] += int((by <= JUMP_DEG).sum())
    total = sum(moved.values())
    print("| the main light goes | times | share of the way | new over old power, median |")
    print("|---|---|---|---|")
    for name, way in sorted(moved.items(), key=lambda item: -item[1]):
        ratio = f"{np.median(ratios[name]):.2f}" if name in ratios else ""
        print(f"| {name} | {kinds[name]} | {way / total:.0%} | {ratio} |")
    print()


def rules_table(cases: Sequence[tuple[list[Step], np.ndarray]]) -> None:
    """Wandering and error of each way to choose."""
    print("| main light | wanders, per 60°: median | mean | off over the turn | off at its end |")
    print("|---|---|---|---|---|")
    for name, part in (
        ("as fused", "light"),
        ("the truth where seen, else as fused", "known"),
        ("the truth where seen, else nothing", "only_seen"),
    ):
        for factor, rest_deg in WAYS:
            wander, off, end = [], [], []
            for steps, truth in cases:
                found = chosen([getattr(step, part) for step in steps], factor, rest_deg)
                wander.append(2 * float(angles(found[1:], found[:-1]).mean()))
                error = angles(found, truth)
                off.append(float(error.mean()))
                end.append(float(error[-1]))
            label = name if factor == 1 else f"{name}, held on by {factor:g}"
            label += f", resting within {rest_deg:g}°" if rest_deg else ""
            numbers = f"{np.median(wander):.0f}° | {np.mean(wander):.0f}° "
            print(f"| {label} | {numbers}| {np.median(off):.0f}° | {np.median(end):.0f}° |")
    print()


def lamp_table(cases: Sequence[Case], factors: Sequence[float]) -> None:
    """What a session shows, by how much brighter a place must be for its lamp to go there."""
    print("| CLEARLY | wanders, per 60°: median | mean | L1 on the way | L1 at its end |")
    print("|---|---|---|---|---|")
    for factor in factors:
        scores, wander = Scores(), []
        for case in cases:
            lights = shown(case, factor)
            ways = brightest(np.stack([light.radiance for light in lights])).directions
            wander.append(2 * float(np.nanmean(angles(ways[1:], ways[:-1]))))
            first_from_world = case.pan.frames[0].rotation.T
            for k in (2, 5, 8, 11):
                own = lights[k].rotated(first_from_world)
                scores.add("at its end" if k == 11 else "before", own, case.truth)
        before, end = (np.array(scores.rows[name]) for name in ("before", "at its end"))
        way = np.concatenate([before, end])
        errors = [" / ".join(f"{e:.3f}" for e in rows.mean(0)[:3]) for rows in (way, end)]
        numbers = f"{np.median(wander):.0f}° | {np.mean(wander):.0f}° | {' | '.join(errors)}"
        print(f"| {factor or 'not steady'} | {numbers} |")
    print()


def shown(case: Case, clearly: float) -> list[Lighting]:
    """What a session shows in the world, frame by frame; 0: not steadily."""
    session, found = case.session([]), []
    usual, steady.CLEARLY = steady.CLEARLY, clearly
    for k in SETS["a turn"]:
        session.add(case.pan.frames[k].pixels, case.pan.frames[k].rotation, case.estimates[k])
        found.append(session.environment(np.eye(3), height=ROWS, steady=clearly > 0).lighting)
    steady.CLEARLY = usual
    return found


def main(args: Args) -> None:
    """Print all tables."""
    network = OnnxEstimator(threads=1)
    places = [place for place in places_in(args.panoramas) if place.split == args.split]
    cases, pans = [], []
    for k, place in enumerate(places):
        case = case_of(load(place), Sweep(12, (-10.0,)), USUAL, k, network)
        pans.append(case)
        first = case.pan.frames[0].rotation
        truth = case.truth.radiance.reshape(-1, 3) @ LUMINANCE
        at = centre(truth, int(excesses(truth).argmax()))
        cases.append((steps_of(case), turned(at, first)))
    print(f"{len(cases)} places of {args.split}, weights {network.sha256[:12]}:\n")
    jumps_table(cases)
    rules_table(cases)
    lamp_table(pans, args.clearly)


if __name__ == "__main__":
    main(tyro.cli(Args))
