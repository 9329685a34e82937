"""What looking around brings, as tables: light fused from simulated pans against the truth.

    python -m lab.pans_table ../shared/hdri [--into docs/fuse.md]
    python -m lab.pans_table ../shared/hdri --split val --places 6 --tables seen turn

Prints Markdown, with `--into` between the document's marks as well. Each place is panned by a
simulated phone (automatic exposure and white balance, tone curve, vignetting, noise, a person
walking by) with the first frame's camera and white as the unit. L1 is of the three spheres' pixels,
as everywhere; "ratio" is to the first frame alone.
"""

import io
import re
import sys
from collections.abc import Mapping, Sequence
from contextlib import redirect_stdout
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tyro
from jaxtyping import Float

from deeplight.camera_response import LUMINANCE, encode, soft_clip
from deeplight.environment import Environment
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.evaluate.light_metrics import brightest
from deeplight.evaluate.metrics import angular_error_rgb, masked_l1
from deeplight.fuse.blend import Seen, blended
from deeplight.fuse.gains import trusted
from deeplight.fuse.merge import merged
from deeplight.fuse.poses import angle_between
from deeplight.fuse.session import Session
from deeplight.fuse.track import track
from deeplight.lighting import Lighting
from deeplight.mappings import latlong, resample
from deeplight.reflectance import rig_bases
from deeplight.relight import relight
from deeplight.simulate.panorama import load, places_in
from deeplight.sphere import PAPER_RIG
from lab.pans import Pan, Sweep, Troubles, film_pan

SPHERES = ("diffuse", "matte_silver", "mirror")
ROWS = 128  # of the panoramas that are scored
RINGS = Sweep(12, (-10.0, 38.0, -55.0))
USUAL = Troubles(people=1)
SETS: Mapping[str, Sequence[int]] = {
    "1 frame": [0],
    "3 frames": [0, 1, 11],
    "half a turn": [0, 1, 11, 2, 10, 3, 9],
    "a turn": list(range(12)),
    "two turns, level and up": list(range(24)),
    "three turns, level, up and down": list(range(36)),
}
MARKS = ("<!-- tables -->\n", "<!-- end of tables -->")
TROUBLES: Mapping[str, Troubles] = {
    "none: exposure fixed, ideal camera": Troubles(0.0, 0.0, response=False),
    "automatic exposure and white balance": Troubles(0.0, response=False),
    "tone curve, vignetting, noise as well": Troubles(0.0),
    "hand shake and a person (the usual)": USUAL,
    "four people": replace(USUAL, people=4),
    "5 cm of translation": replace(USUAL, step_m=0.05),
    "30 cm of translation": replace(USUAL, step_m=0.3),
    "blur of 2 degrees": replace(USUAL, blur_rad=0.035),
    "a third of the frames dropped": replace(USUAL, dropped=0.33),
}


@dataclass(frozen=True)
class Args:
    """Options of `python -m lab.pans_table`."""

    panoramas: Annotated[Path, tyro.conf.Positional]
    """Folder of HDR panoramas."""
    split: Literal["val", "test", "both"] = "both"
    """Which places."""
    places: int = 100
    """Places of each split at most."""
    tables: tuple[str, ...] = ("seen", "merging", "turn", "rotations", "troubles")
    """Which tables."""
    into: Path | None = None
    """A document whose tables these take the place of."""


@dataclass(frozen=True, eq=False)
class Case:
    """One place's pan with what the network says of each frame."""

    pan: Pan
    estimates: Float[np.ndarray, "frames 32 32 3"]
    truth: Lighting

    def session(self, chosen: Sequence[int]) -> Session:
        """A session of some of the frames, the first of which is the first."""
        session = Session(self.pan.camera.vertical_fov_rad, lambda _: self.estimates[0])
        for k in chosen:
            frame = self.pan.frames[k]
            session.add(frame.pixels, frame.rotation, self.estimates[k])
        return session


