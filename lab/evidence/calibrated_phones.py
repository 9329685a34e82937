"""What `deeplight calibrate` does for phones of their own, in places they were not calibrated in.

    python -m lab.evidence.calibrated_phones --hdri FOLDER --old data/sim-v1 --out data/phones

Films each phone's clips in the validation places and its test in the test places, calibrates with
the clips, and prints the table of docs/calibrate.md: each metric after over before, on the phone's
other places, on the old phone's where photos say that it is another, and where they do not. `kept`
is the camera of recipe v2 that nothing learnt from; a number draws another phone of its family.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

from deeplight.calibrate.gains import METRICS
from deeplight.calibrate.run import calibrate_model
from deeplight.dataset import Example, ExampleMeta, ShardPlan, open_dataset, plan_split
from deeplight.errors import InputError
from deeplight.estimators.calibration import Use
from deeplight.estimators.onnx import OnnxEstimator
from deeplight.evaluate.models import NamedModel
from deeplight.evaluate.run import evaluate
from deeplight.simulate import panorama
from deeplight.simulate.many_phones import PhoneSettings, draw_phone, kept_phone
from deeplight.simulate.many_takes import film_many
from deeplight.simulate.panorama import Place
from deeplight.simulate.place_light import PlaceLight
from deeplight.sphere import PAPER_RIG

FRAMES = 3
SPLITS = {"clips": "val", "test": "unseen"}
COLUMNS = ("mirror", "silver", "diffuse", "hue")


@dataclass(frozen=True)
class Args:
    """Settings of the measurement."""

    hdri: Path
    """Folder of HDR panoramas with validation and test places."""
    old: Path
    """Data set of the phone that the model learnt from."""
    out: Path
    """Folder for data sets and models; what is there is used again."""
    phones: tuple[str, ...] = ("kept", "1", "2", "3", "4", "5")
    """Phones, `kept` or numbers."""
    takes: int = 2
    """Clips in each place."""
    weights: Path | None = None
    """Model to start from; left out, the shipped one."""


def main(args: Args) -> None:
    """Film, calibrate, measure, print."""
    for part in SPLITS:
        film(args, part)
    before = measured(args.weights, args.old)
    measures = "mirror, silver, diffuse, hue"
    print(f"| phone | gains, R G B | other places: {measures} | the old phone | unnamed |")
    print("|---|---|---|---|---|")
    for phone in args.phones:
        mine, test = args.out / f"{phone}.onnx", args.out / f"test-{phone}"
        try:
            found = calibrate_model(
                [args.out / f"clips-{phone}"], mine, args.weights, camera=f"phone {phone}"
            )
        except InputError as error:
            print(f"| {phone} | refused: {error.got} | | | |")
            continue
        ratios = [
            measured(mine, test) / measured(args.weights, test),
            measured(mine, args.old, "never") / before,
            measured(mine, args.old) / before,
        ]
        gains = " ".join(f"{np.exp(value):.2f}" for value in found.log_gains)
        cells = [", ".join(f"{value:.3f}" for value in ratio) for ratio in ratios]
        print(f"| {phone} | {gains} | {' | '.join(cells)} |", flush=True)


def measured(model: Path | None, data: Path, calibrated: Use = "matching") -> np.ndarray:
    """The mean of each metric over the test places of a data set; "never" is what a photo gets that
    names another camera than the model's."""
    network = OnnxEstimator(model)
    network.calibrated = calibrated
    report = evaluate([NamedModel("model", network)], open_dataset(data), "test", 192)
    metrics = report.scores["model"].metrics()
    return np.array([np.nanmean(metrics[name]) for name in METRICS])


def film(args: Args, part: str) -> None:
    """One data set for each phone, of one part of the places; a place is read once for all."""
    kept = [p for p in panorama.places_in(args.hdri) if not p.synthetic_ground]
    places = [p for p in kept if p.held_out_split.startswith(SPLITS[part])]
    missing = [p for p in args.phones if not (args.out / f"{part}-{p}" / "manifest.json").is_file()]
    examples: dict[str, list[Example]] = {phone: [] for phone in missing}
    for place in places if missing else ():
        light = PlaceLight.of(panorama.load(place))
        for phone in missing:
            examples[phone] += filmed(light, place, phone, args.takes)
    for phone, own in examples.items():
        write(args.out / f"{part}-{phone}", own)


def filmed(light: PlaceLight, place: Place, phone: str, takes: int) -> Iterator[Example]:
    """Takes of one phone in one place; every phone is held alike."""
    for take in range(takes):
        held = np.random.default_rng([5, take, *place.name.encode()])
        settings = phone_named(phone, np.random.default_rng([6, take, *place.name.encode()]))
        for number, frame in enumerate(film_many(light, settings, PAPER_RIG, FRAMES, held)):
            name = f"{place.name[:50]}-{take}"
            where = (place.name, name, number, place.scene, place.held_out_split)
            meta = ExampleMeta(*where, PAPER_RIG.name, phone, place.licence, place.path.name)
            yield Example(
                f"{name}-{number}", frame.background, frame.spheres, meta,
                frame.true_lighting.radiance, frame.jpeg,
            )  # fmt: skip


def phone_named(phone: str, rng: np.random.Generator) -> PhoneSettings:
    """The same phone every time: `kept` varies a little from take to take, as it does in v2."""
    return (
        kept_phone(rng) if phone == "kept" else draw_phone(np.random.default_rng([77, int(phone)]))
    )


def write(folder: Path, examples: Sequence[Example]) -> None:
    """Examples as a data set."""
    by_split = {
        s: [e for e in examples if e.meta.split == s] for s in {e.meta.split for e in examples}
    }
    jobs = [job for s, own in sorted(by_split.items()) for job in plan_split(s, len(own))]
    plan = ShardPlan.begin(folder, jobs, {PAPER_RIG.name: PAPER_RIG.to_dict()}, {})
    for job in plan.missing():
        plan.write(job, by_split[job.split][job.first : job.first + job.count])
    plan.finish()


if __name__ == "__main__":
    main(tyro.cli(Args))
