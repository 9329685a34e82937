"""Objects under estimated light beside the same objects under the scene's true light (figure 9).

python benchmarks/compose_evidence.py data/sim [--split val] [--cases 32] [--out runs/compose]

Takes simulated photos that look down on some ground and carry their true HDR light, spread over
the places of the split. Into each it puts the bunny, diffuse and silver: under the true light, the
model's, each baseline's, and the true light with other random rays, which says how much of an
error is noise. Writes errors.csv (one row for each picture), summary.md (means, and paired
differences, with 95 % intervals over places), figure.png (of each kind of scene the case with the
model's median error), cases.png (all of them) and run.toml. Interrupted, it finishes with the
cases it has.

Errors: object = mean absolute difference of pixel values over it; shadow = mean absolute difference
of its factor, over the pixels that some light's shadow darkens by 3 % (one region for all lights),
both after a blur of 1.5 pixels against noise; blurred = the shadow's after a Gaussian blur of a
sixth of the object's size; darkness = what the shadow takes of the light there, over what the true
one takes; "no shadow" is the error of leaving it out; side = angle in degrees
between the directions in which the two shadows fall, where both fall to one side.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from compose_evidence_tables import (
    AGAIN,
    KINDS,
    MATERIALS,
    UNSHADOWED,
    Row,
    summary,
    write_tables,
)
from PIL import Image, ImageDraw
from rich.progress import track

from deeplight.camera import BACKGROUND_FRACTION, PinholeCamera
from deeplight.camera_response import LUMINANCE
from deeplight.dataset import Example, open_dataset
from deeplight.estimate.onnx_estimator import OnnxEstimator
from deeplight.evaluate.baselines.suite import baselines_for
from deeplight.frames import turned
from deeplight.harmonics import dominant_light
from deeplight.io.image import write_png
from deeplight.io.run_record import write_run_toml
from deeplight.lighting import Lighting
from deeplight.preprocess import normalise
from deeplight.render.compose import SPAN, Composed, Item, Settings, compose
from deeplight.render.composite import RESPONSE
from deeplight.render.ground import Viewpoint
from deeplight.render.look import blurred
from deeplight.render.trace import Quality
from deeplight.simulate.phone import PHONES

TRUTH = "true light"
STANDS = (0.5, 0.74)  # of the kept photo's width and height
LEAST_DEPRESSION = 0.30  # sine of how far below the horizon the place lies
SUN_SHARE = 0.34  # of the power in one direction: outdoors with more is sun, else shade
QUALITY = Quality(samples=16, shadow_samples=10, shadow_pixels=16_000, fine=4)
LATLONG_HEIGHT = 128
DENOISE_PX = 1.5
DARK = 0.97  # a shadow is where the factor is smaller
BLUR = 1 / 6  # of the object's size
ONE_SIDED = 0.15  # a shadow whose centre is nearer to the object, in object sizes, has no side
ENLARGED = 2  # in the figure of few cases
TILE = (0.10, 0.50, 0.90, 0.82)  # left, top, right, bottom of what a picture of a case shows


@dataclass(frozen=True)
class Case:
    """One photo."""

    example: Example
    lights: dict[str, Lighting]

    @property
    def kind(self) -> str:
        if self.example.meta.scene == "indoor":
            return "indoor"
        return "sun" if dominant_light(self.lights[TRUTH]).share > SUN_SHARE else "shade"


def main(args: argparse.Namespace) -> None:
    data = open_dataset(args.data)
    model = OnnxEstimator(threads=1)
    estimators = [model, *baselines_for(data, args.split)]
    names = [estimator.name for estimator in estimators]
    examples = list(chosen(data.index(args.split), args.cases))
    args.out.mkdir(parents=True, exist_ok=True)
    rows, cases, strips = [], [], []
    try:
        for example in track(examples, "composing"):
            case = lit(example, estimators)
            found, strip = measured(case, args.scale)
            rows, cases, strips = rows + found, [*cases, case], [*strips, strip]
            write_tables(args.out, rows, names)
    except KeyboardInterrupt:
        print(f"interrupted after {len(cases)} of {len(examples)} cases")
    write_png(args.out / "cases.png", all_cases(cases, strips, names))
    shown = [strips[number] for number in medians(cases, rows)]
    write_png(args.out / "figure.png", figure(shown, names))
    settings = {k: str(v) for k, v in vars(args).items()}
    facts = {"cases": len(cases), "model": model.sha256, "data": data.manifest_sha256}
    write_run_toml(args.out, {"settings": settings}, facts)
    print(summary(rows, names))


def chosen(index, count: int) -> Iterator[Example]:
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


def lit(example: Example, estimators) -> Case:
    """The lights of every method, by name."""
    inputs = normalise(example.background[None])
    lights = {TRUTH: Lighting(example.true_lighting)}
    for estimator in estimators:
        lights[estimator.name] = Lighting.from_log_radiance(estimator.estimate_inputs(inputs)[0])
    return Case(example, lights)


def composed(case: Case, method: str, material: str, scale: int) -> Composed:
    """The bunny in the photo under one method's light."""
    photo = full_frame(case.example, scale)
    height, width, _ = photo.shape
    kept = height * BACKGROUND_FRACTION
    item = Item("bunny", material, (STANDS[0] * width, STANDS[1] * kept), turn_deg=20)
    seed, method = (1, TRUTH) if method == AGAIN else (0, method)
    settings = Settings(QUALITY, blur=False, grain=False, seed=seed, texture=False)
    light = case.lights[method].latlong(LATLONG_HEIGHT)
    return compose(photo, light, viewpoint(case.example, height, width), [item], settings)