class Scores:
    """Errors of estimates, place by place."""

    def __init__(self) -> None:
        self._bases = rig_bases(PAPER_RIG)
        self.rows: dict[str, list[list[float]]] = {}

    def add(self, name: str, found: Lighting, truth: Lighting, seen: float = np.nan) -> None:
        """Score one lighting."""
        row = []
        for sphere in SPHERES:
            mask = PAPER_RIG.views[sphere].mask()
            own, true = (relight(self._bases[sphere], light) for light in (found, truth))
            filmed = encode(np.minimum(true, 1))
            row.append(float(masked_l1(encode(soft_clip(own))[None], filmed[None], mask)[0]))
            if sphere == "diffuse":
                hue = float(angular_error_rgb(own[None], true[None], mask).degrees[0])
                stops = float(np.log2(own[mask].mean() / true[mask].mean()))
        lights = [brightest(light.radiance[None]) for light in (found, truth)]
        row += [hue, stops, float(lights[0].degrees_from(lights[1])[0]), seen]
        self.rows.setdefault(name, []).append(row)

    def table(self, first: str) -> None:
        """Print a table, errors and ratios to the one of a name."""
        base = np.array(self.rows[first])
        print(
            "| light | seen | L1 diffuse | silver | mirror | hue | bias, stops | main light off |"
        )
        print("|---|---|---|---|---|---|---|---|")
        for name, rows in self.rows.items():
            values = np.array(rows)
            mean, reference = values.mean(0), base.mean(0)
            cells = [f"{mean[k]:.3f} ({mean[k] / reference[k]:.2f})" for k in range(3)]
            cells.append(f"{mean[3]:.1f}° ({mean[3] / reference[3]:.2f})")
            cells += [f"{mean[4]:+.2f}", f"{np.nanmedian(values[:, 5]):.0f}°"]
            seen = "" if np.isnan(mean[6]) else f"{mean[6]:.0%}"
            print(f"| {name} | {seen} | {' | '.join(cells)} |")
        print()


def case_of(
    panorama: np.ndarray, sweep: Sweep, troubles: Troubles, seed: int, network: OnnxEstimator
) -> Case:
    """Film one place and ask the network about each frame."""
    pan = film_pan(panorama, sweep, troubles, np.random.default_rng(seed), (384, 216))
    fov = float(np.degrees(pan.camera.vertical_fov_rad))
    balls = [network.estimate(frame.pixels, fov).radiance for frame in pan.frames]
    return Case(pan, np.log(np.maximum(np.stack(balls), 1e-6)), pan.true_lighting())


def share_seen(environment: Environment) -> float:
    """Share of the sphere that was seen."""
    if environment.seen is None:
        return 0.0
    solid_angle = latlong.solid_angles(*environment.seen.shape)
    return float((environment.seen * solid_angle).sum() / (4 * np.pi))


def seen_table(cases: Sequence[Case]) -> Scores:
    """What each further look brings."""
    scores = Scores()
    for case in cases:
        alone = Lighting(np.exp(case.estimates[0]))
        scores.add("the network alone, 1 frame", alone, case.truth, 0.0)
        for name, chosen in SETS.items():
            light = case.session(chosen).environment(height=ROWS)
            scores.add(name, light.lighting, case.truth, share_seen(light))
    scores.table("the network alone, 1 frame")
    return scores


def summary(parts: Sequence[Scores]) -> None:
    """Ratios to the first frame's estimate over all places, as the goals are put."""
    rows = {name: np.concatenate([s.rows[name] for s in parts]) for name in parts[0].rows}
    first, *others = rows.values()
    print(f"All {len(first)} places, ratio to the network alone:\n")
    print("| light | diffuse | silver | mirror | hue | main light off |\n|---|---|---|---|---|---|")
    for name, values in zip(list(rows)[1:], others, strict=True):
        ratios = " | ".join(f"{values[:, k].mean() / first[:, k].mean():.2f}" for k in range(4))
        print(f"| {name} | {ratios} | {np.nanmedian(values[:, 5]):.0f}° |")
    print()


def merging_table(cases: Sequence[Case]) -> None:
    """A turn, the unseen part and clipped lamps by each way of merging."""
    scores = Scores()
    for case in cases:
        session = case.session(SETS["a turn"])
        scores.add("first frame alone", Lighting(np.exp(case.estimates[0])), case.truth)
        logs, mean, seen = _parts(session)
        for name, unseen in (("mean of logs", logs), ("mean of radiance", mean)):
            scores.add(f"{name} of all estimates, nothing seen", _ball(session, unseen), case.truth)
            known = seen.share[..., None]
            light = known * seen.radiance + (1 - known) * unseen
            scores.add(f"{name} where unseen", _ball(session, light), case.truth)
        found = session.environment(height=ROWS)
        scores.add("fused: logs, lost power as a lobe, lamps", found.lighting, case.truth)
        scores.add("the truth where clipped", _oracle(case, session, found), case.truth)
    scores.table("first frame alone")


def _parts(session: Session) -> tuple[np.ndarray, np.ndarray, Seen]:
    directions = latlong.directions(ROWS, 2 * ROWS)
    logs, mean = merged(session.views, session.gains, directions)
    cells = [view.cells() for view in session.views]
    values, weights = (np.stack(part) for part in zip(*cells, strict=True))
    trust = trusted(values, weights, session.gains)
    return logs, mean, blended(session.views, session.gains, trust, directions)


