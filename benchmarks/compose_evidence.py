"""Objects under estimated light beside the same objects under the scene's true light (figure 9).

python benchmarks/compose_evidence.py data/sim [--split val] [--cases 32] [--out runs/compose]

Takes simulated photos that look down on some ground and carry their true HDR light, spread over
the places of the split. Into each it puts the bunny, diffuse and silver, five and more times: under
the true light, the model's, and each baseline's. Writes errors.csv (one row for each picture),
summary.md (means with 95 % intervals over places), figure.png and run.toml.

Errors: object = mean absolute difference of pixel values over the object; shadow = mean absolute
difference of the shadow's factor where either is darker than 0.97; side = angle in degrees between
the directions in which the two shadows fall, where the true one falls to one side.
"""

import argparse
import csv
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw
from rich.progress import track

from deeplight.camera import BACKGROUND_FRACTION, PinholeCamera
from deeplight.camera_response import LUMINANCE
from deeplight.dataset import Example, open_dataset
from deeplight.estimate.onnx_estimator import OnnxEstimator
from deeplight.evaluate.baselines.suite import baselines_for
from deeplight.evaluate.bootstrap import PlaceBootstrap
from deeplight.frames import turned
from deeplight.harmonics import dominant_light
from deeplight.io.atomic import replacing
from deeplight.io.image import write_png
from deeplight.io.run_record import write_run_toml
from deeplight.lighting import Lighting
from deeplight.preprocess import normalise
from deeplight.render.compose import Composed, Item, Settings, compose
from deeplight.render.composite import RESPONSE
from deeplight.render.ground import Viewpoint
from deeplight.render.look import blurred
from deeplight.render.trace import Quality
from deeplight.simulate.phone import PHONES

TRUTH, MATERIALS = "true light", ("diffuse", "silver")
KINDS = ("indoor", "shade", "sun")
STANDS = (0.5, 0.74)  # of the kept photo's width and height
LEAST_DEPRESSION = 0.30  # sine of how far below the horizon the place lies
SUN_SHARE = 0.34  # of the power in one direction: outdoors with more is sun, else shade
COARSE = Quality(samples=8, shadow_samples=16, shadow_pixels=800)
FINE = Quality(samples=32, shadow_samples=32, shadow_pixels=2000)
LATLONG_HEIGHT = 128
DENOISE_PX = 1.5
ONE_SIDED = 0.15  # a shadow whose centre is nearer to the object, in object sizes, has no side
NEAR_TRUTH_DEG = 45


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


@dataclass(frozen=True)
class Row:
    """One picture's errors."""

    key: str
    place: str
    kind: str
    material: str
    method: str
    object: float
    shadow: float
    side_deg: float
    light_deg: float


def main(args: argparse.Namespace) -> None:
    data = open_dataset(args.data)
    model = OnnxEstimator(threads=1)
    estimators = [model, *baselines_for(data, args.split)]
    names = [estimator.name for estimator in estimators]
    examples = list(chosen(data.index(args.split), args.cases))
    args.out.mkdir(parents=True, exist_ok=True)
    rows, kept = [], []
    for example in track(examples, "composing"):
        case = lit(example, estimators)
        rows += measured(case, args.scale, COARSE)
        kept.append(case)
        write_tables(args.out, rows, names)  # what is done survives an interruption
    shown = [case for kind in KINDS for case in of_kind(kept, kind, args.figure_cases)]
    write_png(args.out / "figure.png", figure(shown, names, args.figure_scale))
    settings = {k: str(v) for k, v in vars(args).items()}
    facts = {"cases": len(examples), "model": model.sha256, "data": data.manifest_sha256}
    write_run_toml(args.out, {"settings": settings}, facts)
    print(summary(rows, names))


def write_tables(folder: Path, rows: list[Row], names: list[str]) -> None:
    with replacing(folder / "errors.csv") as path, path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(asdict(rows[0])))
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)
    with replacing(folder / "summary.md") as path:
        path.write_text(summary(rows, names), encoding="utf-8")


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


def composed(case: Case, method: str, material: str, scale: int, quality: Quality) -> Composed:
    """The bunny in the photo under one method's light."""
    photo = full_frame(case.example, scale)
    height, width, _ = photo.shape
    kept = height * BACKGROUND_FRACTION
    item = Item("bunny", material, (STANDS[0] * width, STANDS[1] * kept), turn_deg=20)
    settings = Settings(quality, "scalar", blur=False, grain=False)
    light = case.lights[method].latlong(LATLONG_HEIGHT)
    return compose(photo, light, viewpoint(case.example, height, width), [item], settings)