def measured(case: Case, scale: int) -> tuple[list[Row], list[np.ndarray]]:
    """Errors of every method but the truth, for each material; the photo and all pictures."""
    rows, strip = [], [tile(full_frame(case.example, scale))]
    for material in MATERIALS:
        made = {m: composed(case, m, material, scale) for m in (*case.lights, AGAIN)}
        strip += [tile(made[method].composite.pixels) for method in case.lights]
        shadows = {method: shadow_of(picture) for method, picture in made.items()}
        region = np.min([shadows[method] for method in case.lights], axis=0) < DARK
        shadows[UNSHADOWED] = np.ones_like(shadows[TRUTH])
        for method in list(shadows)[1:]:
            sharp, soft, darkness = shadow_errors(shadows[TRUTH], shadows[method], region)
            meta = case.example.meta
            first = (case.example.key, meta.place, case.kind, material, method)
            others = errors(case, made, method)
            rows.append(Row(*first, others[0], sharp, soft, darkness, *others[1:]))
    return rows, strip


def errors(case: Case, made: dict[str, Composed], method: str) -> tuple[float, float, float]:
    """Of the object, the side of its shadow and the dominant light; nan without a picture."""
    if method not in made:
        return (np.nan, np.nan, np.nan)
    lights = (case.lights[TRUTH], case.lights.get(method, case.lights[TRUTH]))
    true, other = made[TRUTH], made[method]
    return (
        object_error(true, other),
        angle_deg(shadow_side(true), shadow_side(other)),
        angle_deg(*(dominant_light(light).direction for light in lights)),
    )


def object_error(true: Composed, other: Composed) -> float:
    """Over the object, after a blur that takes out the noise of few samples."""
    cover = true.composite.layers.cover
    left, top, right, bottom = true.composite.layers.crop
    pixels = [_denoised(c)[top:bottom, left:right] for c in (true, other)]
    return float((np.abs(pixels[0] - pixels[1]).mean(-1) * cover).sum() / cover.sum())


