"""Objects under estimated light next to the same objects under the scene's true light (figure 9).

python -m lab.evidence.compose_evidence data/sim [--split val] [--cases 32] [--out runs/compose]

Takes simulated photos that look down on some ground and carry their true HDR light, spread over
the places of the split. Into each it puts the bunny, diffuse and silver: under the true light, the
model's (as users get it: with the photo in it and its lamps as wide as it knows their place), each
baseline's, and the true light with other random rays, which says how much of an error is noise.
Writes errors.csv (one row for each picture), summary.md (means, and paired differences, with 95 %
intervals over places), figure.png (of each kind of scene the case with the model's median error),
cases.png (all of them) and run.toml. OUT/pictures keeps every picture by what it is made of: a run
that was killed goes on, and after a change of the model only the model's own pictures are rendered
again. `update_compose.py OUT` puts the result into docs/compose.md.

Errors: object = mean absolute difference of pixel values over it; shadow = mean absolute difference
of its factor, over the pixels that some light's shadow darkens by 3 % (one region for all lights),
both after a blur of 1.5 pixels against noise; blurred = the shadow's after a Gaussian blur of a
sixth of the object's size; darkness = what the shadow takes of the light there, over what the true
one takes; "no shadow" is the error of leaving it out; side = angle in degrees
between the directions in which the two shadows fall, where both fall to one side; light = angle
between the dominant lights; high, power = how far this light's dominant one stands above the
horizon, in degrees, and its share of the power.
"""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw
from rich.progress import track

from deeplight.camera import BACKGROUND_FRACTION
from deeplight.compose.compose import SPAN
from deeplight.compose.look import blurred
from deeplight.dataset import Example, open_dataset
from deeplight.dataset.reading import SplitIndex
from deeplight.environment import Environment
from deeplight.estimators.environment import SceneLight, assemble
from deeplight.estimators.network import NetworkEstimator
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.estimators.projection import ImagePlane
from deeplight.estimators.protocol import Estimator
from deeplight.estimators.sureness import glow_rad
from deeplight.estimators.tilt import seen_tilt
from deeplight.evaluate.baselines.suite import baselines_for
from deeplight.harmonics import DominantLight, dominant_light
from deeplight.io.photos import write_png
from deeplight.lighting import Lighting
from deeplight.preprocess import normalise
from deeplight.report.run_record import write_run_toml
from lab.evidence.compose_evidence_pictures import (
    DENOISE_PX,
    LATLONG_HEIGHT,
    STANDS,
    Picture,
    full_frame,
    picture,
    tile,
    viewpoint,
)
from lab.evidence.compose_evidence_tables import (
    AGAIN,
    KINDS,
    MATERIALS,
    UNSHADOWED,
    Row,
    summary,
    write_tables,
)

TRUTH = "true light"
LEAST_DEPRESSION = 0.30  # sine of how far below the horizon the place lies
SUN_SHARE = 0.34  # of the power in one direction: outdoors with more is sun, else shade
DARK = 0.97  # a shadow is where the factor is smaller
BLUR = 1 / 6  # of the object's size
ENLARGED = 2  # in the figure of few cases


@dataclass(frozen=True)
class Case:
    """One photo, and the lights of every method by name: as balls, and as they are rendered."""

    example: Example
    lights: dict[str, Lighting]
    panoramas: dict[str, np.ndarray]

    @property
    def kind(self) -> str:
        if self.example.meta.scene == "indoor":
            return "indoor"
        return "sun" if dominant_light(self.lights[TRUTH]).share > SUN_SHARE else "shade"


def main(args: argparse.Namespace) -> None:
    data = open_dataset(args.data)
    model = OnnxEstimator(threads=1)
    estimators: list[Estimator] = [model, *baselines_for(data, args.split)]
    names = [estimator.name for estimator in estimators]
    examples = list(chosen(data.index(args.split), args.cases))
    rows: list[Row] = []
    cases: list[Case] = []
    strips: list[list[np.ndarray]] = []
    for example in track(examples, "composing"):
        case = lit(example, estimators)
        found, strip = measured(case, args.scale, args.out / "pictures")
        rows, cases, strips = rows + found, [*cases, case], [*strips, strip]
    write_tables(args.out, rows, names)
    write_png(args.out / "cases.png", all_cases(cases, strips, names))
    shown = [strips[number] for number in medians(cases, rows)]
    write_png(args.out / "figure.png", figure(shown, names))
    settings = {k: str(v) for k, v in vars(args).items()}
    facts = {"cases": len(cases), "model": model.sha256, "data": data.manifest_sha256}
    write_run_toml(args.out, {"settings": settings}, facts)
    print(summary(rows, names))


