"""Table 2: our landscape network against the rivals of section 4.3, trained on the same places.

    python -m lab.evidence.table_2 HDRI DATA OUT [--steps 2000] [--model OURS.onnx] [--width 1.0]

Trains both rivals on the views of HDRI's training panoramas (Gardner 2017 indoors, Hold-Geoffroy
2017 outdoors, as in the paper), lets them answer DATA's test split, and writes the report of
`deeplight evaluate` to OUT/report: means, standard deviations, paired intervals over places, box
plots of radiance and the comparison figure. A trained rival in OUT is used again.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import tyro

from deeplight.cli.main import main as deeplight
from deeplight.cli.screen import progress_bar
from deeplight.dataset import open_dataset
from deeplight.evaluate.rivals.crops import all_pairs
from deeplight.evaluate.rivals.predict import write_answers
from deeplight.evaluate.rivals.training import PRESETS, Rival, load_rival, smaller, train_rival
from deeplight.simulate.panorama import load, places_in

SCENES = {"gardner_2017-ours": "indoor", "hold_geoffroy_2017-same-camera": "outdoor"}


@dataclass(frozen=True)
class Args:
    """What is compared."""

    hdri: tyro.conf.Positional[Path]
    """Folder of panoramas with a manifest.csv."""
    data: tyro.conf.Positional[str]
    """Data set to measure on."""
    out: tyro.conf.Positional[Path]
    """Folder of rivals, answers and the report."""
    steps: int = 2000
    """Of each rival's training."""
    width: float = 1.0
    """Channels of the rivals as a share of the paper's."""
    split: str = "test"
    """What is measured."""
    model: str = ""
    """Our landscape network; left out, the one in the package."""


def trained(preset: str, args: Args) -> Rival:
    """The rival in OUT, or a new one."""
    path = args.out / f"{preset}.safetensors"
    if path.is_file():
        return load_rival(path)
    config = replace(PRESETS[preset], steps=args.steps)
    if args.width != 1:
        config = smaller(config, args.width, config.photo_size)
    places = [p for p in places_in(args.hdri) if (p.split, p.scene) == ("train", SCENES[preset])]
    with progress_bar(f"{preset}: views of {len(places)} places", args.steps) as bar:
        pairs = all_pairs([load(place) for place in places], config.views)
        rival = train_rival(config, pairs, lambda step, loss: bar())
    rival.save(path)
    return rival


def main(args: Args) -> int:
    data = open_dataset(args.data)
    panoramas = []
    for preset in SCENES:
        rival, folder = trained(preset, args), args.out / preset
        with progress_bar(f"{preset}: answers", len(data.index(args.split))) as bar:
            write_answers(rival, data, args.split, folder, bar)
        panoramas += ["--panoramas", f"{rival.config.name}={folder}"]
    model = ["--model", args.model] if args.model else []
    report = ["--out", str(args.out / "report")]
    return deeplight(
        ["evaluate", "--data", args.data, "--split", args.split, *model, *panoramas, *report]
    )


if __name__ == "__main__":
    raise SystemExit(main(tyro.cli(Args)))