def _denoised(picture: Composed) -> np.ndarray:
    """The object's pixel values, over the whole photo."""
    layers = picture.composite.layers
    both = blurred(np.concatenate([layers.radiance, layers.cover[..., None]], -1), DENOISE_PX)
    radiance = both[..., :3] / np.maximum(both[..., 3:], 1e-3)
    left, top, right, bottom = layers.crop
    result = np.zeros(picture.composite.pixels.shape, np.float32)
    result[top:bottom, left:right] = RESPONSE.pixel_from_radiance(radiance)
    return result


def shadow_errors(
    true: np.ndarray, other: np.ndarray, region: np.ndarray
) -> tuple[float, float, float]:
    """After a blur that takes out the noise of few samples; after a wide one; the darkness."""
    difference = (other - true)[..., None]
    wide_px = BLUR * SPAN * min(true.shape)
    sharp, soft = (np.abs(blurred(difference, px))[region] for px in (DENOISE_PX, wide_px))
    darkness = (1 - other)[region].sum() / max((1 - true)[region].sum(), 1e-9)
    return float(sharp.mean()), float(soft.mean()), float(darkness)


def shadow_of(picture: Composed) -> np.ndarray:
    """Luminance of the shadow over the whole photo; 1 under objects."""
    result = np.ones(picture.composite.pixels.shape[:2])
    layers = picture.composite.layers
    left, top, right, bottom = layers.crop
    part = np.where(layers.cover > 0, 1.0, layers.shadow @ LUMINANCE)
    result[top:bottom, left:right] = part
    return result


def shadow_side(picture: Composed) -> np.ndarray:
    """Where the shadow lies, seen from the object on the plane, in its sizes; nan if nowhere."""
    scene, layers = picture.scene, picture.composite.layers
    left, top, right, bottom = layers.crop
    view = scene.viewpoint
    rays = turned(view.camera.rays()[top:bottom, left:right], view.world_from_camera)
    down = np.minimum(rays[..., 1:2], -1e-6)
    points = rays * (-view.height_m / down)
    low, high = scene.box
    away = (points - (low + high) / 2)[..., [0, 2]] / float((high - low).max())
    lost = np.maximum(1 - layers.shadow @ LUMINANCE, 0) * (layers.cover == 0)
    distance = -view.height_m / down[..., 0]  # a pixel far away covers more ground
    weight = lost * distance**2 / -down[..., 0] * (np.linalg.norm(away, axis=-1) < 3)
    if weight.sum() <= 0:
        return np.full(2, np.nan)
    side = (weight[..., None] * away).sum((0, 1)) / weight.sum()
    return side if np.linalg.norm(side) > ONE_SIDED else np.full(2, np.nan)


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


def tile(frame: np.ndarray) -> np.ndarray:
    """The part of a picture around the object."""
    rows, columns = round(len(frame) * BACKGROUND_FRACTION), frame.shape[1]
    left, top, right, bottom = TILE
    across = slice(round(left * columns), round(right * columns))
    return frame[round(top * rows) : round(bottom * rows), across]


def full_frame(example: Example, scale: int) -> np.ndarray:
    """The background enlarged, and below it the part of the frame that was cut, continued."""
    background = Image.fromarray(example.background)
    size = (background.width * scale, background.height * scale)
    pixels = np.asarray(background.resize(size, Image.Resampling.BICUBIC))
    rows = round(size[1] / BACKGROUND_FRACTION) - size[1]
    return np.concatenate([pixels, np.repeat(pixels[-1:], rows, axis=0)])


def viewpoint(example: Example, height: int, width: int) -> Viewpoint:
    """The camera as it was held, from the pose the example records."""
    up = np.array(example.meta.details["world_from_camera"]).T @ [0.0, 1.0, 0.0]
    camera = PinholeCamera(width, height, PHONES[example.meta.camera].vertical_fov_rad)
    pitch, roll = float(np.arcsin(-up[2])), float(np.arctan2(up[0], up[1]))
    return Viewpoint(camera, pitch_rad=pitch, roll_rad=roll)


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