def chosen(index: SplitIndex, count: int) -> Iterator[Example]:
    """Examples that show ground where the object is to stand, in turn from each place."""
    by_place = [list(np.flatnonzero(index.places == place)) for place in np.unique(index.places)]
    rng, found = np.random.default_rng(0), 0
    for numbers in by_place:
        rng.shuffle(numbers)
    while found < count and any(by_place):
        for numbers in by_place:
            while numbers:
                example = index[int(numbers.pop())]
                if found < count and _looks_down(example):
                    found += 1
                    yield example
                    break


def lit(example: Example, estimators: Sequence[Estimator]) -> Case:
    """The lights of every method, by name."""
    inputs = normalise(example.background[None])
    lights = {TRUTH: Lighting(example.known_lighting)}
    for estimator in estimators:
        lights[estimator.name] = Lighting.from_log_radiance(estimator.estimate_inputs(inputs)[0])
    panoramas = {name: light.latlong(LATLONG_HEIGHT) for name, light in lights.items()}
    for estimator in estimators:
        if isinstance(estimator, NetworkEstimator):
            with_photo = as_users_get_it(estimator, example.background)
            panoramas[estimator.name] = with_photo.radiance
            lights[estimator.name] = with_photo.lighting
    return Case(example, lights, panoramas)


def as_users_get_it(model: NetworkEstimator, background: np.ndarray) -> Environment:
    """The network's light with the photo in it and its lamps as wide as it knows their place."""
    scene, heads = scene_of(model, background)
    glow = glow_rad(heads)
    return (scene if glow is None else scene.softened(glow)).environment


def scene_of(
    model: NetworkEstimator, background: np.ndarray
) -> tuple[SceneLight, Mapping[str, float]]:
    """The network's light with the photo in it, and what it says of itself."""
    log_radiance, (lamps,), (heads,) = model.estimate_fully(normalise(background[None]))
    whole = model.contract
    plane = ImagePlane(-whole.right, whole.right, whole.bottom, whole.top)
    light = Lighting.from_log_radiance(log_radiance[0])
    tilt = seen_tilt(background, plane, heads)
    return assemble(light, background, plane, LATLONG_HEIGHT, lamps, tilt=tilt), heads


def measured(case: Case, scale: int, kept: Path) -> tuple[list[Row], list[np.ndarray]]:
    """Errors of every method but the truth, for each material; the photo and all pictures."""
    rows, strip = [], [tile(full_frame(case.example, scale))]
    for material in MATERIALS:
        made = {
            method: picture(kept, case.example, panorama, material, scale)
            for method, panorama in case.panoramas.items()
        }
        strip += [found.tile for found in made.values()]
        region = np.min([found.shadow for found in made.values()], axis=0) < DARK
        made[AGAIN] = picture(kept, case.example, case.panoramas[TRUTH], material, scale, seed=1)
        shadows = {method: found.shadow for method, found in made.items()}
        shadows[UNSHADOWED] = np.ones_like(shadows[TRUTH])
        for method in list(shadows)[1:]:
            first = (case.example.key, case.example.meta.place, case.kind, material, method)
            of_shadow = shadow_errors(shadows[TRUTH], shadows[method], region)
            rows.append(
                Row(
                    *first,
                    object_error(made, method),
                    *of_shadow,
                    *light_errors(case, made, method),
                )
            )
    return rows, strip


def light_errors(
    case: Case, made: dict[str, Picture], method: str
) -> tuple[float, float, float, float]:
    """Side of the shadow, the dominant light, its height, its power; nan without a picture."""
    if method not in made:
        return (np.nan,) * 4
    true, other = (dominant_light(case.lights.get(m, case.lights[TRUTH])) for m in (TRUTH, method))
    return (
        angle_deg(made[TRUTH].side, made[method].side),
        angle_deg(true.direction, other.direction),
        height_deg(case.example, other),
        other.share,
    )