def measured(case: Case, scale: int, quality: Quality) -> Iterator[Row]:
    """Errors of every method but the truth, for each material."""
    truth_towards = dominant_light(case.lights[TRUTH]).direction
    for material in MATERIALS:
        true = composed(case, TRUTH, material, scale, quality)
        for method in list(case.lights)[1:]:
            towards = dominant_light(case.lights[method]).direction
            other = composed(case, method, material, scale, quality)
            yield Row(
                case.example.key,
                case.example.meta.place,
                case.kind,
                material,
                method,
                object_error(true, other),
                shadow_error(true, other),
                angle_deg(shadow_side(true), shadow_side(other)),
                angle_deg(truth_towards, towards),
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


def shadow_error(true: Composed, other: Composed) -> float:
    ours, theirs = (_on_one_crop(c, true, other) for c in (true, other))
    dark = np.minimum(ours, theirs) < 0.97
    return float(np.abs(ours - theirs)[dark].mean()) if dark.any() else 0.0


def _on_one_crop(picture: Composed, *both: Composed) -> np.ndarray:
    """Luminance of the shadow over the whole photo; 1 under objects."""
    height, width, _ = both[0].composite.pixels.shape
    result = np.ones((height, width))
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


def summary(rows: list[Row], names: list[str]) -> str:
    """Markdown tables: means with intervals, by material and kind, and the sides of shadows."""
    lines = []
    for error in ("object", "shadow"):
        for material in MATERIALS:
            lines += [f"\n{error}, {material}", "", "| light | all | indoor | shade | sun |"]
            lines += ["|---|---|---|---|---|"]
            for name in names:
                picked = [r for r in rows if r.material == material and r.method == name]
                cells = [_cell(picked, error)]
                for kind in KINDS:
                    cells.append(_cell([r for r in picked if r.kind == kind], error))
                lines.append(f"| {name} | {' | '.join(cells)} |")
    lines += ["", f"shadows under light within {NEAR_TRUTH_DEG} degrees of the truth", ""]
    lines += ["| light | shadows | farthest off | on the wrong side |", "|---|---|---|---|"]
    for name in names:
        near = [r.side_deg for r in rows if r.method == name and r.light_deg < NEAR_TRUTH_DEG]
        near = [side for side in near if np.isfinite(side)]
        wrong = sum(side > 90 for side in near)
        most = f"{max(near):.0f} degrees" if near else "-"
        lines.append(f"| {name} | {len(near)} | {most} | {wrong} |")
    return "\n".join([*lines, ""])


def _cell(rows: list[Row], error: str) -> str:
    if not rows:
        return "-"
    values = np.array([getattr(row, error) for row in rows], float)
    interval = PlaceBootstrap(np.array([row.place for row in rows])).mean(values)
    return f"{interval.value:.3f} ({interval.low:.3f} to {interval.high:.3f}, n = {len(rows)})"


def of_kind(cases: list[Case], kind: str, count: int) -> list[Case]:
    """The first cases of a kind, from different places."""
    found: dict[str, Case] = {}
    for case in cases:
        if case.kind == kind:
            found.setdefault(case.example.meta.place, case)
    return list(found.values())[:count]


def figure(cases: list[Case], names: list[str], scale: int) -> np.ndarray:
    """A row for each case and material: the photo, the truth, and every method."""
    tiles = []
    for case in track(cases, "figure"):
        for material in MATERIALS:
            photo = _kept(full_frame(case.example, scale))
            row = [photo]
            for method in (TRUTH, *names):
                row.append(_kept(composed(case, method, material, scale, FINE).composite.pixels))
            tiles.append(np.concatenate(row, axis=1))
    picture = np.concatenate(tiles)
    width = tiles[0].shape[1] // (2 + len(names))
    canvas = Image.new("RGB", (picture.shape[1], picture.shape[0] + 22), "white")
    canvas.paste(Image.fromarray(picture), (0, 22))
    draw = ImageDraw.Draw(canvas)
    for number, name in enumerate(("photo", TRUTH, *names)):
        draw.text((number * width + 6, 5), name.replace("_", " "), "black")
    return np.asarray(canvas)


def full_frame(example: Example, scale: int) -> np.ndarray:
    """The background enlarged, and below it the part of the frame that was cut, continued."""
    background = Image.fromarray(example.background)
    size = (background.width * scale, background.height * scale)
    pixels = np.asarray(background.resize(size, Image.Resampling.BICUBIC))
    rows = round(size[1] / BACKGROUND_FRACTION) - size[1]
    return np.concatenate([pixels, np.repeat(pixels[-1:], rows, axis=0)])


def _kept(frame: np.ndarray) -> np.ndarray:
    return frame[: round(len(frame) * BACKGROUND_FRACTION)]


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
    parser.add_argument("--figure-scale", type=int, default=1)
    parser.add_argument("--figure-cases", type=int, default=1, help="of each kind of scene")
    parser.add_argument("--out", type=Path, default=Path("runs/compose"))
    main(parser.parse_args())
