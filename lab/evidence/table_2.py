"""Table 2: our landscape network against the rivals of section 4.3, trained on the same places.

    python -m lab.evidence.table_2 HDRI DATA OUT --start landscape.onnx --model landscape.onnx

Trains Gardner 2017 on views of HDRI's indoor training panoramas and Hold-Geoffroy 2017 on those of
the outdoor ones, as in the paper, lets them answer DATA's test split, fuses a front and a rear view
of each example (Cheng 2018's setting), and writes the reports of `deeplight evaluate` to OUT/indoor
and OUT/outdoor: means, standard deviations, paired intervals over places, box plots of radiance and
the comparison figure. OUT/rivals.md has the tables that docs/rivals.md shows. A trained rival in
OUT is used again, a training that was killed goes on, and answers that are there are not made anew.
"""

import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tyro

from deeplight.cli.main import run_command
from deeplight.cli.screen import progress_bar, results_console
from deeplight.dataset import DataSet, open_dataset
from deeplight.estimators.open import open_model
from deeplight.evaluate.bootstrap import PlaceBootstrap
from deeplight.evaluate.command import Wanted, evaluation
from deeplight.evaluate.files import write_files
from deeplight.evaluate.light_metrics import brightest
from deeplight.evaluate.report_tables import interval
from deeplight.evaluate.result import SplitResult
from deeplight.evaluate.rivals.crops import Pair, ViewPlan, all_pairs
from deeplight.evaluate.rivals.predict import write_answers
from deeplight.evaluate.rivals.rival import PRESETS, Rival, load_rival
from deeplight.evaluate.rivals.training import train_rival
from deeplight.evaluate.run import examples_to_measure
from deeplight.evaluate.scores import TRUE_LIGHTING
from deeplight.io.atomic import replacing
from deeplight.simulate.panorama import load, places_in
from lab.evidence.opposite_views import NAME as OPPOSITE
from lab.evidence.opposite_views import write_opposite_views

SCENES = {"indoor": "gardner_2017", "outdoor": "hold_geoffroy_2017"}
FILTER_EPOCHS = 30
"""Of Gardner's filter at the end of training: a half-width of 7 degrees, two to three texels."""
MEASURES = {"l1_diffuse": 3, "l1_matte_silver": 3, "l1_mirror": 3, "theta_rgb_deg": 1}
"""Columns, and their digits."""
EARLIER = ("khan_2006", "nearest_neighbour")
"""What Gardner et al. compare with: Khan et al. 2006, and Karsch et al. 2014 or what is near it."""
HEAD = (
    "| main light | off | azimuth off | under 45° "
    "| of another photo: off | azimuth off | under 45° |"
)


@dataclass(frozen=True)
class Args:
    """What is compared."""

    hdri: tyro.conf.Positional[Path]
    """Folder of panoramas with a manifest.csv."""
    data: tyro.conf.Positional[str]
    """Data set to measure on."""
    out: tyro.conf.Positional[Path]
    """Folder of rivals, answers and the reports."""
    steps: int = 1000
    """Of each rival's training."""
    minutes: float = 0.0
    """Each training ends after them, and the best step so far is kept; 0: never."""
    views: int = 0
    """Of each panorama, at random azimuths; 0: as many as the preset says."""
    start: Path | None = None
    """What the rivals' encoders start from: ImageNet's MobileNetV2 (.npz), or a network of ours."""
    published: bool = False
    """Each rival once more with its paper's own encoder, which starts from nothing."""
    published_steps: tuple[int, int] = (260, 180)
    """Of those trainings, indoors and outdoors."""
    published_width: float = 1.0
    """Channels of that, as a share of the paper's."""
    examples: int | None = None
    """Measure only this number of examples of each kind of scene, evenly spread."""
    model: str = ""
    """Our landscape network; left out, the one in the package."""