def _ball(session: Session, radiance: np.ndarray) -> Lighting:
    turn = session.views[0].world_from_camera.T
    return Lighting.from_latlong(radiance.astype(np.float32), turn)


def _oracle(case: Case, session: Session, found: Environment) -> Lighting:
    seen = _parts(session)[2]
    frame = resample.turned_latlong(
        (seen.clipped > 0)[..., None].astype(np.float32), session.views[0].world_from_camera.T
    )
    true = resample.shrink_latlong(case.pan.truth(), ROWS)
    return Lighting.from_latlong(np.where(frame > 0.5, true, found.radiance).astype(np.float32))


def turn_table(cases: Sequence[Case]) -> None:
    """How steady the light is in the world while one turns twice, exposure taken out."""
    print("| over a turn | brightest / darkest | last / first | grey ball swings ", end="")
    print("| main light wanders, per 60° | power off at the start | and at the end |")
    print("|---|---|---|---|---|---|---|")
    kinds: dict[str, list[list[float]]] = {}
    for case in cases:
        ring = SETS["a turn"]
        gains = [case.pan.frames[k].log_gain - case.pan.frames[0].log_gain for k in ring]
        own = []
        for k, gain in zip(ring, gains, strict=True):
            ball = Lighting((np.exp(case.estimates[k] - gain)).astype(np.float32))
            own.append(ball.rotated(case.pan.frames[k].rotation))
        first, steady, known, second = _two_turns(case, ring)
        for name, lights in (
            ("each frame's own estimate", own),
            ("fused so far, first turn", first),
            ("the same, shown steadily", steady),
            ("the same, not steadily, with the truth wherever one looked", known),
            ("fused so far, second turn", second),
        ):
            kinds.setdefault(name, []).append(_steadiness(lights, case.truth))
    for name, rows in kinds.items():
        ratio, ends, swing, wander, start, end = np.median(np.array(rows), axis=0)
        print(f"| {name} | {ratio:.2f} | {ends:.2f} | {swing:.0f} levels | {wander:.0f}° ", end="")
        print(f"| {start:.2f} x | {end:.2f} x |")
    print()


def _two_turns(case: Case, ring: Sequence[int]) -> tuple[list[Lighting], ...]:
    """In the world: the first turn as fused, shown steadily, and with the truth where it looked;
    the second as fused."""
    session = case.session([])
    true = resample.shrink_latlong(case.pan.panorama * np.exp(case.pan.frames[0].log_gain), 64)
    plain, steady, known = [], [], []
    for k in (*ring, *ring):
        session.add(case.pan.frames[k].pixels, case.pan.frames[k].rotation, case.estimates[k])
        found = session.environment(np.eye(3), height=64)
        plain.append(found.lighting)
        if len(plain) > len(ring) or found.seen is None:
            continue
        steady.append(session.environment(np.eye(3), height=64, steady=True).lighting)
        radiance = found.radiance + found.seen[..., None] * (true - found.radiance)
        known.append(Lighting.from_latlong(radiance.astype(np.float32)))
    return plain[: len(ring)], steady, known, plain[len(ring) :]


def _steadiness(lights: Sequence[Lighting], truth: Lighting) -> list[float]:
    """Of lights in the world. A grey ball's mean pixel counts from 0 to 255."""
    power = np.array([float(light.power() @ LUMINANCE) for light in lights])
    true = float(truth.power() @ LUMINANCE)
    found = brightest(np.stack([light.radiance for light in lights])).directions
    steps = np.degrees(np.arccos(np.clip((found[1:] * found[:-1]).sum(1), -1, 1)))
    basis, mask = rig_bases(PAPER_RIG)["diffuse"], PAPER_RIG.views["diffuse"].mask()
    grey = [float(encode(soft_clip(relight(basis, light)))[mask].mean()) for light in lights]
    ends = float(np.exp(abs(np.log(power[-1] / power[0]))))
    off = np.exp(np.abs(np.log(power[[0, -1]] / true)))
    wander = float(np.nanmean(steps)) * 2  # a step is 30 degrees
    swing = 255 * float(np.ptp(grey))
    return [float(power.max() / power.min()), ends, swing, wander, *off.tolist()]