def height_deg(example: Example, light: DominantLight) -> float:
    """Of a light in the camera frame above the horizon."""
    up = np.array(example.meta.details["world_from_camera"]).T @ [0.0, 1.0, 0.0]
    return float(np.degrees(np.arcsin(np.clip(light.direction @ up, -1, 1))))


def object_error(made: dict[str, Picture], method: str) -> float:
    """Over the object as it is under the true light."""
    if method not in made:
        return np.nan
    true = made[TRUTH]
    apart = np.abs(true.object - made[method].object).mean(-1)
    return float((apart * true.cover).sum() / true.cover.sum())


def shadow_errors(
    true: np.ndarray, other: np.ndarray, region: np.ndarray
) -> tuple[float, float, float]:
    """After a blur that takes out the noise of few samples; after a wide one; the darkness."""
    difference = (other.astype(float) - true)[..., None]
    wide_px = BLUR * SPAN * min(true.shape)
    sharp, soft = (np.abs(blurred(difference, px))[region] for px in (DENOISE_PX, wide_px))
    darkness = (1 - other)[region].sum() / max((1 - true)[region].sum(), 1e-9)
    return float(sharp.mean()), float(soft.mean()), float(darkness)


def angle_deg(a: np.ndarray, b: np.ndarray) -> float:
    cosine = float(a @ b / np.maximum(np.linalg.norm(a) * np.linalg.norm(b), 1e-12))
    return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))))


def medians(cases: list[Case], rows: list[Row]) -> list[int]:
    """Of each kind the case whose diffuse object has the model's median error."""
    errors = {r.key: r.object for r in reversed(rows) if r.material == MATERIALS[0]}
    found = []
    for kind in KINDS:
        numbers = [i for i, case in enumerate(cases) if case.kind == kind]
        numbers.sort(key=lambda i: errors[cases[i].example.key])
        found += numbers[(len(numbers) - 1) // 2 :][:1]
    return found


def figure(strips: list[list[np.ndarray]], names: list[str]) -> np.ndarray:
    """A row for each case and material: the photo, the truth, and every method; enlarged."""
    count, rows = 1 + len(names), []
    for photo, *pictures in strips:
        for first in range(0, len(pictures), count):
            row = np.concatenate([photo, *pictures[first : first + count]], axis=1)
            size = (ENLARGED * row.shape[1], ENLARGED * row.shape[0])
            rows.append(np.asarray(Image.fromarray(row).resize(size, Image.Resampling.BICUBIC)))
    return headed(np.concatenate(rows), ["photo", TRUTH, *names])


def all_cases(cases: list[Case], strips: list[list[np.ndarray]], names: list[str]) -> np.ndarray:
    """A row for each case: the photo; diffuse and silver under the truth and every method."""
    order = sorted(range(len(cases)), key=lambda i: KINDS.index(cases[i].kind))
    rows = np.concatenate([np.concatenate(strips[i], axis=1) for i in order])
    return headed(rows, ["photo", *2 * [TRUTH, *names]])


def headed(picture: np.ndarray, heads: list[str]) -> np.ndarray:
    """Names above the columns of a picture."""
    width = picture.shape[1] // len(heads)
    canvas = Image.new("RGB", (picture.shape[1], picture.shape[0] + 20), "white")
    canvas.paste(Image.fromarray(picture), (0, 20))
    draw = ImageDraw.Draw(canvas)
    for number, name in enumerate(heads):
        draw.text((number * width + 4, 4), name.replace("_", " "), "black")
    return np.asarray(canvas)


def _looks_down(example: Example) -> bool:
    height, width = 240, 135
    ray = viewpoint(example, height, width).ray(
        STANDS[0] * width, STANDS[1] * BACKGROUND_FRACTION * height
    )
    return bool(ray[1] < -LEAST_DEPRESSION)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--split", default="val")
    parser.add_argument("--cases", type=int, default=32)
    parser.add_argument("--scale", type=int, default=1, help="pixels for one of the background")
    parser.add_argument("--out", type=Path, default=Path("runs/compose"))
    main(parser.parse_args())