def pairs_in(args: Args, split: str, scene: str, views: ViewPlan) -> list[Pair]:
    """Views of the places that our network's data set has: those whose ground is real."""
    places = [p for p in places_in(args.hdri) if (p.split, p.scene) == (split, scene)]
    return all_pairs([load(place) for place in places if not place.synthetic_ground], views)


def trained(scene: str, preset: str, args: Args) -> Rival:
    """The rival in OUT, or a new one; a training that was killed goes on."""
    path = args.out / f"{preset}.safetensors"
    if path.is_file():
        return load_rival(path)
    config, steps = PRESETS[preset], args.steps
    if config.encoder == "published":
        config = replace(config, width=args.published_width)
        steps = args.published_steps[list(SCENES).index(scene)]
    views = replace(config.views, per_panorama=args.views or config.views.per_panorama)
    epoch = max(1, steps // FILTER_EPOCHS)
    config = replace(config, views=views, steps=steps, epoch_steps=epoch)
    pairs, held_out = (pairs_in(args, split, scene, views) for split in ("train", "val"))
    path.parent.mkdir(parents=True, exist_ok=True)
    with progress_bar(f"{preset}: {len(pairs)} views", steps) as bar:
        rival = train_rival(
            config,
            pairs,
            held_out,
            args.start,
            path.with_suffix(".checkpoint"),
            lambda step, loss: bar(),
            args.minutes,
        )
    rival.save(path)
    return rival


def name_of(rival: Rival) -> str:
    """What tables call it; as published it is its paper's."""
    name = rival.config.name
    return f"{name}_paper" if rival.config.encoder == "published" else name


def answered(rivals: Sequence[Rival], data: DataSet, split: str, args: Args) -> list[str]:
    """Folders of the answers of rivals and of two opposite views, as `--panoramas` takes them."""
    index = data.index(split)
    numbers = examples_to_measure(index, [], args.examples).tolist()
    by_name, found = {name_of(rival): rival for rival in rivals}, []
    for method in (*by_name, OPPOSITE):
        folder = args.out / f"{split}-{method}"
        missing = [n for n in numbers if not (folder / f"{index.keys[n]}.exr").is_file()]
        with progress_bar(f"{split}: answers of {method}", len(missing)) as bar:
            if method == OPPOSITE:
                write_opposite_views(index, missing, args.hdri, open_model(), folder, bar)
            else:
                write_answers(by_name[method], index, missing, folder, bar)
        found.append(f"{method}={folder}")
    return found


def measured(scene: str, args: Args) -> tuple[list[Rival], SplitResult]:
    """One kind of scene: its report in OUT, and the numbers."""
    data, split = open_dataset(args.data), f"unseen_{scene}"
    presets = [f"{SCENES[scene]}-ours", *([SCENES[scene]] if args.published else [])]
    rivals = [trained(scene, preset, args) for preset in presets]
    panoramas = answered(rivals, data, split, args)
    models = [f"landscape={args.model}"] if args.model else []
    wanted = Wanted(data, (split,), models, panoramas, args.examples, with_photo=False)
    with progress_bar(f"{split}: measuring") as bar:
        found = evaluation(wanted, progress=bar)
    write_files(args.out / scene, found.results, data, found.models)
    return rivals, found.results[0]


def table(scene: str, result: SplitResult) -> list[str]:
    """Mean +- sd of every method, and what ours has less than each, as Markdown."""
    ours = result.methods[0]
    lines = [f"| {scene} | L1(d) | L1(s) | L1(m) | θ, ° |", "|---|---|---|---|---|"]
    for name in result.report.scores:
        found = [(result.find(name, scene, m), d) for m, d in MEASURES.items()]
        cells = [f"{s.mean.value:.{d}f} ± {s.sd:.{d}f}" for s, d in found if s]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    lines += ["", f"| {ours} less | L1(d) | L1(s) | L1(m) | θ, ° |", "|---|---|---|---|---|"]
    found = [(result.find(ours, scene, m), d) for m, d in MEASURES.items()]
    for other in next(s for s, _ in found if s).difference:
        cells = [interval(s.difference[other], d) for s, d in found if s]
        lines.append(f"| {other} | {' | '.join(cells)} |")
    return lines


def less_than_others(scene: str, result: SplitResult, method: str) -> list[str]:
    """What a rival has less than the methods that Gardner et al. compare with, over places."""
    report = result.report
    draws = PlaceBootstrap(report.places)
    own = report.scores[method].metrics()
    lines = [f"| {scene}: {method} less | L1(d) | L1(s) | L1(m) | θ, ° |", "|---|---|---|---|---|"]
    for other in EARLIER:
        theirs = report.scores[other].metrics()
        cells = [interval(draws.difference(own[m], theirs[m]), d) for m, d in MEASURES.items()]
        lines.append(f"| {other} | {' | '.join(cells)} |")
    return lines


def lights_found(rival: str, result: SplitResult) -> str:
    """Whether a rival finds the main light at all: against its own answers to other photos.

    The azimuth is about the vertical, as the camera was held; by chance it is 90 degrees off.
    """
    report = result.report
    true, found = (_main_lights(report.log_radiance[n]) for n in (TRUE_LIGHTING, rival))
    shuffled = np.roll(found, len(found) // 2, axis=0)
    places = PlaceBootstrap(report.places)
    cells = []
    for own in (found, shuffled):
        off = np.degrees(np.arccos(np.clip((own * true).sum(1), -1, 1)))
        around = _azimuths_apart(own, true, report.world_from_camera)
        cells.append(
            f"{interval(places.median(off), 0)}° | {interval(places.median(around), 0)}° | "
            f"{np.nanmean(around < 45):.0%}"
        )
    return f"| {rival} | {cells[0]} | {cells[1]} |"


def _main_lights(log_radiance: np.ndarray) -> np.ndarray:
    return brightest(np.exp(np.asarray(log_radiance, np.float32))).directions


def _azimuths_apart(a: np.ndarray, b: np.ndarray, world_from_camera: np.ndarray) -> np.ndarray:
    """Degrees between the azimuths of two directions of each example."""
    level = [np.einsum("nij,nj->ni", world_from_camera, directions) for directions in (a, b)]
    angles = [np.arctan2(directions[:, 0], -directions[:, 2]) for directions in level]
    return np.abs(np.degrees(np.angle(np.exp(1j * (angles[0] - angles[1])))))


def history(rivals: Sequence[Rival]) -> list[str]:
    """What each rival was trained with, and which step was kept."""
    lines = [
        "| rival | steps | samples | kept step | loss: training, held out |",
        "|---|---|---|---|---|",
    ]
    for rival in rivals:
        kept = min(rival.history, key=lambda row: row[2])
        steps = int(rival.history[-1][0])
        samples = steps * rival.config.batch_size
        lines.append(
            f"| {name_of(rival)} | {steps} | {samples:,} | {kept[0]:.0f} "
            f"| {kept[1]:.2f}, {kept[2]:.2f} |"
        )
    return lines


def run(args: Args) -> None:
    both = {scene: measured(scene, args) for scene in SCENES}
    lines = history([rival for rivals, _ in both.values() for rival in rivals])
    lines += ["", HEAD, "|---|---|---|---|---|---|---|"]
    for rivals, result in both.values():
        names = [name_of(rival) for rival in rivals]
        lines += [lights_found(name, result) for name in (*names, result.methods[0])]
    for scene, (rivals, result) in both.items():
        lines += ["", *table(scene, result)]
        for rival in rivals:
            lines += ["", *less_than_others(scene, result, name_of(rival))]
    with replacing(args.out / "rivals.md") as temporary:
        temporary.write_text("\n".join(lines) + "\n", encoding="utf-8")
    results_console().print("\n".join(lines), markup=False, highlight=False, soft_wrap=True)


if __name__ == "__main__":
    sys.exit(run_command("python -m lab.evidence.table_2", sys.modules[__name__], sys.argv[1:]))