def rotation_table(panoramas: Sequence[np.ndarray]) -> None:
    """Rotations from pictures alone, one every 20 degrees: turns that close, and open ones."""
    print("| pan | placed | error, median | worst | field of view |\n|---|---|---|---|---|")
    for name, troubles in (
        ("hand shake, a person", USUAL),
        ("and 5 cm of translation", replace(USUAL, step_m=0.05)),
        ("and 30 cm of translation", replace(USUAL, step_m=0.3)),
        ("the same in a box of a room", replace(USUAL, step_m=0.3, room="box")),
    ):
        for way, sweep in (("", Sweep(18)), (", 160° only", Sweep(9, turn_deg=180.0))):
            pans = [
                film_pan(panorama, sweep, troubles, np.random.default_rng(7), (384, 216))
                for panorama in panoramas
            ]
            print(f"| {name}{way} | {_rotation_row(pans)} |")
    print()


def _rotation_row(pans: Sequence[Pan]) -> str:
    """How many pictures were placed, how far off, and the mean of the fields of view found."""
    errors, fovs, guessed = [], [], float(np.radians(60))
    for pan in pans:
        pictures = [frame.pixels for frame in pan.frames]
        found = track(pictures, [guessed] * len(pictures), fov_known=False)
        if not found.rotations:
            continue
        first = pan.frames[min(found.rotations)].rotation
        errors += [
            angle_between(first.T @ pan.frames[k].rotation, turn)
            for k, turn in found.rotations.items()
        ]
        fovs.append(np.degrees(2 * np.arctan(np.tan(guessed / 2) * found.scale)))
    off, count = np.degrees(errors), sum(len(pan.frames) for pan in pans)
    middle = f"{np.median(off):.2f}° | {off.max():.1f}°"
    return f"{len(off)} of {count} | {middle} | {np.mean(fovs):.1f}° (true 66°)"


def trouble_table(panoramas: Sequence[np.ndarray], network: OnnxEstimator) -> None:
    """What each trouble of a pan costs."""
    scores = Scores()
    for k, panorama in enumerate(panoramas):
        for name, troubles in TROUBLES.items():
            case = case_of(panorama, Sweep(12), troubles, k, network)
            light = case.session(range(len(case.pan.frames))).environment(height=ROWS)
            scores.add(name, light.lighting, case.truth, share_seen(light))
    scores.table(next(iter(TROUBLES)))


def main(args: Args) -> None:
    """Print the tables; put them into a document if one is named."""
    if args.into is None:
        _print(args)
        return
    _parts_of(args.into)  # so that a document without the marks fails at once
    printed = _Copied()
    with redirect_stdout(printed):
        _print(args)
    before, after = _parts_of(args.into)
    tables = re.sub(r"\n{2,}", "\n\n", printed.getvalue()).strip()
    args.into.write_text(f"{before}{tables}\n{after}", encoding="utf-8")


def _parts_of(document: Path) -> tuple[str, str]:
    """What stands before and after the tables, marks included."""
    text = document.read_text(encoding="utf-8")
    if not all(mark in text for mark in MARKS):
        raise SystemExit(f"{document} has no {' and '.join(mark.strip() for mark in MARKS)}")
    return text[: text.index(MARKS[0]) + len(MARKS[0])], text[text.index(MARKS[1]) :]


class _Copied(io.StringIO):
    """What is printed, kept; people see it on stderr meanwhile."""

    def write(self, text: str) -> int:
        print(text, end="", file=sys.stderr, flush=True)
        return super().write(text)


def _print(args: Args) -> None:
    network = OnnxEstimator(threads=1)
    print(f"Weights {network.sha256[:12]}.\n")
    splits = ("val", "test") if args.split == "both" else (args.split,)
    panoramas: dict[str, list[np.ndarray]] = {}
    seen: list[Scores] = []
    for split in splits:
        places = [place for place in places_in(args.panoramas) if place.split == split]
        panoramas[split] = [load(place) for place in places[: args.places]]
        cases = [case_of(p, RINGS, USUAL, k, network) for k, p in enumerate(panoramas[split])]
        of = f"{len(cases)} places of {split}"
        if "seen" in args.tables:
            print(f"{of}:\n")
            seen.append(seen_table(cases))
        if "merging" in args.tables and split == splits[-1]:
            print(f"Ways of merging after one level turn, {of}; the last has the true radiance")
            print("where every view clipped, which is what there is still to gain:\n")
            merging_table(cases)
        if "turn" in args.tables:
            print(f"How steady the light is in the world while one turns twice, medians, {of}:\n")
            turn_table(cases)
    if seen:
        summary(seen)
    some = panoramas[splits[0]][:6]
    if "rotations" in args.tables:
        print("Rotations from pictures alone, a frame every 20°, field of view not known:\n")
        rotation_table(some)
    if "troubles" in args.tables:
        print("What each trouble costs, one level turn, ratio to none:\n")
        trouble_table(some, network)


if __name__ == "__main__":
    main(tyro.cli(Args))
